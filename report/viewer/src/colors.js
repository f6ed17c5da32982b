// Palettes that stay apart with every kind of colour vision: lightness rises or falls all along.
const HEAT = ["#fdf3d8", "#fbd48a", "#f6a04d", "#dd6a2e", "#a83a24", "#66191a", "#2d0711"];
const SIGNED = ["#0b3c6e", "#2a78b5", "#8fbfdf", "#eeeae2", "#f0b27a", "#c96a1b", "#7a3300"];

const channels = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));

/** Colour [r, g, b] in 0..255 at t in 0..1. */
export function colourAt(palette, t) {
  const at = Math.min(Math.max(t, 0), 1) * (palette.length - 1);
  const k = Math.min(Math.floor(at), palette.length - 2);
  const a = channels(palette[k]), b = channels(palette[k + 1]);
  return a.map((x, c) => x + (b[c] - x) * (at - k));
}

export const palettes = { heat: HEAT, signed: SIGNED };
export const cssGradient = (palette) => `linear-gradient(to right, ${palette.join(", ")})`;

/** 256 RGBA values. */
export function lookUpTable(palette) {
  const bytes = new Uint8Array(4 * 256);
  for (let k = 0; k < 256; k++) bytes.set([...colourAt(palette, k / 255).map(Math.round), 255], 4 * k);
  return bytes;
}

// As in src/report/colours.c: Okabe and Ito's colours without black, and kin of the same hues.
const CATEGORIES = ["#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#5b3a8c", "#7a1f1f", "#bfe8a0"];

/** Colours of particles from their numbers, which src/report/colours.c chooses so that neighbours differ. */
export const particleColours = (chosen) =>
  Float32Array.from({ length: 3 * chosen.length }, (_, k) => channels(CATEGORIES[chosen[Math.floor(k / 3)]])[k % 3] / 255);
