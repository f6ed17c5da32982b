// The page of `apsm norm`: a patient coloured by how unusual the surface is there, beside the shape that is
// expected for such a person; percentiles with how sure they are.  All figures come from norm.json.
import { byId, checkbox, choice, el, plural, show, table } from "./dom.js";
import { Packed, vertexNormals } from "./data.js";
import * as gl from "./gl.js";
import { chartWithSave, clearPage, differences, pText, stepByKeys, tableSave, twoViews, zChart } from "./fits.js";
import { saveTools } from "./save.js";
import { legend, weightsAt } from "./surface.js";
import { length, setUnit, unitSentence } from "./units.js";

const ALPHA = 0.05, REACH = 4; // standard deviations that the colours span
const whole = (x) => (Number.isFinite(x) ? show(x, Math.abs(x) >= 10 && Math.abs(x) < 99 ? 2 : 3) : "\u2013");
const range = ([a, b]) => (Number.isFinite(a) && Number.isFinite(b) ? `${whole(a)} to ${whole(b)}` : "not known");

export class Norms extends Packed {
  constructor(root, bytes) {
    super(root, bytes);
    this.F = this.array(root.faces, "integers");
  }
  clouds() {
    return this.shapes.filter((s) => s.vertices).map((s) => this.array(s.vertices, "positions"));
  }
  surfaces(k) {
    const s = this.shapes[k];
    return { patient: this.array(s.vertices, "positions"), expected: this.array(s.mean, "positions"), P: this.array(s.particles, "positions") };
  }
}

const unusual = (s) => s.particle_q.filter((q) => q <= ALPHA).length;

function facts(s, model) {
  const n = model.cohort, many = unusual(s);
  return [
    ["as a whole", `farther from what is expected than ${whole(s.percentile)}\u00a0% of ${plural(n, "shape")}`],
    ["how sure that is", `95\u00a0% interval ${range(s.percentile_interval)}\u00a0%; in 90\u00a0% of random halves of the cohort ${range(s.percentile_of_halves)}\u00a0%`],
    ["z, p", `z = ${show(s.z)} on the scale of the logarithm; p = ${pText(s.p)} that a shape of the cohort is as far`],
    ["distance from what is expected", `${length(s.distance)} (root mean square over particles)`],
    ["most unusual place", `p = ${pText(s.p_particles)}, allowing for all particles`],
    ["unusual particles", many ? `${plural(many, "particle")} of ${s.particle_q.length}, of which 5\u00a0% may be so by chance` : `none of ${s.particle_q.length}`],
  ];
}

function summary(model) {
  const given = model.formula ? `, allowing for ${model.formula.replace(/^\s*~\s*/, "")}` : "";
  return `${plural(model.shapes.length, "new shape")} among the ${plural(model.cohort, "shape")} of \u201c${model.title}\u201d${given}. ` +
    `${unitSentence()} For research; this is no diagnosis.`;
}

/** What to think of it at a glance. */
function fillVerdict(model) {
  const odd = model.shapes.filter((s) => s.p_particles <= ALPHA || s.p <= ALPHA);
  const doubt = model.not_certified.length, noted = model.shapes.filter((s) => s.note);
  const calm = !odd.length && !noted.length;
  byId("verdict").append(el("div", { class: `verdict ${calm ? "good" : "bad"}` },
    el("span", { class: "sign", "aria-hidden": "true" }, calm ? "\u2713" : "!"),
    el("div", {}, el("strong", {}, odd.length ? `Unusual: ${odd.map((s) => s.name).join(", ")}. ` : noted.length ? "Not unusual, as far as this can be trusted. " : "Not unusual. "),
      "A shape counts as unusual if fewer than 5\u00a0% of the cohort\u2019s shapes, each left out in turn, are as far from what is expected: as a whole, or at their most unusual particle. ",
      doubt ? `${doubt} of the norm\u2019s shapes are not certified: look at them before you trust this. ` : "",
      [...noted.map((s) => `${s.name}: ${s.note}`), ...(model.notes ?? [])].map((line) => el("div", {}, line)))));
}

export function fillNorms(model, { radius }) {
  setUnit(model.unit ?? null);
  byId("title").textContent = `Norm \u201c${model.title}\u201d`;
  document.title = `${model.title} \u2013 norm`;
  byId("summary").textContent = summary(model);
  fillVerdict(model);
  const section = clearPage([["shape", "Shape"], ["values", "Measurements"], ["modes", "Modes"], ["table", "Table"]]);
  const hasZ = Array.isArray(model.shapes[0].particle_z);
  const state = { chosen: 0, colour: hasZ ? "z" : "difference", particles: false };

  const body = section("shape", "The patient and what is expected");
  const canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": "the new shape; drag turns" });
  const other = el("canvas", { tabindex: 0, role: "img", "aria-label": "the shape that is expected; drag turns" });
  const view = new gl.View(canvas, { large: true, radius }), expectedView = new gl.View(other, { large: true, radius });
  const key = el("div", {}), heading = el("h3", {}), note = el("p", {}), details = el("div", {});
  const made = new Map();
  const partsOf = (k) => {
    if (made.has(k)) return made.get(k);
    const s = model.shapes[k], { patient, expected, P } = model.surfaces(k);
    const N = vertexNormals(patient, model.F), N0 = vertexNormals(expected, model.F), at = weightsAt(patient, P, 6);
    const spread = (x) => at.spread(x, 1, new Float32Array(patient.length / 3));
    const values = { difference: differences({ V0: expected, N0 }, patient), odd: spread(s.particle_q.map((q) => (q <= ALPHA ? 1 : 0))) };
    if (hasZ) values.z = spread(s.particle_z.map((z) => z ?? 0));
    const draw = (value) => gl.surfaceGeometry(patient, model.F, N, value);
    const parts = {
      values,
      reach: values.difference.reduce((m, x) => Math.max(m, Math.abs(x)), 0) || 1,
      geometry: Object.fromEntries(Object.entries(values).map(([name, value]) => [name, draw(value)])),
      expected: gl.surfaceGeometry(expected, model.F, N0, new Float32Array(expected.length / 3)),
      dots: gl.particleGeometry(P, new Float32Array(P.length).fill(0.25)),
    };
    made.set(k, parts);
    return parts;
  };

  const values = section("values", "Measurements"), modes = section("modes", "Modes"), list = section("table", "All shapes");
  const valuesAt = el("div", {}), modesAt = el("div", {});
  values.append(el("p", { class: "soft" }, "Sizes, and the numeric columns of the table of subjects. Expected is what the norm says for such a person; the percentile is the share of such persons below the value."), valuesAt);
  modes.append(el("p", { class: "soft" }, "How far the shape is from what is expected along each mode of the model, in standard deviations of such persons."), modesAt);

  const fillTables = (s) => {
    details.replaceChildren(table(["what", "found"], facts(s, model)));
    valuesAt.replaceChildren(s.values.length
      ? table(["measurement", "value", "expected", "z", "percentile", "shapes"], s.values.map((v) => [v.name, show(v.value, 4), show(v.expected, 4), show(v.z), whole(v.percentile), String(v.shapes)]), [1, 2, 3, 4, 5])
      : el("p", {}, "None."));
    modesAt.replaceChildren(
      chartWithSave(zChart(s.modes.map((m) => m.z), s.name, "mode; distance from what is expected, sd"), `modes ${s.name}`),
      el("details", {}, el("summary", {}, `All ${plural(s.modes.length, "mode")} as a table`),
        table(["mode", "z", "percentile"], s.modes.map((m, k) => [String(k + 1), show(m.z), whole(m.percentile)]), [1, 2])));
  };
  const dress = () => {
    const s = model.shapes[state.chosen], shown = Boolean(s.vertices);
    heading.textContent = s.name;
    note.replaceChildren(...(s.note ? [el("span", { class: "badge bad" }, "before it is trusted"), s.note] : []));
    fillTables(s);
    if (!shown) {
      view.set({ surface: null, particles: null });
      key.replaceChildren("The surface of this shape is not on this page.");
      return;
    }
    const parts = partsOf(state.chosen), reach = parts.reach;
    const how = {
      z: ["signed", [-REACH, REACH], [`\u2212${REACH} sd inside`, "as expected", `+${REACH} sd outside`]],
      difference: ["signed", [-reach, reach], [`\u2212${length(reach)} inside`, "0", `+${length(reach)} outside`]],
      odd: ["heat", [0, 1], ["usual", "unusual (false discoveries 5\u00a0%)"]],
    }[state.colour];
    view.set({ surface: parts.geometry[state.colour], particles: state.particles ? parts.dots : null, palette: how[0], range: how[1] });
    expectedView.set({ surface: parts.expected, particles: null });
    key.replaceChildren(legend(how[0], how[2]));
  };
  const shownMesh = () => {
    if (!model.shapes[state.chosen].vertices) return null;
    return { V: model.surfaces(state.chosen).patient, F: model.F, value: partsOf(state.chosen).values[state.colour], field: state.colour };
  };
  const choose = (k) => { state.chosen = k; picker.value = String(k); dress(); };
  const select = choice("Shape ", model.shapes.map((s, k) => [String(k), s.name]), "0", (v) => choose(Number(v)));
  const picker = select.querySelector("select");
  const colours = [["z", "z along the normal"], ["difference", "distance from what is expected"], ["odd", "unusual places"]];
  body.append(
    el("div", { class: "tools" }, select,
      choice("Colour ", colours.filter(([name]) => hasZ || name !== "z"), state.colour, (v) => { state.colour = v; dress(); }),
      checkbox("Particles", false, (on) => { state.particles = on; dress(); })),
    twoViews([canvas, "the new shape", saveTools(view, () => model.shapes[state.chosen].name, () => shownMesh())],
      [other, model.formula ? "the shape that is expected for such a person" : "the mean of the norm"]),
    key, heading, note, details);
  const noted = model.shapes.some((s) => s.note);
  const head = ["name", "percentile", "percentile_low", "percentile_high", "z", "p", "p_particles", "unusual_particles", "note"];
  list.append(tableSave(`norm ${model.title}`, () => [head, ...model.shapes.map((s) => [s.name, s.percentile, ...s.percentile_interval, s.z, s.p, s.p_particles, unusual(s), s.note ?? ""])]),
    table(["shape", "percentile", "95\u00a0% interval", "halves", "z", "p", "most unusual place", "unusual particles", ...(noted ? ["before it is trusted"] : [])],
    model.shapes.map((s, k) => [
      el("button", { type: "button", class: "link", onclick: () => { choose(k); byId("shape").scrollIntoView(); } }, s.name),
      whole(s.percentile), range(s.percentile_interval), range(s.percentile_of_halves), show(s.z), pText(s.p), pText(s.p_particles), String(unusual(s)), ...(noted ? [s.note ?? ""] : [])]), [1, 2, 3, 4, 5, 6, 7]));
  dress();
  stepByKeys(model.shapes.length, state, choose);
  return { state, choose };
}
