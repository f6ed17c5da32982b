// The page of `apsm fit`: a table of the new shapes, and for the chosen one its surface, how it differs from
// the mean, how sure that is, and its scores.  All figures come from the fits' own files.
import { byId, checkbox, choice, el, percent, plural, show, svg, table } from "./dom.js";
import { Packed, vertexNormals } from "./data.js";
import * as gl from "./gl.js";
import { length, setUnit, unitSentence } from "./units.js";
import { fileName, saveButton, saveCsv, saveSvg, saveTools } from "./save.js";
import { legend, weightsAt } from "./surface.js";

const SCALED = 40;
const SIGN = { good: "good", "needs review": "bad", refused: "bad", failed: "bad" };
export const pText = (p) => (p === undefined || p === null ? "\u2013" : p < 1e-3 ? p.toExponential(1).replace("-", "\u2212") : show(p, 2));

export class Fits extends Packed {
  constructor(root, bytes) {
    super(root, bytes);
    this.V0 = this.array(root.mean.vertices, "positions");
    this.F = this.array(root.mean.faces, "integers");
    this.N0 = vertexNormals(this.V0, this.F);
    this.of = new Map(root.shown.map((s, k) => [s.shape, k]));
  }
  /** All that views are to hold: the first shapes, which set the scale of colours, too. */
  clouds() {
    return this.shown.slice(0, SCALED).map((s) => this.array(s.vertices, "warped"));
  }
}

/** Distances of V from V0 along the normals N0. */
export function differences({ V0, N0 }, V) {
  const out = new Float32Array(V.length / 3);
  for (let k = 0; k < V.length; k += 3)
    out[k / 3] = (V[k] - V0[k]) * N0[k] + (V[k + 1] - V0[k + 1]) * N0[k + 1] + (V[k + 2] - V0[k + 2]) * N0[k + 2];
  return out;
}

/** Bars of numbers in standard deviations, the first 15; the band is where 95 % of shapes lie. */
export function zChart(all, name, below) {
  const n = Math.min(all.length, 15), W = 420, H = 220, left = 40, right = 10, top = 10, bottom = 34;
  const z = all.slice(0, n);
  const most = Math.max(3, ...z.map(Math.abs));
  const y = (v) => top + ((most - v) / (2 * most)) * (H - top - bottom), x = (k) => left + ((k + 0.5) / n) * (W - left - right);
  const wide = Math.min(18, (0.7 * (W - left - right)) / n);
  return svg("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `scores of ${name} in standard deviations` },
    svg("rect", { class: "band", x: left, y: y(2), width: W - left - right, height: y(-2) - y(2) }),
    [-2, -1, 0, 1, 2].map((t) => [
      svg("path", { class: "mesh", d: `M${left} ${y(t)}H${W - right}` }),
      svg("text", { x: left - 6, y: y(t) + 4, "text-anchor": "end" }, String(t).replace("-", "\u2212")),
    ]),
    z.map((v, k) => [
      svg("path", { class: "curve", "stroke-width": wide, d: `M${x(k)} ${y(0)}V${y(v)}`, style: `stroke-width:${wide}px` },
        svg("title", {}, `mode ${k + 1}: ${show(v)} sd`)),
      svg("text", { x: x(k), y: H - bottom + 15, "text-anchor": "middle" }, String(k + 1)),
    ]),
    svg("text", { x: (left + W - right) / 2, y: H - 4, "text-anchor": "middle" }, below));
}

function facts(f) {
  const d = f.surface_distance;
  return [
    ["verdict", f.verdict + (f.reason ? `: ${f.reason}` : "")],
    ["input", f.input],
    f.mirrored === undefined ? null : ["hand", f.mirrored ? "mirrored to the model's side" : "as the model"],
    f.cropped_share > 0 ? ["cropped", `${percent(f.cropped_share)} of its surface lies beyond what the model\u2019s shapes were cropped to, and was left out`] : null,
    f.partial ? ["seen", `${percent(f.observed_share)} of the particles; the rest is what the model expects`] : null,
    d ? ["distance of surface and fit", `${length(d.mean)} on average, ${length(d.max)} at most`] : null,
    f.mahalanobis === undefined ? null
      : f.mahalanobis === null ? ["distance from the mean", "not told: the model\u2019s shapes are too few for a mode that others follow"]
      : ["distance from the mean", `Mahalanobis ${show(f.mahalanobis)} in ${plural(f.mahalanobis_modes, "mode")}; a shape of the model\u2019s kind lies farther out with probability ${pText(f.tail_probability)}`],
    f.residual === undefined ? null : ["not told by the modes", `${length(f.residual)} in each coordinate (of the model\u2019s own shapes, left out: ${length(f.residual_usual)})`],
    f.certificate ? ["certificate", f.certificate.verdict] : null,
  ].filter(Boolean);
}

/** A chart that can be saved. */
export const chartWithSave = (chart, name) => el("figure", { class: "chart" }, chart, el("p", { class: "saves screen" },
  saveButton("SVG", `${name} as a picture`, () => saveSvg(fileName(name), chart))));
/** A button that saves a table: rows() has the head first. */
export const tableSave = (name, rows) => el("p", { class: "saves screen" }, saveButton("CSV", `${name} as a table`, () => saveCsv(fileName(name), rows())));
/** Two views side by side. */
export const twoViews = (...views) => el("div", { class: "pair" }, views.map(([canvas, text, tools]) =>
  el("figure", {}, el("div", { class: "view" }, canvas), el("figcaption", { class: "small soft" }, text), tools && el("div", { class: "tools screen" }, tools))));

/** Takes the model's sections away; returns what adds one. */
export function clearPage(links) {
  document.querySelector("nav").replaceChildren(...links.map(([id, text]) => el("a", { href: `#${id}` }, text)));
  document.querySelector(".skip").setAttribute("href", `#${links[0][0]}`);
  const main = document.querySelector("main");
  for (const section of main.querySelectorAll("section")) section.remove();
  return (id, text) => {
    const body = el("div", { class: "body" });
    main.append(el("section", { id, "aria-labelledby": `h-${id}` }, el("h2", { id: `h-${id}` }, text), body));
    return body;
  };
}

/** n and p choose the next and the previous of `count`. */
export function stepByKeys(count, state, choose) {
  addEventListener("keydown", (e) => {
    if (e.target.closest?.("input, select, button, summary") || e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.key === "n" || e.key === "p") choose((state.chosen + (e.key === "n" ? 1 : -1) + count) % count);
  });
}

export function fillFits(model, { radius }) {
  setUnit(model.model.unit ?? null);
  const rows = model.table, count = (v) => model.counts?.[v] ?? rows.filter((r) => r.verdict === v).length;
  const all = model.counts ? Object.values(model.counts).reduce((a, b) => a + b, 0) : rows.length;
  byId("title").textContent = `Fits \u201c${model.title}\u201d`;
  document.title = `${model.title} \u2013 fits`;
  byId("summary").textContent = `${plural(all, "new shape")} by the model ${model.model.path} ` +
    `(${plural(model.model.shapes, "shape")}, ${model.model.particles} particles). ${unitSentence()}`;
  const fine = count("good") === all;
  byId("verdict").append(el("div", { class: `verdict ${fine ? "good" : "bad"}` },
    el("span", { class: "sign", "aria-hidden": "true" }, fine ? "\u2713" : "!"),
    el("div", {}, el("strong", {}, `${count("good")} good. `),
      [["needs review", "to review"], ["refused", "refused"], ["failed", "could not be read"]]
        .filter(([v]) => count(v) > 0).map(([v, text]) => `${count(v)} ${text}. `),
      "A shape that is refused is not of the model\u2019s kind and gets no particles.")));

  const section = clearPage([["shape", "Shape"], ["table", "Table"]]);
  const body = section("shape", "A shape and the mean");

  const state = { chosen: model.shown[0]?.shape ?? -1, colour: "difference", same: true, particles: false };
  const canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": "the new shape; drag turns" });
  const meanCanvas = el("canvas", { tabindex: 0, role: "img", "aria-label": "the mean shape; drag turns" });
  const view = new gl.View(canvas, { large: true, radius }), meanView = new gl.View(meanCanvas, { large: true, radius });
  const key = el("div", {}), details = el("div", {}), chart = el("div", {}), heading = el("h3", {});
  const made = new Map();
  const parts = (k) => {
    if (!made.has(k)) {
      const s = model.shown[k], V = model.array(s.vertices, "warped"), P = s.particles && model.array(s.particles, "positions");
      const N = vertexNormals(V, model.F), at = P && weightsAt(V, P, 6);
      const values = { difference: differences(model, V) };
      if (at) {
        const spread = (x) => at.spread(x, 1, new Float32Array(V.length / 3));
        values.deviation = spread(model.array(s.deviation, "distances"));
        values.observed = spread(model.array(s.observed, "integers"));
      }
      const tint = P && new Float32Array(P.length).fill(0.25);
      const geometry = Object.fromEntries(Object.entries(values).map(([name, value]) => [name, gl.surfaceGeometry(V, model.F, N, value)]));
      made.set(k, { values, geometry, dots: P && gl.particleGeometry(P, tint) });
    }
    return made.get(k);
  };
  const reachOf = (k) => parts(k).values.difference.reduce((m, x) => Math.max(m, Math.abs(x)), 0) || 1;
  const everywhere = () => model.shown.slice(0, SCALED).reduce((m, _, k) => Math.max(m, reachOf(k)), 0) || 1;
  let common = 0;

  const bare = gl.surfaceGeometry(model.V0, model.F, model.N0, new Float32Array(model.V0.length / 3));
  const dress = () => {
    const f = rows[state.chosen], k = model.of.get(state.chosen);
    heading.textContent = f ? f.name : "";
    details.replaceChildren(f ? table(["what", "found"], facts(f)) : "");
    if (k === undefined) {
      view.set({ surface: null, particles: null });
      key.replaceChildren(f ? "The surface of this shape is not on this page." : "");
      chart.replaceChildren();
      return;
    }
    const made = parts(k), colour = made.geometry[state.colour] ? state.colour : "difference";
    const reach = state.same ? (common ||= everywhere()) : reachOf(k), most = model.largest_distance;
    const how = {
      difference: ["signed", [-reach, reach], [`\u2212${length(reach)} inside the mean`, "0", `+${length(reach)} outside`]],
      deviation: ["heat", [0, most], ["sure", `standard deviation ${length(most)}`]],
      observed: ["signed", [2, -1], ["not seen", "seen"]],
    }[colour];
    view.set({ surface: made.geometry[colour], particles: state.particles ? made.dots : null, palette: how[0], range: how[1] });
    meanView.set({ surface: bare, particles: null });
    key.replaceChildren(legend(how[0], how[2]));
    const { scores, variances } = model.shown[k];
    chart.replaceChildren(chartWithSave(zChart(scores.map((b, m) => b / Math.sqrt(variances[m])), f.name, "mode; score in standard deviations of the model"), `scores ${f.name}`));
  };
  const shownMesh = () => {
    const k = model.of.get(state.chosen), values = k === undefined ? null : parts(k).values, field = values?.[state.colour] ? state.colour : "difference";
    return values && { V: model.array(model.shown[k].vertices, "warped"), F: model.F, value: values[field], field };
  };
  const choose = (i) => { state.chosen = i; picker.value = String(i); dress(); };
  const select = choice("Shape ", rows.map((r, i) => [String(i), `${r.name}${r.verdict === "good" ? "" : ` (${r.verdict})`}`]), String(state.chosen), (v) => choose(Number(v)));
  const picker = select.querySelector("select");
  body.append(
    el("div", { class: "tools" }, select,
      choice("Colour ", [["difference", "difference from the mean"], ["deviation", "uncertainty"], ["observed", "seen or expected"]], "difference", (v) => { state.colour = v; dress(); }),
      checkbox("One scale for all shapes", true, (on) => { state.same = on; dress(); }),
      checkbox("Particles", false, (on) => { state.particles = on; dress(); })),
    twoViews([canvas, "the new shape, in the model\u2019s frame", saveTools(view, () => rows[state.chosen]?.name ?? "shape", () => shownMesh())], [meanCanvas, "the mean"]),
    key, heading, el("div", { class: "split even" }, details, chart));

  const list = section("table", rows.length < all ? `${rows.length} of ${all} shapes` : "All shapes");
  if (rows.length < all)
    list.append(el("p", { class: "soft" }, "Those that need review come first; all are in fit.csv."));
  if (model.shown.length < count("good") + count("needs review"))
    list.append(el("p", { class: "soft" }, `This page shows the surfaces of ${model.shown.length} shapes, those that need review first; all are in meshes/.`));
  const head = ["name", "verdict", "reason", "surface_distance_mean", "mahalanobis", "tail_probability", "observed_share", "mirrored"];
  list.append(tableSave(`fits ${model.title}`, () => [head, ...rows.map((r) => [r.name, r.verdict, r.reason, r.surface_distance?.mean, r.mahalanobis, r.tail_probability, r.observed_share, r.mirrored])]),
    table(["shape", "verdict", "reason", "distance", "Mahalanobis", "probability", "seen", "hand"],
    rows.map((r, i) => [
      el("button", { type: "button", class: "link", onclick: () => { choose(i); byId("shape").scrollIntoView(); } }, r.name),
      el("span", { class: `badge ${SIGN[r.verdict] === "good" ? "plain" : "bad"}` }, r.verdict), r.reason,
      show(r.surface_distance?.mean), show(r.mahalanobis), pText(r.tail_probability),
      r.observed_share === undefined ? "\u2013" : percent(r.observed_share),
      r.mirrored === undefined ? "\u2013" : r.mirrored ? "mirrored" : "same"]), [3, 4, 5, 6]));
  const first = rows.findIndex((r, i) => r.verdict !== "good" && model.of.has(i));
  choose(first >= 0 ? first : state.chosen);
  stepByKeys(rows.length, state, choose);
  return { state, choose };
}
