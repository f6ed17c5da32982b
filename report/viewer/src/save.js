// What leaves the page as a file: pictures, plots, meshes, tables.  All is made here; nothing is sent.
import { el } from "./dom.js";

export function download(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = el("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

export const saveButton = (label, what, act) =>
  el("button", { type: "button", class: "save screen", title: `save ${what}`, "aria-label": `save ${what}`, onclick: act }, label);

/** Words for a file's name. */
export const fileName = (...words) => words.join(" ").replace(/[^\p{L}\p{N}.+-]+/gu, "_").replace(/^_+|_+$/g, "").slice(0, 120);

// ---- tables ----

const field = (x) => {
  const text = x === null || x === undefined ? "" : String(x);
  return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
};
export const csvText = (rows) => rows.map((row) => row.map(field).join(",")).join("\n") + "\n";
export const saveCsv = (name, rows) => download(`${name}.csv`, csvText(rows), "text/csv");

// ---- plots ----

const STYLES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "opacity", "font-size", "font-weight", "text-anchor"];

/** The picture with its styles in it, for other programs. */
export function svgText(svg) {
  const copy = svg.cloneNode(true), from = [svg, ...svg.querySelectorAll("*")], to = [copy, ...copy.querySelectorAll("*")];
  from.forEach((node, k) => {
    const style = getComputedStyle(node);
    to[k].removeAttribute("class");
    to[k].removeAttribute("tabindex");
    for (const key of STYLES) to[k].setAttribute(key, style.getPropertyValue(key));
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("font-family", "sans-serif");
  return new XMLSerializer().serializeToString(copy);
}
export const saveSvg = (name, svg) => download(`${name}.svg`, svgText(svg), "image/svg+xml");

// ---- meshes, as other programs read them: binary, float32 ----

export function stlBytes(V, F) {
  const n = F.length / 3, out = new DataView(new ArrayBuffer(84 + 50 * n));
  out.setUint32(80, n, true);
  for (let f = 0; f < n; f++) {
    const [a, b, c] = [0, 1, 2].map((k) => V.subarray(3 * F[3 * f + k], 3 * F[3 * f + k] + 3));
    const u = [0, 1, 2].map((k) => b[k] - a[k]), w = [0, 1, 2].map((k) => c[k] - a[k]);
    const m = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
    const size = Math.hypot(...m) || 1, at = 84 + 50 * f;
    m.forEach((x, k) => out.setFloat32(at + 4 * k, x / size, true));
    [a, b, c].forEach((p, q) => p.forEach((x, k) => out.setFloat32(at + 12 + 12 * q + 4 * k, x, true)));
  }
  return out.buffer;
}

export function plyBytes(V, F, value, name = "value") {
  const nv = V.length / 3, nf = F.length / 3;
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex ${nv}\nproperty float x\nproperty float y\nproperty float z\n${value ? `property float ${name}\n` : ""}element face ${nf}\nproperty list uchar int vertex_indices\nend_header\n`;
  const stride = value ? 16 : 12, out = new DataView(new ArrayBuffer(head.length + stride * nv + 13 * nf));
  [...head].forEach((c, k) => out.setUint8(k, c.charCodeAt(0)));
  let at = head.length;
  for (let v = 0; v < nv; v++, at += stride) {
    for (let k = 0; k < 3; k++) out.setFloat32(at + 4 * k, V[3 * v + k], true);
    if (value) out.setFloat32(at + 12, value[v], true);
  }
  for (let f = 0; f < nf; f++, at += 13) {
    out.setUint8(at, 3);
    for (let k = 0; k < 3; k++) out.setInt32(at + 1 + 4 * k, F[3 * f + k], true);
  }
  return out.buffer;
}
export const saveMesh = (name, format, V, F, value, field) =>
  download(`${name}.${format}`, format === "stl" ? stlBytes(V, F) : plyBytes(V, F, value, field), "application/octet-stream");

/** Buttons below a view; mesh() gives {V, F, value, field}. */
export function saveTools(view, name, mesh) {
  const save = (format) => () => {
    const m = mesh();
    if (m) saveMesh(fileName(name()), format, m.V, m.F, m.value, m.field); // some shapes have no surface here
  };
  return el("span", { class: "saves" },
    saveButton("PNG", "picture", () => view.picture((blob) => download(`${fileName(name())}.png`, blob))),
    mesh && saveButton("STL", "this surface as STL", save("stl")),
    mesh && saveButton("PLY", "this surface as PLY, with its colours' values", save("ply")));
}

export async function copyText(button, text) {
  const label = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch (error) {
    button.textContent = "Select it and copy by hand";
  }
  setTimeout(() => (button.textContent = label), 2500);
}
