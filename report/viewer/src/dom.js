// Elements from plain data.  Texts become text nodes, never markup: names of shapes are strangers.
const SVG = "http://www.w3.org/2000/svg";

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

export const el = (tag, attributes, ...children) =>
  fill(document.createElement(tag), attributes, children);
export const svg = (tag, attributes, ...children) =>
  fill(document.createElementNS(SVG, tag), attributes, children);
/** What append does, without words like false for what is not there. */
export const put = (node, ...children) => fill(node, null, children);
export const byId = (id) => document.getElementById(id);

/** A number for people: three significant digits, no exponent where that can be helped. */
export function show(x, digits = 3) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "\u2013";
  if (x === 0) return "0";
  const a = Math.abs(x);
  if (a < 1e-4 || a >= 1e6) return x.toExponential(digits - 1).replace("-", "\u2212");
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(a)));
  return x.toFixed(decimals).replace("-", "\u2212");
}
/** Below a hundredth of a per cent nobody asks how far. */
export const percent = (x) => (x > 0 && x < 1e-4 ? "<\u00a00.01\u00a0%" : `${show(100 * x)}\u00a0%`);
export const plural = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;

export function checkbox(text, checked, change) {
  const box = el("input", { type: "checkbox", onchange: () => change(box.checked) });
  box.checked = checked;
  return el("label", {}, box, text);
}

export function choice(text, options, value, change) {
  const select = el(
    "select",
    { onchange: () => change(select.value) },
    options.map(([key, label]) => el("option", { value: key, selected: key === value }, label)),
  );
  return el("label", {}, text, select);
}

export function table(head, rows, numeric = []) {
  const kind = (k) => (numeric.includes(k) ? "number" : undefined);
  return el(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": "table" },
    el(
      "table",
      {},
      el("thead", {}, el("tr", {}, head.map((text, k) => el("th", { scope: "col", class: kind(k) }, text)))),
      el("tbody", {}, rows.map((row) => el("tr", {}, row.map((cell, k) => el("td", { class: kind(k) }, cell))))),
    ),
  );
}
