// The report of contours: all curves in the plane that shows most of them, the mean and its modes, one contour with its
// particles, and what speaks against whom.
import { byId, checkbox, choice, el, percent, plural, show, svg, table } from "./dom.js";
import { Packed } from "./data.js";
import { clearPage, stepByKeys, tableSave } from "./fits.js";
import { fileName, saveButton, saveSvg } from "./save.js";
import { length, setUnit } from "./units.js";

const REACH = 3; // standard deviations that the slider goes

export class Contours extends Packed {}

/** What of the plane all curves fill, a little more on every side: x, y, width, height. */
function frameOf(curves) {
  const lo = [Infinity, Infinity], hi = [-Infinity, -Infinity];
  for (const c of curves)
    c.forEach((v, k) => {
      lo[k % 2] = Math.min(lo[k % 2], v);
      hi[k % 2] = Math.max(hi[k % 2], v);
    });
  const size = Math.max(hi[0] - lo[0], hi[1] - lo[1]) || 1, edge = 0.06 * size;
  return { box: [lo[0] - edge, -hi[1] - edge, hi[0] - lo[0] + 2 * edge, hi[1] - lo[1] + 2 * edge], size };
}

const pathOf = (c, closed) => {
  let d = "";
  for (let k = 0; k < c.length; k += 2) d += `${k ? "L" : "M"}${c[k]} ${-c[k + 1]}`;
  return d + (closed ? "Z" : "");
};

/** A drawing of curves [points, colour, width] and of dots [points, colour]; the plane's up is the page's. */
function drawing({ box, size }, closed, label) {
  const picture = svg("svg", { viewBox: box.join(" "), role: "img", "aria-label": label, class: "contours" });
  const draw = (curves, dots = []) =>
    picture.replaceChildren(
      ...curves.map(([points, colour, width]) => svg("path", { d: pathOf(points, closed), fill: "none", stroke: colour, "stroke-width": 0.004 * size * width, "stroke-linejoin": "round" })),
      ...dots.flatMap(([points, colour]) => Array.from({ length: points.length / 2 }, (_, k) =>
        svg("circle", { cx: points[2 * k], cy: -points[2 * k + 1], r: 0.008 * size, fill: colour }, svg("title", {}, `particle ${k}`)))));
  return { picture, draw };
}

const moved = (x, d, b) => x.map((v, k) => v + b * d[k]);
const badgeOf = (s) => (s.reasons.length ? el("span", { class: "badge bad" }, "! needs review") : el("span", { class: "badge good" }, "\u2713 certified"));
const word = (s) => (s.reasons.length ? "needs review" : "certified");

export function fillContours(model) {
  setUnit(null);
  const good = model.shapes.filter((s) => s.reasons.length === 0).length, n = model.shapes.length;
  byId("title").textContent = `Contours \u201c${model.title}\u201d`;
  document.title = `${model.title} \u2013 contours`;
  document.querySelector("footer p").textContent = "Keyboard: Tab reaches every control, the arrows move the slider, n and p choose the next and the previous contour.";
  byId("link").hidden = true;
  byId("summary").textContent = `${plural(n, model.closed ? "closed contour" : "open contour")}, ${model.mean_particles.length / 2} particles on each, in one pose; template ${model.template}. Lengths are in the unit of the input.`;
  byId("verdict").append(el("div", { class: `verdict ${good === n ? "good" : "bad"}` },
    el("span", { class: "sign", "aria-hidden": "true" }, good === n ? "\u2713" : "!"),
    el("div", {}, el("strong", {}, good === n ? "Certified. " : "Needs review. "),
      `Nothing speaks against the correspondence of ${good} of ${n} contours. `,
      ...model.shapes.filter((s) => s.reasons.length).slice(0, 10).map((s) => el("div", {}, `${s.name}: ${s.reasons.join("; ")}`)))));
  const section = clearPage([["modes", "Mean and modes"], ["shape", "Contours"], ["certificate", "Certificate"]]);
  const state = { chosen: 0, mode: 0, b: 0, particles: true, all: true };
  const frame = frameOf([model.mean, ...model.shapes.map((s) => s.curve)]), total = model.variances.reduce((a, b) => a + b, 0) || 1;

  const body = section("modes", "Mean and modes");
  const middle = drawing(frame, model.closed, "the mean contour, moved along a mode, over all contours");
  const value = el("output", {}), slider = el("input", { type: "range", min: -REACH, max: REACH, step: 0.1, value: 0, "aria-label": "standard deviations along the mode" });
  const drawMean = () => {
    const m = model.modes[state.mode], curve = m ? moved(model.mean, m.curve, state.b) : model.mean, dots = m ? moved(model.mean_particles, m.particles, state.b) : model.mean_particles;
    value.textContent = ` ${show(state.b, 2)} sd`;
    middle.draw([...(state.all ? model.shapes.map((s) => [s.curve, "#9998", 0.5]) : []), [model.mean, "#888", 1], [curve, "var(--accent, #06c)", 1.6]], state.particles ? [[dots, "var(--accent, #06c)"]] : []);
  };
  slider.addEventListener("input", () => { state.b = Number(slider.value); drawMean(); });
  body.append(
    el("div", { class: "tools" },
      model.modes.length > 0 && choice("Mode ", model.modes.map((m, k) => [String(k), `${k + 1}: ${percent(m.variance / total)} of the variance`]), "0", (v) => { state.mode = Number(v); drawMean(); }),
      slider, value,
      checkbox("Particles", true, (on) => { state.particles = on; drawMean(); }),
      checkbox("All contours", true, (on) => { state.all = on; drawMean(); }),
      saveButton("SVG", "the drawing", () => saveSvg(fileName(model.title, "mode", state.mode + 1, "sd", state.b), middle.picture))),
    middle.picture,
    el("h3", {}, "Quality"),
    el("p", { class: "soft" }, "Generalization: mean distance of the particles of a contour to their best fit by a model of the others. Specificity: mean distance of random contours of the model to the nearest real one. Both with the first modes; lower is better."),
    table(["modes", "variance", "generalization", "specificity"],
      model.variances.slice(0, 10).map((v, k) => [String(k + 1), percent(v / total), length(model.generalization[k]), length(model.specificity[k])]), [1, 2, 3]));

  const one = section("shape", "Contours"), own = drawing(frame, model.closed, "the chosen contour with its particles, and the mean"), details = el("p", {});
  const drawOne = () => {
    const s = model.shapes[state.chosen];
    own.draw([[model.mean, "#888", 1], [s.curve, "var(--accent, #06c)", 1.4]], [[s.particles, "var(--accent, #06c)"]]);
    details.textContent = `${s.name}: ${word(s)}${s.reasons.length ? ` (${s.reasons.join("; ")})` : ""}. The curve through its particles is ${length(s.mean)} from it on average, ${length(s.max)} at most.`;
  };
  const choose = (k) => { state.chosen = k; picker.value = String(k); drawOne(); };
  const select = choice("Contour ", model.shapes.map((s, k) => [String(k), s.name]), "0", (v) => choose(Number(v))), picker = select.querySelector("select");
  one.append(el("div", { class: "tools" }, select, saveButton("SVG", "the drawing", () => saveSvg(fileName(model.title, model.shapes[state.chosen].name), own.picture))), own.picture, details);

  const list = section("certificate", "Certificate");
  const head = ["name", "verdict", "distance_mean", "distance_max", "off", "rival"];
  const worst = model.shapes.map((s, k) => [s, k]).sort(([a], [b]) => b.reasons.length - a.reasons.length || b.off - a.off);
  list.append(
    el("p", { class: "soft" }, "Off: the largest distance between a contour and the curve through its particles, in spacings; from 0.5 on the contour is not reproduced. Rival: how much worse another start or direction fits the mean; below 1.1 it is just as likely."),
    tableSave(fileName(model.title, "contours"), () => [head, ...model.shapes.map((s) => [s.name, word(s), s.mean, s.max, s.off, s.rival])]),
    table(["contour", "verdict", "why", "distance, mean", "largest", "off", "rival"],
      worst.map(([s, k]) => [el("button", { type: "button", class: "link", onclick: () => { choose(k); byId("shape").scrollIntoView(); } }, s.name), badgeOf(s), s.reasons.join("; "),
        length(s.mean), length(s.max), show(s.off), s.rival === null ? "\u2013" : show(s.rival)]), [3, 4, 5, 6]));
  drawMean();
  drawOne();
  stepByKeys(n, state, choose);
  return { state, choose, move: (mode, b) => { state.mode = mode; state.b = b; slider.value = b; drawMean(); } };
}
