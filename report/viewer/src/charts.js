// Charts as SVG: they print sharply and can be read by screen readers (title, and a table beside).
import { svg, show } from "./dom.js";

const W = 420, H = 280, LEFT = 54, RIGHT = 12, TOP = 12, BOTTOM = 42;

/** About `count` round numbers in lo..hi. */
export function ticks(lo, hi, count = 5) {
  if (!(hi > lo)) return [lo];
  const raw = (hi - lo) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + 1e-9 * step; k++) out.push(k * step);
  return out;
}

const plain = (x) => String(Number(x.toPrecision(6))).replace("-", "\u2212");

function frame({ title, x, y, xLabel, yLabel, xTicks, yTicks, yText = plain, xText = plain }, ...marks) {
  return svg(
    "svg",
    { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": title },
    yTicks.map((t) => [
      svg("path", { class: "mesh", d: `M${LEFT} ${y(t)}H${W - RIGHT}` }),
      svg("text", { x: LEFT - 6, y: y(t) + 4, "text-anchor": "end" }, yText(t)),
    ]),
    xTicks.map((t) => svg("text", { x: x(t), y: H - BOTTOM + 17, "text-anchor": "middle" }, xText(t))),
    svg("path", { class: "axis", d: `M${LEFT} ${TOP}V${H - BOTTOM}H${W - RIGHT}` }),
    svg("text", { x: (LEFT + W - RIGHT) / 2, y: H - 6, "text-anchor": "middle" }, xLabel),
    svg("text", { transform: `translate(12 ${(TOP + H - BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle" }, yLabel),
    ...marks,
  );
}

const scale = (lo, hi, from, to) => (v) => from + ((v - lo) / (hi - lo || 1)) * (to - from);
const line = (x, y, values) => values.map((v, k) => `${k ? "L" : "M"}${x(k + 1).toFixed(1)} ${y(v).toFixed(1)}`).join("");

/** values[m - 1] against m modes, with a band of one standard error. */
export function curve({ title, values, errors = null, yLabel, from0 = true }) {
  const n = values.length, e = errors ?? values.map(() => 0);
  const hi = Math.max(...values.map((v, k) => v + e[k])), lo = from0 ? 0 : Math.min(...values.map((v, k) => v - e[k]));
  const yTicks = ticks(lo, hi * 1.02), top = Math.max(hi * 1.02, yTicks[yTicks.length - 1]);
  const x = scale(1, Math.max(n, 2), LEFT + 8, W - RIGHT - 8), y = scale(lo, top, H - BOTTOM, TOP);
  const upper = values.map((v, k) => v + e[k]), lower = values.map((v, k) => v - e[k]);
  const band = `${line(x, y, upper)}${[...lower].map((v, k) => [k, v]).reverse().map(([k, v]) => `L${x(k + 1).toFixed(1)} ${y(v).toFixed(1)}`).join("")}Z`;
  const xTicks = ticks(1, n, 6).filter(Number.isInteger);
  return frame(
    { title, x, y, xLabel: "modes", yLabel, xTicks: xTicks.includes(1) ? xTicks : [1, ...xTicks], yTicks },
    errors && svg("path", { class: "band", d: band }),
    svg("path", { class: "curve", d: line(x, y, values) }),
    n <= 60 && values.map((v, k) =>
      svg("circle", { class: "dot", cx: x(k + 1), cy: y(v), r: 3 },
        svg("title", {}, `${k + 1} modes: ${show(v)}${errors ? ` \u00b1 ${show(e[k], 2)}` : ""}`))),
  );
}

/** Shares of the vertices by distance, on a log scale; series: [{name, values, second}]. */
export function histogram({ series, hi, bins = 40 }) {
  const least = 1e-4;
  const x = scale(0, hi, LEFT, W - RIGHT), y = scale(Math.log10(least), 0, H - BOTTOM, TOP);
  const curves = series.map(({ values, second }) => {
    const count = new Float64Array(bins);
    for (const v of values) count[Math.min(Math.floor((v / hi) * bins), bins - 1)]++;
    let d = `M${LEFT} ${H - BOTTOM}`;
    count.forEach((c, k) => {
      const share = c / values.length;
      const at = share > 0 ? Math.min(y(Math.log10(Math.max(share, least))), H - BOTTOM) : H - BOTTOM;
      d += `V${at.toFixed(1)}H${x(((k + 1) * hi) / bins).toFixed(1)}`;
    });
    return svg("path", { class: second ? "curve second" : "curve", d: `${d}V${H - BOTTOM}` });
  });
  const words = { 0: "100 %", "-1": "10 %", "-2": "1 %", "-3": "0.1 %", "-4": "0.01 %" };
  return frame(
    {
      title: "histogram of surface distances", x, y, xLabel: "distance", yLabel: "share of vertices (log)",
      xTicks: ticks(0, hi), yTicks: [0, -1, -2, -3, -4], yText: (t) => words[t],
    },
    ...curves,
    series.map(({ name, second }, k) => [
      svg("path", { class: second ? "curve second" : "curve", d: `M${W - 196} ${TOP + 8 + 18 * k}h22` }),
      svg("text", { x: W - 168, y: TOP + 12 + 18 * k }, name),
    ]),
  );
}

/** points: [{name, x, y, title, chosen, always}]; names are placed where they collide with nothing. */
export function scatter({ title, points, xLabel, yLabel, onpick, ring, extent = 0, under = null }) {
  const reach = Math.max(ring, extent, ...points.map((p) => Math.max(Math.abs(p.x), Math.abs(p.y)))) * 1.08;
  const width = W - LEFT - RIGHT, height = H - TOP - BOTTOM, unit = Math.min(width, height) / (2 * reach);
  const wide = reach * (width / Math.min(width, height)), high = reach * (height / Math.min(width, height));
  const x = scale(-wide, wide, LEFT, W - RIGHT), y = scale(-high, high, H - BOTTOM, TOP);
  const taken = points.map((p) => [x(p.x) - 5, y(p.y) - 5, x(p.x) + 5, y(p.y) + 5]);
  const label = (p) => {
    const w = 6.1 * p.name.length, h = 11, cx = x(p.x), cy = y(p.y);
    for (const [dx, dy, anchor] of [[7, 4, "start"], [-7, 4, "end"], [0, -8, "middle"], [0, 16, "middle"]]) {
      const left = anchor === "start" ? cx + dx : anchor === "end" ? cx + dx - w : cx - w / 2;
      const box = [left, cy + dy - h, left + w, cy + dy];
      const inside = box[0] >= LEFT && box[2] <= W && box[1] >= 0 && box[3] <= H - BOTTOM;
      const own = taken.every((t) => t[2] < box[0] || t[0] > box[2] || t[3] < box[1] || t[1] > box[3]);
      if ((inside && own) || (p.chosen && inside)) {
        taken.push(box);
        return svg("text", { x: cx + dx, y: cy + dy, "text-anchor": anchor, class: p.chosen ? "name chosen" : "name" }, p.name);
      }
    }
    return null;
  };
  const ordered = [...points].sort((a, b) => Number(b.always) - Number(a.always) || b.x * b.x + b.y * b.y - a.x * a.x - a.y * a.y);
  const pick = (p) => (e) => {
    if (e.type === "click" || e.key === "Enter" || e.key === " ") { e.preventDefault(); onpick(p.index); }
  };
  return frame(
    { title, x, y, xLabel, yLabel, xTicks: ticks(-wide, wide, 6), yTicks: ticks(-high, high) },
    svg("circle", { class: "axis", cx: x(0), cy: y(0), r: ring * unit, "stroke-dasharray": "3 4" }),
    svg("path", { class: "mesh", d: `M${x(0)} ${TOP}V${H - BOTTOM}` }),
    under?.(x, y),
    points.map((p) =>
      svg("circle",
        { class: p.chosen ? "point chosen" : "point", style: p.colour && `fill:${p.colour}${p.colour === "transparent" ? ";stroke:var(--control)" : ""}`, cx: x(p.x), cy: y(p.y), r: 5, tabindex: 0, role: "button", "aria-label": p.title, onclick: pick(p), onkeydown: pick(p) },
        svg("title", { style: p.colour && "fill:var(--text)" }, p.title))),
    ordered.map(label),
  );
}

/** The path of the ellipse that holds 95 % of a normal distribution with the points' mean and covariance. */
function ellipse(points, x, y) {
  const n = points.length, reach = Math.sqrt(5.991);
  if (n < 3) return null;
  const mx = points.reduce((a, p) => a + p.x, 0) / n, my = points.reduce((a, p) => a + p.y, 0) / n;
  let xx = 0, xy = 0, yy = 0;
  for (const p of points) { xx += (p.x - mx) ** 2; xy += (p.x - mx) * (p.y - my); yy += (p.y - my) ** 2; }
  const a = Math.sqrt(xx / (n - 1)), b = a > 0 ? xy / (n - 1) / a : 0, c = Math.sqrt(Math.max(yy / (n - 1) - b * b, 0));
  const at = (k) => {
    const u = reach * Math.cos((k * Math.PI) / 36), v = reach * Math.sin((k * Math.PI) / 36);
    return `${x(mx + a * u).toFixed(1)} ${y(my + b * u + c * v).toFixed(1)}`;
  };
  return `M${Array.from({ length: 72 }, (_, k) => at(k)).join("L")}Z`;
}

/** scatter with a colour for every point, and an ellipse for every group that has one. */
export function colourScatter({ points, ellipses, lines = null, ...rest }) {
  const groups = new Map(), sides = [(p) => p.x, (p) => p.y];
  for (const p of points) if (p.group !== null && p.group !== undefined) groups.set(p.group, [...(groups.get(p.group) ?? []), p]);
  const under = (x, y) => [
    ellipses && [...groups.values()].map((g) => {
      const d = ellipse(g, x, y);
      return d && svg("path", { d, style: `fill:none;stroke:${g[0].colour};stroke-width:1.5` });
    }),
    lines && regressions(points, lines === "groups").map((r) =>
      svg("path", { class: "regression", d: `M${x(r.from).toFixed(1)} ${y(r.at(r.from)).toFixed(1)}L${x(r.to).toFixed(1)} ${y(r.at(r.to)).toFixed(1)}`, style: `stroke:${r.group === null ? "var(--text)" : r.colour};stroke-width:2` })),
  ];
  // An ellipse reaches so far from 0 to both sides.
  const extent = Math.max(0, ...[...groups.values()].filter((g) => ellipses && g.length > 2).flatMap((g) => sides.map((of) => {
    const mean = g.reduce((a, p) => a + of(p), 0) / g.length, square = g.reduce((a, p) => a + (of(p) - mean) ** 2, 0) / (g.length - 1);
    return Math.abs(mean) + Math.sqrt(5.991 * square);
  })));
  return scatter({ points, ...rest, extent, under });
}

/** Lines of least squares of y on x: of all points, or of every group; over the points' own range. */
export function regressions(points, byGroup) {
  const keys = byGroup ? [...new Set(points.map((p) => p.group))].filter((g) => g !== null && g !== undefined) : [null];
  return keys.flatMap((group) => {
    const some = group === null ? points : points.filter((p) => p.group === group), n = some.length;
    const mx = some.reduce((a, p) => a + p.x, 0) / n, my = some.reduce((a, p) => a + p.y, 0) / n;
    let xx = 0, xy = 0, yy = 0;
    for (const p of some) { xx += (p.x - mx) ** 2; xy += (p.x - mx) * (p.y - my); yy += (p.y - my) ** 2; }
    if (n < 3 || !(xx > 0) || !(yy > 0)) return [];
    const slope = xy / xx;
    return [{ group, n, slope, r: xy / Math.sqrt(xx * yy), at: (x) => my + slope * (x - mx), from: Math.min(...some.map((p) => p.x)), to: Math.max(...some.map((p) => p.x)), colour: some[0].colour }];
  });
}

/** Known and predicted values, with the line on which they agree. */
export function agreement({ title, points, xLabel, yLabel, onpick }) {
  const all = points.flatMap((p) => [p.x, p.y]), lo = Math.min(...all), hi = Math.max(...all), pad = 0.04 * (hi - lo || 1);
  const x = scale(lo - pad, hi + pad, LEFT, W - RIGHT), y = scale(lo - pad, hi + pad, H - BOTTOM, TOP), at = ticks(lo, hi);
  return frame(
    { title, x, y, xLabel, yLabel, xTicks: at, yTicks: at },
    svg("path", { class: "axis", "stroke-dasharray": "4 4", d: `M${x(lo)} ${y(lo)}L${x(hi)} ${y(hi)}` }),
    points.map((p) =>
      svg("circle", { class: "dot", cx: x(p.x).toFixed(1), cy: y(p.y).toFixed(1), r: 4, onclick: () => onpick(p.index), style: "cursor:pointer" },
        svg("title", {}, p.title))),
  );
}
