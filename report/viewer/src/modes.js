// Displacements by modes at one standard deviation.  The first are in the page; the others are made of the
// shapes, as the model makes them: mode k = sum over shapes of score / ((I - 1) variance) (shape - mean).
const made = new WeakMap();

export function modeBasis(model) {
  if (!made.has(model)) made.set(model, makeBasis(model));
  return made.get(model);
}

function makeBasis(model) {
  const { mean, shapes, I } = model, sent = mean.modes.length, sd = model.variances.map(Math.sqrt), K = sd.length;
  const codes = K > sent ? model.array(model.more_scores, "integers") : [];
  /** In lengths. */
  const scores = (i, m) => (m < sent ? shapes[i].scores[m] : ((codes[i * (K - sent) + m - sent] - 32768) / 4096) * sd[m]);
  const made = [new Map(), new Map()];
  const sum = (m, centre, of) => {
    const out = new Float32Array(centre.length);
    for (let i = 0; i < I; i++) {
      const X = of(i), w = scores(i, m) / ((I - 1) * sd[m]);
      for (let k = 0; k < out.length; k++) out[k] += w * (X[k] - centre[k]);
    }
    return out;
  };
  const once = (map, m, make) => map.get(m) ?? (map.set(m, make()), map.get(m));
  return {
    scores,
    surface: (m) => once(made[0], m, () => m < sent ? model.array(mean.modes[m].vertices, "displacements")
      : sum(m, model.array(mean.vertices, "positions"), (i) => model.array(shapes[i].warped, "warped"))),
    particles: (m) => once(made[1], m, () => m < sent ? model.array(mean.modes[m].particles, "displacements")
      : sum(m, model.array(mean.particles, "positions"), (i) => model.array(shapes[i].particles, "positions"))),
  };
}
