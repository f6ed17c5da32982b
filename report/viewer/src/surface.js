// What views of surfaces share: from particles to vertices, the strip that explains colours, and where
// shapes lie.
import { el } from "./dom.js";
import { cssGradient, palettes } from "./colors.js";

/** Weights of the `most` nearest particles at every vertex, falling off with the spacing. */
export function weightsAt(V, P, most = 8) {
  const n = V.length / 3, J = P.length / 3, K = Math.min(most, J);
  const index = new Uint32Array(n * K), weight = new Float32Array(n * K), d2 = new Float64Array(J);
  const order = new Uint32Array(J);
  for (let v = 0; v < n; v++) {
    for (let j = 0; j < J; j++) {
      const x = V[3 * v] - P[3 * j], y = V[3 * v + 1] - P[3 * j + 1], z = V[3 * v + 2] - P[3 * j + 2];
      d2[j] = x * x + y * y + z * z;
      order[j] = j;
    }
    for (let k = 0; k < K; k++) { // the K least, in place
      let best = k;
      for (let j = k + 1; j < J; j++) if (d2[order[j]] < d2[order[best]]) best = j;
      [order[k], order[best]] = [order[best], order[k]];
    }
    const reach = 0.35 * d2[order[K - 1]] || 1;
    let sum = 0;
    for (let k = 0; k < K; k++) sum += weight[v * K + k] = Math.exp(-(d2[order[k]] - d2[order[0]]) / reach);
    for (let k = 0; k < K; k++) { weight[v * K + k] /= sum; index[v * K + k] = order[k]; }
  }
  const spread = (values, width, out) => {
    out.fill(0);
    for (let v = 0; v < n; v++)
      for (let k = 0; k < K; k++)
        for (let c = 0; c < width; c++) out[v * width + c] += weight[v * K + k] * values[index[v * K + k] * width + c];
    return out;
  };
  return { spread, nearest: (v) => index[v * K] };
}

export function legend(palette, texts) {
  const strip = el("div", { class: "strip" });
  strip.style.background = cssGradient(palettes[palette]);
  return el("div", { class: "legend" }, strip, el("div", { class: "ends" }, texts.map((t) => el("span", {}, t))));
}

/** Where points P and all that is shown (clouds) lie: centre, radius, and the yaw that sees the longest
 *  direction in the plane x, y (half the angle of the second moments) across. */
export function stageOf(P, clouds) {
  const centre = [0, 0, 0];
  let radius = 0, xx = 0, xy = 0, yy = 0;
  for (let k = 0; k < P.length; k++) centre[k % 3] += (3 * P[k]) / P.length;
  for (const X of clouds)
    for (let k = 0; k < X.length; k += 3) radius = Math.max(radius, Math.hypot(X[k] - centre[0], X[k + 1] - centre[1], X[k + 2] - centre[2]));
  for (let k = 0; k < P.length; k += 3) {
    const x = P[k] - centre[0], y = P[k + 1] - centre[1];
    xx += x * x; xy += x * y; yy += y * y;
  }
  const angle = 0.5 * Math.atan2(2 * xy, xx - yy);
  return { centre, radius, yaw: angle + (angle < -Math.PI / 4 ? Math.PI : 0) + 0.25 };
}
