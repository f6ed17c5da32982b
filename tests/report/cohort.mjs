// A small cohort that is made in a moment: eight smooth bodies that differ in length and in a bump.
import { writeFileSync } from "node:fs";
import { join } from "node:path";

// Names that would do harm if the page took them for markup.
export const NAMES = [
  "a \u00c9t\u00e9 <b>&\"' \u809d\u81d3 --> <img src=x onerror=alert(1)>",
  "b", "c", "d", "e", "f", "g", "h",
];

function sphere(level) {
  const g = (1 + Math.sqrt(5)) / 2;
  let V = [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]];
  let F = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]];
  for (let l = 0; l < level; l++) {
    const between = new Map(), next = [];
    const middle = (a, b) => {
      const key = a < b ? `${a} ${b}` : `${b} ${a}`;
      if (!between.has(key)) between.set(key, V.push(V[a].map((x, k) => (x + V[b][k]) / 2)) - 1);
      return between.get(key);
    };
    for (const [a, b, c] of F) {
      const ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      next.push([a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]);
    }
    F = next;
  }
  V = V.map((v) => v.map((x) => x / Math.hypot(...v)));
  return { V, F };
}

export function writeCohort(folder) {
  const { V, F } = sphere(3);
  NAMES.forEach((name, i) => {
    const long = 30 + 2.5 * (i - 3.5), bump = 3 + ((5 * i) % 8);
    const points = V.map(([x, y, z]) => {
      const s = 1 + (bump / 30) * Math.exp(-6 * ((x - 0.6) ** 2 + (y + 0.6) ** 2 + (z - 0.5) ** 2));
      return [long * x * s, 16 * y * s, 20 * z * s - 4 * x * x];
    });
    writePly(join(folder, `${name}.ply`), points, F);
  });
}

/** Vertices may have a fourth number, the field warm. */
function writePly(path, points, F) {
  const field = points[0].length > 3 ? "property float warm\n" : "";
  writeFileSync(path,
    `ply\nformat ascii 1.0\nelement vertex ${points.length}\nproperty float x\nproperty float y\nproperty float z\n${field}element face ${F.length}\nproperty list uchar int vertex_indices\nend_header\n` +
    points.map((p) => p.map((x) => x.toFixed(5)).join(" ")).join("\n") + "\n" +
    F.map((f) => `3 ${f.join(" ")}`).join("\n") + "\n");
}

/** Six joints of two parts: the hinge turns about the socket by 6 degrees more from one to the next, and the
 *  socket grows longer; warm rises along x.  Landmarks at the ends of both. */
export function writeJoints(folder) {
  const { V, F } = sphere(3), marks = ["shape,name,x,y,z"];
  const body = (long) => ([x, y, z]) => {
    const s = 1 + 0.35 * Math.exp(-6 * ((x - 0.6) ** 2 + (y + 0.6) ** 2 + (z - 0.5) ** 2));
    return [long * x * s, 16 * y * s, 20 * z * s - 4 * x * x, 50 + 40 * x];
  };
  for (let i = 0; i < 6; i++) {
    const angle = ((6 * i - 15) * Math.PI) / 180, c = Math.cos(angle), s = Math.sin(angle), socket = body(30 + 1.5 * i), hinge = body(26);
    const turned = (v) => { const [x, y, z, w] = hinge(v); return [c * (x + 70) - s * y, s * (x + 70) + c * y, z, w]; };
    writePly(join(folder, `j${i}_socket.ply`), V.map(socket), F);
    writePly(join(folder, `j${i}_hinge.ply`), V.map(turned), F);
    marks.push(`j${i}_socket,<i>end</i>,${socket([-1, 0, 0]).slice(0, 3)}`, `j${i}_hinge,<i>end</i>,${turned([1, 0, 0]).slice(0, 3)}`);
  }
  writeFileSync(join(folder, "marks.csv"), marks.join("\n") + "\n");
}
