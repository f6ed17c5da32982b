// The model from the text of the data element: base64 of a zlib stream of (length of the JSON text in
// 4 bytes, JSON text, packed arrays).  The writer is src/report/pack.c.
function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const plain = atob(text);
  const bytes = new Uint8Array(plain.length);
  for (let k = 0; k < plain.length; k++) bytes[k] = plain.charCodeAt(k);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Differences to the number `stride` before, folded, byte planes. */
function unpack(bytes, [offset, n, stride, width]) {
  const out = new (width === 4 ? Uint32Array : width === 2 ? Uint16Array : Uint8Array)(n);
  for (let k = 0; k < n; k++) {
    let folded = 0;
    for (let b = width - 1; b >= 0; b--) folded = (folded << 8) | bytes[offset + b * n + k];
    const difference = (folded >>> 1) ^ -(folded & 1);
    out[k] = difference + (k < stride ? 0 : out[k - stride]);
  }
  return out;
}

/** JSON with arrays that are given by their place among the packed bytes. */
export class Packed {
  constructor(root, bytes) {
    Object.assign(this, root);
    this.bytes = bytes;
    this.cache = new Map();
    this.reads = {
      positions: (q) => Float32Array.from(q, (v, k) => root.origin[k % 3] + root.step * v),
      warped: (q) => {
        const mean = unpack(bytes, root.mean.vertices);
        return this.reads.positions(q.map((v, k) => v + mean[k])); // 16 bits, modulo 2^16
      },
      distances: (q) => Float32Array.from(q, (v) => root.largest_distance * (v / 255) ** 2),
      displacements: (q) => Float32Array.from(q, (v) => root.mode_step * (v - 8192)),
      integers: (q) => q,
    };
  }
  /** The array at `where`, decoded once. */
  array(where, kind) {
    const key = where[0];
    if (!this.cache.has(key)) this.cache.set(key, this.reads[kind](unpack(this.bytes, where)));
    return this.cache.get(key);
  }
}

export class Model extends Packed {
  constructor(root, bytes) {
    super(root, bytes);
    this.J = root.particles;
    this.I = root.shapes.length;
  }
}

/** What the page holds, made by the kind (a class) of its format. */
export async function readPage(text, kinds) {
  if (!("DecompressionStream" in window))
    throw new Error("this browser is too old for the page; use one of 2023 or later");
  const bytes = await inflate(fromBase64(text.trim()));
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const root = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const Kind = kinds[root.format];
  if (!Kind) throw new Error("the data of this page are damaged");
  return new Kind(root, bytes.subarray(4 + length));
}

/** Unit normals of the vertices, weighted by area; into `out` if given. */
export function vertexNormals(V, F, out = new Float32Array(V.length)) {
  out.fill(0);
  for (let f = 0; f < F.length; f += 3) {
    const a = 3 * F[f], b = 3 * F[f + 1], c = 3 * F[f + 2];
    const ux = V[b] - V[a], uy = V[b + 1] - V[a + 1], uz = V[b + 2] - V[a + 2];
    const vx = V[c] - V[a], vy = V[c + 1] - V[a + 1], vz = V[c + 2] - V[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    out[a] += x; out[a + 1] += y; out[a + 2] += z;
    out[b] += x; out[b + 1] += y; out[b + 2] += z;
    out[c] += x; out[c + 1] += y; out[c + 2] += z;
  }
  for (let k = 0; k < out.length; k += 3) {
    const length = Math.hypot(out[k], out[k + 1], out[k + 2]) || 1;
    out[k] /= length; out[k + 1] /= length; out[k + 2] /= length;
  }
  return out;
}

/** Normals at points P: those of the nearest vertices. */
export function normalsAt(P, V, N) {
  const out = new Float32Array(P.length);
  for (let j = 0; j < P.length; j += 3) {
    let best = 0, least = Infinity;
    for (let v = 0; v < V.length; v += 3) {
      const x = V[v] - P[j], y = V[v + 1] - P[j + 1], z = V[v + 2] - P[j + 2];
      const d = x * x + y * y + z * z;
      if (d < least) { least = d; best = v; }
    }
    out[j] = N[best]; out[j + 1] = N[best + 1]; out[j + 2] = N[best + 2];
  }
  return out;
}

export function median(values) {
  const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
  const h = sorted.length >> 1;
  return sorted.length === 0 ? NaN : sorted.length % 2 ? sorted[h] : (sorted[h - 1] + sorted[h]) / 2;
}

/** Indices beyond median + 3.5 scaled median absolute deviations. */
export function outliers(values) {
  const middle = median(values);
  const spread = 1.4826 * median(values.map((v) => Math.abs(v - middle)));
  return values.flatMap((v, i) => (spread > 0 && v > middle + 3.5 * spread ? [i] : []));
}
