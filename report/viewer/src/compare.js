// Two shapes, or the means of two groups, on one view: how far the surface of the one is from the other, along
// its normals, and both laid over each other.
import { byId, checkbox, choice, el, table } from "./dom.js";
import { vertexNormals } from "./data.js";
import { length } from "./units.js";

/** All that can be compared: [key, label, vertices on the template's mesh]. */
function candidates(model) {
  const V0 = () => model.array(model.mean.vertices, "positions"), warped = (i) => model.array(model.shapes[i].warped, "warped");
  const list = [["mean", "mean of all shapes", V0]];
  for (const c of model.answers?.columns ?? [])
    if (c.category)
      c.levels.forEach((level, l) => {
        const of = c.values.flatMap((v, i) => (v === l ? [i] : []));
        if (of.length > 0 && of.length < model.I)
          list.push([`${c.name}=${level}`, `mean of ${c.name} ${level} (${of.length})`, () => meanOf(of.map(warped))]);
      });
  model.shapes.forEach((s, i) => list.push([`shape ${i}`, s.name, () => warped(i)]));
  return list;
}

function meanOf(shapes) {
  const out = new Float32Array(shapes[0].length);
  for (const X of shapes) for (let k = 0; k < out.length; k++) out[k] += X[k] / shapes.length;
  return out;
}

export function fillCompare(model, { makeView, viewTools, legend, surfaceGeometry }) {
  const section = byId("compare"), body = section.querySelector(".body");
  if (model.I < 2) {
    section.hidden = true;
    document.querySelector('nav a[href="#compare"]').hidden = true;
    return;
  }
  const list = candidates(model), F = model.array(model.mean.faces, "integers"), cache = new Map();
  const groups = list.filter(([key]) => key.includes("=")).map(([key]) => key);
  const state = { a: groups[1] ? groups[0] : "mean", b: groups[1] ?? `shape ${model.template === 0 ? 1 : 0}`, ghost: false, colour: true };
  const surfaceOf = (key) => {
    if (!cache.has(key)) {
      const V = list.find(([k]) => k === key)[2](), N = vertexNormals(V, F);
      cache.set(key, { V, N });
    }
    return cache.get(key);
  };
  const nameOf = (key) => list.find(([k]) => k === key)[1];
  const { view, box } = makeView("first of two surfaces, coloured by its distance from the second");
  const value = new Float32Array(model.array(model.mean.vertices, "positions").length / 3), ends = el("div"), figures = el("div");
  const draw = () => {
    const a = surfaceOf(state.a), b = surfaceOf(state.b), straight = new Float64Array(value.length);
    for (let v = 0, k = 0; v < value.length; v++, k += 3) {
      const d = [0, 1, 2].map((c) => b.V[k + c] - a.V[k + c]);
      value[v] = d[0] * a.N[k] + d[1] * a.N[k + 1] + d[2] * a.N[k + 2];
      straight[v] = Math.hypot(...d);
    }
    const sorted = Float64Array.from(value, Math.abs).sort(), reach = sorted[Math.floor(0.99 * (sorted.length - 1))] || 1;
    const mean = (x) => x.reduce((p, q) => p + q, 0) / x.length;
    view.set({
      surface: surfaceGeometry(a.V, F, a.N, value.slice()), ghost: state.ghost && state.a !== state.b ? surfaceGeometry(b.V, F, b.N, null) : null,
      palette: state.colour ? "signed" : null, range: [-reach, reach],
    });
    view.setPickable(null);
    ends.replaceChildren(legend("signed", [`\u2264 \u2212${length(reach)} second inside`, "0", `\u2265 ${length(reach)} second outside`]));
    ends.hidden = !state.colour;
    figures.replaceChildren(table(["second from first", "mean", "95 %", "max"],
      [["along the normal, without sign", length(mean(sorted)), length(sorted[Math.floor(0.95 * (sorted.length - 1))]), length(sorted[sorted.length - 1])],
        ["between corresponding points", length(mean(straight)), length(straight.slice().sort()[Math.floor(0.95 * (straight.length - 1))]), length(Math.max(...straight))]], [1, 2, 3]));
  };
  const options = list.map(([key, label]) => [key, label]);
  body.append(
    el("p", { class: "soft" }, "Both are the template\u2019s surface carried along by the particles, so every point has a counterpart. Group means differ by chance, too: apsm test tells whether there is more to it."),
    el("div", { class: "tools" },
      choice("First", options, state.a, (v) => { state.a = v; draw(); }), choice("second", options, state.b, (v) => { state.b = v; draw(); }),
      checkbox("Second laid over", false, (on) => { state.ghost = on; draw(); }), checkbox("Distance as colour", true, (on) => { state.colour = on; draw(); })),
    el("div", { class: "main" }, box, ends, viewTools(view, () => `${nameOf(state.a)} and ${nameOf(state.b)}`, () => ({ ...surfaceOf(state.a), F, value, field: "difference" }))),
    figures);
  draw();
}
