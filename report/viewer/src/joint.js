// A joint: its parts shown or not, drawn apart, in colours of their own; and its modes of pose and of shape.
import { byId, checkbox, el, percent, table } from "./dom.js";
import { PARTS_MOST, setParts } from "./gl.js";
import { length } from "./units.js";

// Okabe and Ito's, lighter: a surface is shaded.
const HUES = ["#e8b04a", "#7cc3ec", "#3fbf95", "#e58a5c", "#d79bbf", "#efe47a", "#6f9fd8", "#b49ad8", "#c98080", "#b9dda4"];
const hueOf = (d) => HUES[d % HUES.length];
const vector = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);

/** The part of each of n things, of which those of part d begin at first[d]; null for one part. */
export function partsOf(model, first, n) {
  if (!model.joint) return null;
  const part = new Float32Array(n);
  for (let d = 0; d < model.joint.parts.length; d++) part.fill(Math.min(d, PARTS_MOST - 1), first[d], first[d + 1] ?? n);
  return part;
}
export const partsOfParticles = (model) => partsOf(model, model.joint?.parts.map((p) => p.particles), model.J);

/** Where each part goes when the parts are drawn apart: away from the middle of all. */
function waysApart(model) {
  const P = model.array(model.mean.particles, "positions"), part = partsOfParticles(model), n = model.joint.parts.length;
  const sum = Array.from({ length: n }, () => [0, 0, 0, 0]), middle = [0, 0, 0];
  for (let k = 0; k < P.length; k++) sum[part[Math.floor(k / 3)]][k % 3] += P[k];
  for (const d of part) sum[d][3]++;
  const centre = sum.map((s) => [0, 1, 2].map((c) => s[c] / s[3]));
  for (const c of centre) for (let k = 0; k < 3; k++) middle[k] += c[k] / n;
  const way = centre.map((c) => c.map((x, k) => x - middle[k])), reach = Math.max(...way.map((w) => Math.hypot(...w))) || 1;
  // Parts within each other: to the sides.
  return way.map((w, d) => (Math.hypot(...w) > 0.15 * reach ? w : [reach * (d - (n - 1) / 2), 0, 0]));
}

/** The bar that all views obey; nothing for one part. */
export function fillParts(model) {
  const bar = byId("parts");
  if (!model.joint) return null;
  const { parts } = model.joint, way = waysApart(model);
  const state = { shown: parts.map(() => true), apart: 0, coloured: true };
  const draw = () => setParts(
    parts.map((_, d) => [...way[d].map((x) => state.apart * x), state.shown[d] ? 1 : 0]),
    state.coloured ? parts.map((_, d) => vector(hueOf(d))) : null);
  const boxes = parts.map((p, d) => {
    const label = checkbox(p.name, true, (on) => { state.shown[d] = on; draw(); });
    label.prepend(el("span", { class: "swatch", style: `background:${hueOf(d)}`, "aria-hidden": "true" }));
    return label;
  });
  const range = el("input", { type: "range", min: 0, max: 1, step: 0.01, value: 0, "aria-label": "parts drawn apart", oninput: () => { state.apart = Number(range.value); draw(); } });
  bar.append(el("span", {}, "Parts:"), ...boxes, el("label", {}, "Apart", range), checkbox("In colours", true, (on) => { state.coloured = on; draw(); }));
  bar.hidden = false;
  draw();
  const set = (change) => {
    Object.assign(state, change);
    boxes.forEach((b, d) => (b.querySelector("input").checked = state.shown[d]));
    range.value = state.apart;
    draw();
  };
  return { state, set };
}

// ---- modes of pose and of shape ----

/** exp of rotation vector w: rows of the matrix (Rodrigues). */
function rotation([x, y, z]) {
  const a = Math.hypot(x, y, z), s = a > 1e-12 ? Math.sin(a) / a : 1, c = a > 1e-12 ? (1 - Math.cos(a)) / (a * a) : 0.5;
  const K = [[0, -z, y], [z, 0, -x], [-y, x, 0]];
  return K.map((row, i) => row.map((k, j) => (i === j ? 1 : 0) + s * k + c * K[i].reduce((t, m, l) => t + m * K[l][j], 0)));
}

/** X (from `first` to `end`, in threes) is moved by log motion xi in the frame M (16 numbers, a similarity). */
function movePart(M, xi, first, end, X) {
  const R = rotation(xi), s2 = M[0] * M[0] + M[4] * M[4] + M[8] * M[8];
  for (let k = 3 * first; k < 3 * end; k += 3) {
    const d = [X[k] - M[3], X[k + 1] - M[7], X[k + 2] - M[11]];
    const own = [0, 1, 2].map((c) => (M[c] * d[0] + M[4 + c] * d[1] + M[8 + c] * d[2]) / s2);
    const to = R.map((row, c) => row[0] * own[0] + row[1] * own[1] + row[2] * own[2] + xi[3 + c]);
    for (let c = 0; c < 3; c++) X[k + c] = M[4 * c] * to[0] + M[4 * c + 1] * to[1] + M[4 * c + 2] * to[2] + M[4 * c + 3];
  }
}

/** What fillModes takes: mean surface and particles, variances, and move(weight, V, P). */
function poseModes(model) {
  const { apart, vertices, parts } = model.joint, n = parts.length;
  const particles = [...parts.map((p) => p.particles), model.J];
  const move = (weight, V, P) => {
    for (let d = 0; d < n; d++) {
      const xi = [0, 1, 2, 3, 4, 5].map((k) => apart.motions.reduce((sum, m, at) => sum + weight[at] * m[d][k], 0));
      movePart(apart.frames[d], xi, vertices[d], vertices[d + 1], V);
      movePart(apart.frames[d], xi, particles[d], particles[d + 1], P);
    }
  };
  return { variances: apart.pose_variances, shown: apart.motions.length, move };
}

function shapeModes(model) {
  const { modes, shape_variances } = model.joint.apart;
  const move = (weight, V, P) => {
    modes.forEach((mode, m) => {
      if (weight[m] === 0) return;
      const D = model.array(mode.vertices, "displacements"), DP = model.array(mode.particles, "displacements");
      for (let k = 0; k < V.length; k++) V[k] += weight[m] * D[k];
      for (let k = 0; k < P.length; k++) P[k] += weight[m] * DP[k];
    });
  };
  return { variances: shape_variances, shown: modes.length, move };
}

/** The sets of modes of a joint beside those of everything at once. */
export function jointModes(model) {
  const apart = model.joint?.apart;
  if (!apart) return {};
  const V0 = model.array(apart.vertices, "positions"), P0 = model.array(apart.particles, "positions");
  return { pose: { V0, P0, ...poseModes(model) }, shape: { V0, P0, ...shapeModes(model) } };
}

/** How much of the variance is pose and how much shape, in words. */
export function tellApart(model) {
  const { pose_variances, shape_variances, not_explained } = model.joint.apart, sum = (x) => x.reduce((a, b) => a + b, 0);
  const pose = sum(pose_variances), all = pose + sum(shape_variances) || 1;
  return `The position of the parts relative to each other accounts for ${percent(pose / all)} of the variance, their shapes for ${percent(1 - pose / all)}. ` +
    "Modes of pose move the parts as rigid bodies, modes of shape leave them where they lie on average; in modes of both together, a part that turns seems to change its shape." +
    (not_explained > 0.001 ? ` Turns are no straight lines: ${percent(not_explained)} of what the particles vary is in neither.` : "");
}

// ---- joint spaces ----

/** How many spaces close, in words; "" where nobody counted. */
export function tellClosed(model) {
  const s = model.certificate.joint_spaces;
  return s ? `${s.rebuilt_closed} of ${s.rebuilt} rebuilt spaces close, and ${s.made_closed} of ${s.made} of the mean joint and of modes at two standard deviations; where poses or shapes vary alone, which no subject does, ${s.apart_closed} of ${s.apart}.` : "";
}

/** How near the parts of subjects come to each other, and whether the rebuilt surfaces keep the space. */
export function tableOfSpaces(model) {
  const mean = (x) => x.reduce((a, b) => a + b, 0) / x.length, least = (x) => Math.min(...x), most = (x) => Math.max(...x);
  return table(["parts", "space, mean", "least", "rebuilt: mean", "least", "deepest in each other", "rebuilt"],
    (model.evaluation.joint_spaces ?? []).map(({ parts, per_shape }) => {
      const of = (key) => per_shape.map((s) => s[key]), [gap, depth, rebuilt, deep] = ["gap", "depth", "rebuilt_gap", "rebuilt_depth"].map(of);
      return [parts.join(" \u2013 "), mean(gap), least(gap), mean(rebuilt), least(rebuilt), most(depth), most(deep)].map((x, k) => (k === 0 ? x : length(x)));
    }), [1, 2, 3, 4, 5, 6]);
}
