// Fields of the surface (scalars of the meshes, images sampled there), known at the particles of every shape:
// spread over surfaces, as colours.
import { show } from "./dom.js";
import { weightsAt } from "./surface.js";

/** {name, key, lo, hi, of(i): values at the particles of shape i, mean: of all shapes} of every field. */
export function fieldsOf(model) {
  return (model.fields ?? []).map((field, s) => {
    const codes = model.array(field.values, "integers"), J = model.J;
    const at = (k) => field.lo + field.step * codes[k];
    const of = (i) => Float32Array.from({ length: J }, (_, j) => at(i * J + j));
    const mean = Float32Array.from({ length: J }, (_, j) => model.shapes.reduce((sum, _, i) => sum + at(i * J + j), 0) / model.I);
    const hi = codes.reduce((m, c) => Math.max(m, c), 0) * field.step + field.lo;
    return { name: field.name, key: `field ${s}`, lo: field.lo, hi: hi > field.lo ? hi : field.lo + 1, of, mean };
  });
}

/** Values of a surface's vertices from those of particles, with parts by themselves (vertices and particles begin at first[d]). */
export function spreadParts(V, P, values, vertices, particles) {
  const out = new Float32Array(V.length / 3);
  const ends = vertices ? vertices.slice(0, -1).map((v, d) => [v, vertices[d + 1], particles[d], particles[d + 1] ?? values.length]) : [[0, out.length, 0, values.length]];
  for (const [v0, v1, p0, p1] of ends)
    if (v1 > v0) weightsAt(V.subarray(3 * v0, 3 * v1), P.subarray(3 * p0, 3 * p1)).spread(values.subarray(p0, p1), 1, out.subarray(v0, v1));
  return out;
}

export const fieldEnds = (field) => [show(field.lo), field.name, show(field.hi)];
