// Reads what test_export.sh has exported by Khronos' validator of glTF and by three.js's loaders, and compares all with
// the tables of the same export:  node read_exports.mjs FOLDER  (packages beside this file)
import { readFileSync } from "node:fs";
import { join } from "node:path";
import validator from "gltf-validator";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";

globalThis.self = globalThis; // what a browser has
const folder = process.argv[2];
let failures = 0;
const check = (good, what) => {
  if (!good) console.log(`FAILED: ${what}`), failures++;
};
const bytes = (name) => {
  const b = readFileSync(join(folder, name));
  return b.buffer.slice(b.byteOffset, b.byteOffset + b.length);
};
const text = (name) => readFileSync(join(folder, name), "utf8");
const rows = (name) => text(name).trim().split("\n").slice(1).map((line) => line.split(",").map(Number));

/** Greatest difference of two lists, beside the greatest number; Infinity for other lengths. */
const apart = (a, b) => (a.length !== b.length ? Infinity : a.reduce((m, x, k) => Math.max(m, Math.abs(x - b[k])), 0) / b.reduce((m, x) => Math.max(m, Math.abs(x)), 1e-30));
const near = (a, b, what, most = 1e-6) => {
  const d = apart([...a], [...b]);
  check(d <= most, `${what}: ${a.length} numbers of ${b.length}, off by ${d}`);
};
const mean = rows("csv/mean.csv").flat(), table = rows("csv/modes.csv"), modes = table[0].length / 3;
const mode = (k) => table.flatMap((row) => row.slice(3 * k, 3 * k + 3));
const plus = (k, sd) => { const d = mode(k); return mean.map((x, i) => x + sd * d[i]); };

// glTF
const report = await validator.validateBytes(new Uint8Array(bytes("model.glb")));
check(report.issues.numErrors === 0 && report.issues.numWarnings === 0, `glTF: ${JSON.stringify(report.issues.messages).slice(0, 600)}`);
const gltf = await new GLTFLoader().parseAsync(bytes("model.glb"), "");
const meshes = [];
gltf.scene.traverse((node) => node.isMesh && meshes.push(node));
check(meshes.length === 1, `glTF: ${meshes.length} meshes`);
const [{ geometry, morphTargetDictionary }] = meshes, faces = [...geometry.index.array];
near(geometry.attributes.position.array, mean, "glTF mean");
const targets = geometry.morphAttributes.position, names = Object.keys(morphTargetDictionary ?? {});
check(targets.length > 0 && targets.length <= modes && names[0] === "mode_01", `glTF: ${targets.length} targets, ${names}`);
targets.forEach((t, k) => near(t.array, mode(k), `glTF target ${k + 1}`));

// meshes
const ply = (name) => new PLYLoader().parse(bytes(name));
near(ply("ply/mean.ply").attributes.position.array, mean, "PLY mean");
near(ply("ply/mean.ply").index.array, faces, "PLY faces", 0);
near(ply("ply/modes/mode_01_plus3sd.ply").attributes.position.array, plus(0, 3), "PLY mode 1");
const corners = (V) => faces.flatMap((v) => [V[3 * v], V[3 * v + 1], V[3 * v + 2]]);
near(new STLLoader().parse(bytes("stl/mean.stl")).attributes.position.array, corners(mean), "STL mean");
near(new STLLoader().parse(bytes("stl/modes/mode_01_minus2sd.stl")).attributes.position.array, corners(plus(0, -2)), "STL mode 1");
near(new OBJLoader().parse(text("obj/mean.obj")).children[0].geometry.attributes.position.array, corners(mean), "OBJ mean");
if (failures === 0) console.log(`read by others: glTF valid (Khronos), ${targets.length} morph targets, PLY, STL, OBJ (three.js)`);
process.exitCode = failures ? 1 : 0;
