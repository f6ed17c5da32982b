// What is drawn over a view: scale bar, orientation, measured distance.
import { length, unitKnown, unitTail } from "./units.js";

const font = (density) => `${12 * density}px system-ui, sans-serif`;

/** A round length of about a fifth of the view. */
export function paintScale(flat, { width, height, density, ink, perPixel }) {
  const about = 0.2 * width * perPixel, power = 10 ** Math.floor(Math.log10(about));
  const bar = [5, 2, 1].map((f) => f * power).find((x) => x <= about) ?? power;
  const w = bar / perPixel, x = width - 14 * density - w, y = height - 14 * density, tick = 4 * density;
  flat.strokeStyle = flat.fillStyle = ink;
  flat.lineWidth = 1.5 * density;
  flat.beginPath();
  flat.moveTo(x, y - tick); flat.lineTo(x, y); flat.lineTo(x + w, y); flat.lineTo(x + w, y - tick);
  flat.stroke();
  flat.font = font(density);
  flat.textAlign = "right"; // a long label stays in the view
  flat.textBaseline = "bottom";
  flat.fillText(`${Number(bar.toPrecision(2))}${unitKnown() ? unitTail() : " (unit not known)"}`, x + w, y - tick);
}

const LETTERS = [["L", "R"], ["P", "A"], ["S", "I"]];

/** axes: left, posterior, superior as (right, up, to the viewer) of the view. */
export function paintAxes(flat, { density, ink, axes }) {
  const r = 22 * density, x = 40 * density, y = 40 * density;
  flat.font = `600 ${font(density)}`;
  flat.textAlign = "center";
  flat.textBaseline = "middle";
  flat.strokeStyle = flat.fillStyle = ink;
  flat.lineWidth = 1.5 * density;
  axes.forEach((a, k) => {
    const size = Math.hypot(a[0], a[1]);
    if (size < 0.2) return; // points at the viewer
    for (const side of [1, -1]) {
      const u = side * a[0], v = -side * a[1];
      flat.globalAlpha = side > 0 ? 1 : 0.55;
      flat.beginPath();
      flat.moveTo(x, y);
      flat.lineTo(x + r * u, y + r * v);
      flat.stroke();
      flat.fillText(LETTERS[k][side > 0 ? 0 : 1], x + (r + 9 * density / size) * u, y + (r + 9 * density / size) * v);
    }
  });
  flat.globalAlpha = 1;
}

export const distanceOf = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

export function paintMeasure(flat, { at, points, density, ink, ground }) {
  flat.strokeStyle = flat.fillStyle = ink;
  flat.lineWidth = 2 * density;
  if (at.length === 2) {
    flat.beginPath();
    flat.moveTo(...at[0]);
    flat.lineTo(...at[1]);
    flat.stroke();
  }
  for (const [x, y] of at) {
    flat.beginPath();
    flat.arc(x, y, 4 * density, 0, 2 * Math.PI);
    flat.fillStyle = ground;
    flat.fill();
    flat.stroke();
  }
  if (at.length < 2) return;
  const text = length(distanceOf(points)), x = (at[0][0] + at[1][0]) / 2, y = (at[0][1] + at[1][1]) / 2 - 10 * density;
  flat.font = `600 ${font(density)}`;
  flat.textAlign = "center";
  flat.textBaseline = "bottom";
  flat.lineWidth = 4 * density;
  flat.strokeStyle = ground;
  flat.strokeText(text, x, y);
  flat.fillStyle = ink;
  flat.fillText(text, x, y);
}
