// Lengths with their unit, where it is known; who fills the page sets it once.
import { show } from "./dom.js";

let unit = null;
export const setUnit = (word) => (unit = word);
export const unitKnown = () => unit !== null;
/** " mm", or nothing where the unit is not known. */
export const unitTail = () => (unit === null ? "" : `\u00a0${unit}`);
/** A length for people. */
export const length = (x, digits = 3) => (Number.isFinite(x) ? show(x, digits) + unitTail() : "\u2013");
/** For the top of a page. */
export const unitSentence = () => (unit === null ? "The unit of length is unknown, since mesh files do not say; --unit mm sets it." : `Lengths are in ${unit}.`);
/** For labels of axes and heads of tables. */
export const unitNote = () => (unit === null ? "unit of the input" : unit);
