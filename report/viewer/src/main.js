// Fills the page: one function a part of the report.
import { byId, checkbox, choice, el, percent, plural, put, show, table } from "./dom.js";
import { Model, median, normalsAt, outliers, readPage, vertexNormals } from "./data.js";
import { particleColours } from "./colors.js";
import * as gl from "./gl.js";
import { curve, histogram, scatter } from "./charts.js";
import { fillAnswers } from "./answers.js";
import { fillCompare } from "./compare.js";
import { length, setUnit, unitKnown, unitNote, unitSentence } from "./units.js";
import { copyText, fileName, saveCsv, saveSvg, saveButton, saveTools } from "./save.js";
import { modeBasis } from "./modes.js";
import { readLink, writeLink } from "./link.js";
import { Fits, fillFits } from "./fits.js";
import { Contours, fillContours } from "./contours.js";
import { Norms, fillNorms } from "./norms.js";
import { legend, stageOf } from "./surface.js";
import { fieldEnds, fieldsOf, spreadParts } from "./fields.js";
import { fillParts, jointModes, partsOf, partsOfParticles, tableOfSpaces, tellClosed, tellApart } from "./joint.js";

const state = {
  chosen: 0, // shape
  hover: -1, pin: -1, // particles
  sort: "name", surface: "original", particles: true, colour: "none",
  axes: [0, 1],
};
let fields = []; // of fields.js
let model, tint, radius, shorts, partOfParticle = null;
const marked = []; // particle geometries on the page, all marked alike
const refresh = { shape: [], particle: [] };
const SLIDER = 3, FIRST = 5; // standard deviations at a slider's ends; modes that are shown at once

// ---- shapes as geometry, made when first looked at ----

const made = new Map();
function once(key, make) {
  if (!made.has(key)) made.set(key, make());
  return made.get(key);
}

const NOTHING = -1e30; // no value: grey (gl.js)
function surfaceOf(i, which) {
  return once(`${which} ${i}`, () => {
    const s = model.shapes[i], warped = which === "warped";
    const V = warped ? model.array(s.warped, "warped") : model.array(s.vertices, "positions");
    const F = model.array(warped ? model.mean.faces : s.faces, "integers");
    const N = vertexNormals(V, F);
    const value = model.array(warped ? s.warped_distance : s.distance, "distances");
    if (!warped && s.rest) value.fill(NOTHING, value.length - s.rest); // what constraints took away
    const part = partsOf(model, warped ? model.joint?.vertices : s.parts, V.length / 3);
    return { V, F, N, value, geometry: gl.surfaceGeometry(V, F, N, value, part) };
  });
}
const particleStarts = () => model.joint?.parts.map((p) => p.particles);
/** The surface of shape i, coloured by a field. */
function fieldSurface(i, which, field) {
  return once(`${field.key} ${which} ${i}`, () => {
    const { V, F, N } = surfaceOf(i, which), s = model.shapes[i], vertices = which === "warped" ? model.joint?.vertices : s.parts;
    const value = spreadParts(V, particlesOf(i), field.of(i), vertices, particleStarts());
    if (which === "original" && s.rest) value.fill(NOTHING, value.length - s.rest);
    return { V, F, N, value, geometry: gl.surfaceGeometry(V, F, N, value, partsOf(model, vertices, V.length / 3)) };
  });
}
/** On the mean's mesh. */
const meanGeometry = (V, F, N, value) => gl.surfaceGeometry(V, F, N, value, partsOf(model, model.joint?.vertices, V.length / 3));
const particlesOf = (i) => model.array(model.shapes[i].particles, "positions");
const normalsOf = (i) =>
  once(`normals ${i}`, () => {
    const { V, N } = surfaceOf(i, "original");
    return normalsAt(particlesOf(i), V, N);
  });
function dotsOf(i) {
  return once(`dots ${i}`, () => {
    const g = gl.particleGeometry(particlesOf(i), tint, partOfParticle);
    marked.push(g);
    mark(g);
    return g;
  });
}

// ---- particles: hover and click ----

function mark(g) {
  const at = state.hover >= 0 ? state.hover : state.pin, m = g.getAttribute("mark");
  m.array.fill(at >= 0 ? 1 : 0);
  if (at >= 0) m.array[at] = 2;
  m.needsUpdate = true;
}
function pickParticle(j, how) {
  const before = state.hover >= 0 ? state.hover : state.pin;
  if (how === "hover") state.hover = j;
  else state.pin = j === state.pin ? -1 : j;
  if (before === (state.hover >= 0 ? state.hover : state.pin) && how === "hover") return;
  marked.forEach(mark);
  refresh.particle.forEach((f) => f());
  gl.invalidateAll();
}
/** Keeps the next or the previous particle: what a click does, for the keyboard. */
function stepParticle(n) {
  const j = state.pin < 0 ? (n > 0 ? 0 : model.J - 1) : (state.pin + n + model.J) % model.J;
  state.hover = -1;
  pickParticle(j, "click");
}
const readoutText = () => {
  const j = state.hover >= 0 ? state.hover : state.pin;
  return j < 0 ? "" : `particle ${j}${j === state.pin ? " (kept; click again to let go)" : ""}`;
};

function makeView(label, options = {}) {
  const canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": label });
  const readout = el("div", { class: "readout", "aria-live": "polite" });
  const view = new gl.View(canvas, { large: true, radius, pick: pickParticle, ...options });
  refresh.particle.push(() => (readout.textContent = readoutText()));
  return { view, canvas, box: el("div", { class: "view" }, canvas, readout) };
}

/** Below a view: measuring, and what can be saved of it. */
function viewTools(view, name, mesh) {
  const told = el("span", { class: "soft", "aria-live": "polite" });
  const tell = (on) => (told.textContent = on ? "Click two points on the surface." : "");
  return el("div", { class: "tools screen" },
    checkbox("Measure", false, (on) => { view.measured = on ? [] : null; tell(on); view.invalidate(); }), told, saveTools(view, name, mesh));
}
const savesOf = (name, chart, rows) => el("p", { class: "saves screen" },
  chart && saveButton("SVG", `${name} as a picture`, () => saveSvg(fileName(model.title, name), chart().querySelector("svg"))),
  rows && saveButton("CSV", `${name} as a table`, () => saveCsv(fileName(model.title, name), rows())));

function chooseShape(i, { go = false } = {}) {
  state.chosen = i;
  refresh.shape.forEach((f) => f());
  if (go) byId("fidelity").scrollIntoView({ behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
}

/** Names without what all of them share, for narrow places. */
function shortNames(names) {
  if (names.length < 2) return names;
  const common = (list) => {
    let n = 0;
    while (list.every((t) => n < t.length && t[n] === list[0][n])) n++;
    return n;
  };
  const turned = names.map((t) => [...t].reverse().join(""));
  const whole = (n, text) => { while (n > 0 && /[\p{L}\p{N}]/u.test(text[n - 1])) n--; return n; };
  const head = whole(common(names), names[0]), tail = whole(common(turned), turned[0]);
  const cut = names.map((t) => t.slice(head, Math.max(head, t.length - tail)));
  return new Set(cut).size === names.length && cut.every((t) => t.length > 0) ? cut : names;
}

// ---- figures about shapes ----

/** A distance on the template is rounding: 0. */
const tidy = (x, surface) => (x < 1e-9 * surface.diagonal ? 0 : x);

// How likely a shape's correspondence is lost; "" where that is not known.
const likely = (c) => (c.probability_lost == null ? "" : `; probability ${c.probability_lost.toFixed(2)} that over a tenth of its particles are lost`);

let facts; // per shape: name, surface, mismatched, strict, distance, certificate

function gatherFacts() {
  const mean = model.array(model.mean.particles, "positions");
  const surface = new Map((model.evaluation.surface_distance?.per_shape ?? []).map((s) => [s.name, s]));
  const certificate = new Map(model.certificate.per_shape.map((s) => [s.name, s]));
  return model.shapes.map((s) => {
    const c = certificate.get(s.name) ?? { verdict: "needs review", reasons: ["is not in the certificate"] };
    const P = model.array(s.particles, "positions"), sum = P.reduce((a, x, k) => a + (x - mean[k]) ** 2, 0);
    return {
      name: s.name, certificate: c, surface: surface.get(s.name) ?? null,
      mean: surface.has(s.name) ? tidy(surface.get(s.name).mean, surface.get(s.name)) : NaN,
      lost: c.lost?.length ?? 0, mismatched: c["mismatched_1.5_2.0"]?.length ?? 0, strict: c["mismatched_1.5_1.5"]?.length ?? 0,
      distance: Math.sqrt(sum / model.J),
      fine: c.verdict === "certified",
    };
  });
}
function findOutliers() {
  const kinds = [
    ["surface error", facts.map((f) => f.mean), length],
    ["stretched particles", facts.map((f) => f.mismatched), (n) => String(n)],
    ["distance from the mean", facts.map((f) => f.distance), length],
  ];
  const found = new Map();
  for (const [word, values, tell] of kinds)
    for (const i of outliers(values)) {
      const text = `${word} ${tell(values[i])} (median ${tell(median(values))})`;
      found.set(i, [...(found.get(i) ?? []), text]);
    }
  return found;
}

// ---- header ----

// Notes of the grooming that touch trust, by kind: those of one kind begin alike, up to a colon.
function kindsOfNotes() {
  const kinds = new Map();
  for (const n of model.certificate.notes ?? []) {
    const kind = n.text.split(":")[0];
    kinds.set(kind, [...(kinds.get(kind) ?? []), n]);
  }
  return [...kinds].map(([kind, notes]) => ({ kind, notes }));
}

function fillHeader() {
  const { certificate: c, evaluation: e } = model;
  byId("title").textContent = `Shape model \u201c${model.title}\u201d`;
  document.title = `${model.title} \u2013 shape model`;
  const surface = e.surface_distance;
  byId("summary").textContent =
    `${plural(model.I, "shape")}, ${model.J} particles each, template ${e.template}. ` +
    (surface ? `Surfaces are reproduced to ${length(surface.mean)} on average, ${length(surface.max)} at worst. ` : "") +
    unitSentence();
  const fine = c.certified === c.shapes;
  const review = facts.flatMap((f, i) => (f.fine ? [] : [i]));
  byId("verdict").append(
    el("div", { class: `verdict ${fine ? "good" : "bad"}` },
      el("span", { class: "sign", "aria-hidden": "true" }, fine ? "\u2713" : "!"),
      el("div", {},
        el("strong", {}, c.verdict === "not judged" ? "Too few shapes, or particles, to judge them by each other: nothing is certified. " : fine
          ? c.shapes === 1 ? "The shape is certified. " : `All ${c.shapes} shapes are certified. `
          : `${c.shapes - c.certified} of ${plural(c.shapes, "shape")} need${c.shapes - c.certified === 1 ? "s" : ""} review: `),
        c.verdict === "not judged" ? "" : fine ? `Particles correspond: ${countsText()}.`
          : review.slice(0, 12).map((i) => el("button", { type: "button", class: "link", onclick: () => showTrouble(i) }, facts[i].name)),
        !fine && c.verdict !== "not judged" && review.length > 12 && el("a", { href: "#certificate" }, `and ${review.length - 12} more`),
        !fine && c.verdict !== "not judged" && commandTo(review),
        kindsOfNotes().map(({ kind, notes }) => el("div", {}, el("a", { href: "#certificate" },
          `${notes.length > 1 ? `${notes.length} shapes` : notes[0].shape}: ${kind}`))))),
  );
  const link = byId("link");
  link.addEventListener("click", () => copyText(link, writeLink(linkState())));
}

/** What the certificate's table adds up to. */
function countsText() {
  const sum = (f) => facts.reduce((a, x) => a + f(x), 0), swaps = sum((f) => f.certificate.swaps?.length ?? 0), folds = sum((f) => f.certificate.folds?.length ?? 0);
  const lost = sum((f) => f.lost), some = facts.filter((f) => f.lost > 0), worst = facts.reduce((a, f) => (f.lost > a.lost ? f : a), facts[0]);
  const none = (n, word) => (n === 0 ? `no ${word}s` : plural(n, word));
  return `${none(swaps, "swapped pair")}, ${none(folds, "fold")}, ` + (lost === 0 ? "no particle has lost its neighbours"
    : `${lost} of ${(model.I * model.J).toLocaleString("en")} particles have lost neighbours, on ${plural(some.length, "shape")} (at most ${worst.lost} of ${model.J}, on ${worst.name})`);
}

/** The command that leaves shapes out and makes the model anew. */
function commandTo(list) {
  const quote = (t) => (/^[\w.+-]+$/.test(t) ? t : `'${t.replaceAll("'", "'\\''")}'`);
  const out = list.filter((i) => i !== model.template), kept = model.I - out.length;
  if (out.length === 0 || kept < 3) return null;
  const text = `apsm exclude ${quote(model.title)} ${out.map((i) => quote(facts[i].name)).join(" ")}`;
  const button = el("button", { type: "button", onclick: () => copyText(button, text) }, "Copy");
  return el("div", { class: "command screen" }, el("span", {}, `Look first. To continue without ${out.length === 1 ? "it" : "them"}: `),
    el("code", {}, text.length > 160 ? `${text.slice(0, 150)} \u2026` : text), " ", button,
    out.length < list.length && el("span", {}, ` ${facts[model.template].name} is the template: a new run with --exclude is needed for that.`));
}

// ---- mean and modes ----

/** The modes of the model, which move everything at once. */
function allModes(basis) {
  const move = (weight, V, P) => {
    for (let m = 0; m < weight.length; m++) {
      const b = weight[m];
      if (b === 0) continue;
      const D = basis.surface(m), DP = basis.particles(m);
      for (let k = 0; k < V.length; k++) V[k] += b * D[k];
      for (let k = 0; k < P.length; k++) P[k] += b * DP[k];
    }
  };
  const V0 = model.array(model.mean.vertices, "positions"), P0 = model.array(model.mean.particles, "positions");
  return { V0, P0, variances: model.variances, shown: model.variances.length, move };
}

function fillModes() {
  const body = byId("modes").querySelector(".body"), mean = model.mean, F = model.array(mean.faces, "integers");
  const basis = modeBasis(model), sets = { all: allModes(basis), ...jointModes(model) };
  let of = "all", { V0, P0, variances } = sets.all, K = sets.all.shown, N0 = vertexNormals(V0, F);
  const V = V0.slice(), N = N0.slice(), P = P0.slice(), value = new Float32Array(V.length / 3);
  const surface = meanGeometry(V, F, N, value), dots = gl.particleGeometry(P, tint, partOfParticle);
  marked.push(dots);
  const { view, box } = makeView("mean shape with modes of variation; arrows turn it");
  let normals = normalsAt(P0, V0, N0), weight = new Float64Array(K), rows = [];
  const totalOf = () => variances.reduce((a, b) => a + b, 0) || 1;
  view.setPickable(P, normals, partOfParticle);
  const options = { colour: "moved", particles: false };

  // The scale is that of the modes that are moved, to the ends of their sliders.
  const reaches = new Map();
  const reachOf = (m) => {
    if (!reaches.has(m)) {
      const one = Float64Array.from({ length: K }, (_, k) => (k === m ? SLIDER : 0)), to = V0.slice();
      sets[of].move(one, to, P0.slice());
      let most = 0;
      for (let k = 0; k < to.length; k += 3)
        most = Math.max(most, Math.abs((to[k] - V0[k]) * N0[k] + (to[k + 1] - V0[k + 1]) * N0[k + 1] + (to[k + 2] - V0[k + 2]) * N0[k + 2]));
      reaches.set(m, most);
    }
    return reaches.get(m);
  };
  let reach = 1;
  const scale = () => {
    const moved = [...weight.keys()].filter((m) => weight[m] !== 0);
    reach = (moved.length > 0 ? moved.reduce((a, m) => a + reachOf(m), 0) : K > 0 ? reachOf(0) : 1) || 1;
    key.replaceChildren(legend("signed", [`\u2212${length(reach)} inward`, "0", `+${length(reach)} outward`]));
  };

  const shape = () => {
    V.set(V0);
    P.set(P0);
    sets[of].move(weight, V, P);
    vertexNormals(V, F, N);
    for (let k = 0; k < V.length; k += 3)
      value[k / 3] = (V[k] - V0[k]) * N0[k] + (V[k + 1] - V0[k + 1]) * N0[k + 1] + (V[k + 2] - V0[k + 2]) * N0[k + 2];
    for (const name of ["position", "normal", "value"]) surface.getAttribute(name).needsUpdate = true;
    dots.getAttribute("at").needsUpdate = true;
    dress();
  };
  /** The mean map of a field at the mean's vertices. */
  const mapOf = (field) => once(`mean ${field.key}`, () => spreadParts(sets.all.V0, sets.all.P0, field.mean, model.joint?.vertices, particleStarts()));
  const dress = () => {
    const field = fields.find((f) => f.key === options.colour), moved = options.colour === "moved" && (!model.joint || weight.some((b) => b !== 0));
    if (field) {
      value.set(mapOf(field));
      surface.getAttribute("value").needsUpdate = true;
      key.replaceChildren(legend("heat", fieldEnds(field)));
    } else scale();
    view.set({ surface, particles: options.particles ? dots : null, palette: field ? "heat" : moved ? "signed" : null, range: field ? [field.lo, field.hi] : [-reach, reach] });
    view.setPickable(options.particles ? P : null, normals, partOfParticle);
    key.hidden = options.colour === "none";
  };
  const tell = (m) => {
    const row = rows[m], b = weight[m];
    if (!row) return;
    row.range.value = b;
    const text = `${b < 0 ? "\u2212" : "+"}${Math.abs(b).toFixed(2)} sd`;
    row.value.textContent = text;
    row.range.setAttribute("aria-valuetext", text);
  };
  const setMode = (m, b) => {
    weight[m] = b;
    tell(m);
  };

  let playing = -1, started = 0;
  const play = (m) => {
    const was = playing;
    stop();
    if (was === m) return;
    playing = m;
    started = performance.now() - (Math.asin(Math.min(Math.max(weight[m] / 2, -1), 1)) / 1.6) * 1000;
    rows[m].play.setAttribute("aria-pressed", "true");
    rows[m].play.textContent = "\u275a\u275a";
    requestAnimationFrame(frame);
  };
  const stop = () => {
    if (playing < 0) return;
    rows[playing].play.setAttribute("aria-pressed", "false");
    rows[playing].play.textContent = "\u25b6";
    playing = -1;
  };
  const frame = (now) => {
    if (playing < 0) return;
    setMode(playing, 2 * Math.sin(((now - started) / 1000) * 1.6) || 1e-9);
    shape();
    requestAnimationFrame(frame);
  };

  const trust = (m) => {
    const t = of === "all" && model.evaluation.modes?.[m];
    if (!t) return "";
    const why = `cosine ${t.cosine.toFixed(2)} with the same mode when shapes are drawn again; by chance a mode of this rank has ${percent(t.chance)} of the variance`;
    return el("span", { class: "trust soft", title: why }, t.text);
  };
  const makeRow = (m) => {
    const range = el("input", {
      type: "range", min: -SLIDER, max: SLIDER, step: 0.01, value: 0, "aria-label": `mode ${m + 1} in standard deviations`,
      oninput: () => { if (playing === m) stop(); setMode(m, Number(range.value)); shape(); },
    });
    const button = el("button", { type: "button", "aria-label": `play mode ${m + 1}`, "aria-pressed": "false", onclick: () => play(m) }, "\u25b6");
    const text = el("span", { class: "value" }, "+0.00 sd");
    rows[m] = { range, play: button, value: text };
    tell(m);
    return el("div", { class: "mode" }, button,
      el("span", {}, el("span", { class: "name" }, `Mode ${m + 1} `), el("span", { class: "soft" }, percent(variances[m] / totalOf()))),
      text, el("div", { class: "range" }, range), trust(m));
  };
  const reset = () => {
    stop();
    for (let m = 0; m < K; m++) setMode(m, 0);
    shape();
  };
  const key = el("div"), list = el("div");
  const fillList = () => {
    const more = K > FIRST && el("details", { ontoggle: () => {
      if (more.children.length === 1) more.append(el("div", {}, Array.from({ length: K - FIRST }, (_, k) => makeRow(FIRST + k))));
    } }, el("summary", {}, `${plural(K - FIRST, "more mode")} (${percent(variances.slice(FIRST).reduce((a, b) => a + b, 0) / totalOf())} of the variance)`));
    list.replaceChildren(...Array.from({ length: Math.min(K, FIRST) }, (_, m) => makeRow(m)), ...(more ? [more] : []));
  };
  const use = (which) => {
    stop();
    of = which;
    ({ V0, P0, variances, shown: K } = sets[of]);
    N0 = vertexNormals(V0, F);
    normals = normalsAt(P0, V0, N0);
    weight = new Float64Array(K);
    rows = [];
    reaches.clear();
    pick?.querySelector("select") && (pick.querySelector("select").value = of);
    fillList();
    shape();
  };
  const words = { all: "pose and shape together", pose: "pose", shape: "shape" };
  const pick = sets.pose && choice("Modes of", Object.keys(sets).map((k) => [k, words[k]]), of, use);
  fillList();
  const state = () => [...weight].flatMap((b, m) => (b === 0 ? [] : [`${of === "all" ? "" : `${of}_`}mode${m + 1}${b < 0 ? "" : "+"}${b.toFixed(1)}`])).join(" ") || "mean";
  put(body,
    el("p", { class: "soft" }, K === 0 ? "The shapes do not vary: there are no modes."
      : `The mean of all shapes and ${plural(K, "mode")} of variation, each with its share of the variance. Colour: how far the surface has moved outward or inward; the scale ends at ${SLIDER} standard deviations.`),
    ...(sets.pose ? [el("p", { class: "soft" }, tellApart(model))] : []),
    el("div", { class: "split" },
      el("div", { class: "main" }, box, key, viewTools(view, () => `${model.title} ${state()}`, () => ({ V, F, value, field: fields.find((f) => f.key === options.colour)?.name ?? "displacement" })),
        el("p", { class: "small soft screen fine" }, "Drag to turn, Shift-drag to move, Ctrl-wheel or two fingers to zoom, double-click to reset. All views turn together.")),
      el("div", { class: "sliders" },
        el("div", { class: "tools" },
          el("button", { type: "button", onclick: reset }, "Reset to the mean"),
          fields.length === 0
            ? checkbox("Colour", true, (on) => { options.colour = on ? "moved" : "none"; shape(); })
            : choice("Colour", [["moved", "displacement"], ...fields.map((f) => [f.key, `mean ${f.name}`]), ["none", "plain"]], options.colour, (v) => { options.colour = v; shape(); }),
          checkbox("Particles", false, (on) => { options.particles = on; dress(); })),
        pick && el("div", { class: "tools" }, pick), list)),
  );
  shape();
  return { setMode: (m, b) => { setMode(m, b); shape(); }, use, sets, get of() { return of; }, get weight() { return weight; }, V, D: basis.surface };
}

// ---- cohort ----

function fillCohort(strange) {
  const body = byId("cohort").querySelector(".body"), grid = el("div", { class: "grid" });
  const worst = Math.max(0, ...facts.map((f) => f.surface?.p95 ?? 0)) || model.largest_distance;
  const tiles = facts.map((fact, i) => {
    const canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": `${fact.name}, drag to turn all` });
    const name = el("button", { type: "button", class: "link", title: `${fact.name}: show its surface distances`, onclick: () => chooseShape(i, { go: true }) }, shorts[i]);
    const info = el("div", { class: "soft" });
    const node = el("figure", { class: "tile" }, canvas,
      el("figcaption", {}, name, info,
        i === model.template && el("span", { class: "badge plain" }, "template"),
        model.shapes[i].mirrored && el("span", { class: "badge plain" }, "mirrored"),
        !fact.fine && el("span", { class: "badge bad" }, "needs review"),
        strange.has(i) && el("span", { class: "badge bad", title: strange.get(i).join("; ") }, "outlier")));
    const view = new gl.View(canvas, {
      radius: 1.4 * radius, // seen small
      pick: (j, how) => {
        pickParticle(j, how);
        if (how === "click") chooseShape(i);
      },
    });
    const dress = view.show.bind(view);
    view.show = (on) => { if (on) clothe(i); dress(on); };
    return { node, view, info };
  });
  const clothe = (i) => {
    const { view } = tiles[i];
    const field = fields.find((f) => f.key === state.colour);
    view.set({
      surface: (field ? fieldSurface(i, state.surface, field) : surfaceOf(i, state.surface)).geometry, particles: state.particles ? dotsOf(i) : null,
      palette: state.colour === "none" ? null : "heat", range: field ? [field.lo, field.hi] : [0, worst],
    });
    view.setPickable(state.particles ? particlesOf(i) : null, state.particles ? normalsOf(i) : null, partOfParticle);
  };
  const explain = () => {
    const field = fields.find((f) => f.key === state.colour);
    key.replaceChildren(legend("heat", field ? fieldEnds(field) : ["0", "distance to the other surface", `\u2265 ${length(worst)}`]));
    key.hidden = state.colour === "none";
  };
  const dressAll = () => { tiles.forEach((t, i) => t.view.on && clothe(i)); explain(); };
  const orders = {
    name: () => 0,
    surface: (f) => -(Number.isFinite(f.mean) ? f.mean : -1),
    mismatched: (f) => -(f.mismatched + f.strict / 1e6),
    distance: (f) => -f.distance,
  };
  const texts = {
    name: (f) => (Number.isFinite(f.mean) ? `error ${length(f.mean)}` : ""),
    surface: (f) => `error ${length(f.mean)}`,
    mismatched: (f) => `${f.mismatched} stretched`,
    distance: (f) => `${length(f.distance)} from the mean`,
  };
  const arrange = () => {
    const order = facts.map((_, i) => i).sort((a, b) => orders[state.sort](facts[a]) - orders[state.sort](facts[b]) || a - b);
    grid.append(...order.map((i) => tiles[i].node));
    tiles.forEach((t, i) => (t.info.textContent = texts[state.sort](facts[i])));
  };
  const key = el("div");
  const list = [...strange.entries()];
  const item = ([i, why]) => el("li", {},
    el("button", { type: "button", class: "link", onclick: () => chooseShape(i, { go: true }) }, facts[i].name), ` \u2013 ${why.join("; ")}`);
  const readout = el("p", { class: "small screen", "aria-live": "polite" });
  const hint = "Point at a particle to find it on every shape; click to keep it. The comma and full stop keys step through the particles.";
  const tell = () => (readout.textContent = readoutText() || hint);
  refresh.particle.push(tell);
  tell();
  put(body,
    el("p", { class: "soft" }, "A particle has the same colour on every shape; neighbours differ. All views turn together."),
    list.length > 0
      ? el("div", {}, el("p", {}, el("strong", {}, "Outliers"), " (beyond the median by 3.5 robust standard deviations):"),
        el("ul", {}, list.slice(0, 5).map(item)),
        list.length > 5 && el("details", {}, el("summary", {}, `${plural(list.length - 5, "more outlier")}`), el("ul", {}, list.slice(5).map(item))),
        commandTo(list.map(([i]) => i)))
      : el("p", {}, "No outliers: no shape is beyond the median by 3.5 robust standard deviations in surface error, stretched particles or distance from the mean."),
    el("div", { class: "tools" },
      choice("Sort by", [["name", "name"], ["surface", "surface error"], ["mismatched", "stretched particles"], ["distance", "distance from the mean"]], state.sort, (v) => { state.sort = v; arrange(); }),
      choice("Surface", [["original", "original"], ["warped", "reconstruction"]], state.surface, (v) => { state.surface = v; dressAll(); }),
      checkbox("Particles", state.particles, (on) => { state.particles = on; dressAll(); }),
      choice("Colour", [["none", "plain"], ["distance", "surface distance"], ...fields.map((f) => [f.key, f.name])], state.colour, (v) => { state.colour = v; dressAll(); }),
      choice("Size", [["8", "small"], ["10.5", "medium"], ["17", "large"]], "10.5", (v) => grid.style.setProperty("--tile", `${v}rem`))),
    key, readout, grid,
  );
  arrange();
  explain();
  const frame = () => tiles.forEach((t, i) => t.node.classList.toggle("selected", i === state.chosen));
  refresh.shape.push(frame);
  return tiles;
}

// ---- fidelity ----

function fillFidelity() {
  const body = byId("fidelity").querySelector(".body");
  const left = makeView("original surface coloured by distance to the reconstruction");
  const right = makeView("reconstruction coloured by distance to the original surface");
  const select = choice("Shape", facts.map((f, i) => [String(i), f.name]), "0", (v) => chooseShape(Number(v)));
  const figures = el("div"), chart = el("figure", { class: "chart" }), ends = el("div");
  const options = { particles: false, scale: "cohort" };
  const largest = Math.max(0, ...facts.map((f) => f.surface?.p95 ?? 0)) || model.largest_distance;
  const largestOf = (i) => Math.max(...["original", "warped"].map((w) => surfaceOf(i, w).value.reduce((a, b) => Math.max(a, b), 0)));
  const step = (n) => chooseShape((state.chosen + n + model.I) % model.I);

  const landmarks = model.evaluation.landmarks, marks = el("div");
  const tellLandmarks = (i) => {
    if (!landmarks) return;
    const own = landmarks.per_shape.find((s) => s.name === facts[i].name), cell = (x) => (typeof x === "number" ? length(x) : "\u2013");
    marks.replaceChildren(el("h3", {}, "Landmarks"),
      el("p", { class: "small soft" }, `How far from a shape\u2019s own landmarks those of the template end when the correspondence carries them there. ` + (landmarks.use === "judge" ? "They had no part in the model: an independent judge." : `They had a part in the model (${landmarks.use}) and are not an independent judge.`)),
      table(["landmark", "all shapes", facts[i].name], [["mean", cell(landmarks.mean), cell(own?.mean)], ...landmarks.names.map((n, k) => [n, cell(landmarks.means[k]), cell(own?.errors[k])])], [1, 2]));
  };
  const render = () => {
    const i = state.chosen, fact = facts[i], d = fact.surface;
    tellLandmarks(i);
    const a = surfaceOf(i, "original"), b = surfaceOf(i, "warped"), most = largestOf(i);
    const hi = options.scale === "cohort" ? largest : most;
    select.querySelector("select").value = String(i);
    [[left, a], [right, b]].forEach(([v, s]) => {
      v.view.set({ surface: s.geometry, particles: options.particles ? dotsOf(i) : null, palette: "heat", range: [0, hi] });
      v.view.setPickable(options.particles ? particlesOf(i) : null, options.particles ? normalsOf(i) : null, partOfParticle);
    });
    ends.replaceChildren(legend("heat", ["0", "distance", `${hi < most ? "\u2265 " : ""}${length(hi)}`]));
    const cell = (x) => (x === undefined ? "" : show(tidy(x, d)));
    const row = (name, s) => [name, cell(s.mean), cell(s.median), cell(s.p95), cell(s.p99), cell(s.max)];
    figures.replaceChildren(
      d ? table([unitKnown() ? `distance, ${unitNote()}` : "distance", "mean", "median", "95 %", "99 %", "max"],
        [row("two-way", d), row("from reconstruction", d.pull), row("from original", d.push)], [1, 2, 3, 4, 5])
        : el("p", {}, "The surface distance was not measured (option surface_distance); the maps show distances of the vertices on the page."),
      el("p", { class: "small soft" },
        i === model.template ? "This is the template: it is its own reconstruction. " : "",
        d ? `Two-way: vertices of both surfaces in one list. Diagonal of the shape's box: ${length(d.diagonal)}. ` : "",
        `Verdict: ${fact.certificate.verdict}${fact.certificate.reasons?.length ? ` (${fact.certificate.reasons.join("; ")})` : ""}${likely(fact.certificate)}.`),
    );
    chart.replaceChildren(histogram({
      hi: options.scale === "cohort" ? model.largest_distance : most || 1,
      series: [{ name: "original to reconstruction", values: a.value }, { name: "reconstruction to original", values: b.value, second: true }],
    }));
  };
  refresh.shape.push(render);
  put(body,
    el("p", { class: "soft" }, "How much of a shape the particles reproduce: the template\u2019s surface is warped to the shape\u2019s particles (the reconstruction) and compared with the original surface, both ways."),
    el("div", { class: "tools" }, select,
      el("button", { type: "button", "aria-label": "previous shape", onclick: () => step(-1) }, "\u2190"),
      el("button", { type: "button", "aria-label": "next shape", onclick: () => step(1) }, "\u2192"),
      choice("Scale", [["cohort", "same for all shapes"], ["shape", "this shape"]], "cohort", (v) => { options.scale = v; render(); }),
      checkbox("Particles", false, (on) => { options.particles = on; render(); })),
    el("div", { class: "pair" },
      el("div", {}, el("h3", {}, "Original"), left.box, viewTools(left.view, () => facts[state.chosen].name, () => ({ ...surfaceOf(state.chosen, "original"), field: "distance" }))),
      el("div", {}, el("h3", {}, "Reconstruction"), right.box, viewTools(right.view, () => `${facts[state.chosen].name} reconstruction`, () => ({ ...surfaceOf(state.chosen, "warped"), field: "distance" })))),
    ends,
    model.evaluation.joint_spaces?.length > 0 && el("div", {}, el("h3", {}, "Joint spaces"),
      el("p", { class: "soft" }, "The least distance between the surfaces of two parts, in the shapes themselves and as the particles rebuild them. The certificate names every rebuilt space that closes where the shape\u2019s own does not."), tableOfSpaces(model), el("p", {}, tellClosed(model))),
    el("div", { class: "pair" }, el("div", {}, figures, savesOf("surface distances", null, distanceRows), marks), el("div", {}, chart, savesOf("histogram of distances", () => chart))),
  );
  return { showParticles: () => {
    options.particles = true;
    [...body.querySelectorAll("input[type=checkbox]")].forEach((b) => (b.checked = true));
    render();
  } };
}

function distanceRows() {
  const keys = ["mean", "median", "p95", "p99", "max"], kinds = ["pull", "push"];
  return [["name", "two_way_mean", "two_way_p95", "two_way_max", ...kinds.flatMap((k) => keys.map((x) => `${k}_${x}`))],
    ...facts.map(({ name, surface: d }) => [name, d?.mean, d?.p95, d?.max, ...kinds.flatMap((k) => keys.map((x) => d?.[k]?.[x]))])];
}

// ---- quality ----

/** Name, scores, and what is known of every shape. */
function scoreRows() {
  const known = model.answers?.columns ?? [], K = model.variances.length, scores = modeBasis(model).scores;
  const cell = (c, i) => (c.values[i] === null ? "" : c.category ? c.levels[c.values[i]] : c.values[i]);
  return [["name", "verdict", ...known.map((c) => c.name), ...Array.from({ length: K }, (_, m) => `mode_${m + 1}`)],
    ...model.shapes.map((s, i) => [s.name, facts[i].certificate.verdict, ...known.map((c) => cell(c, i)), ...Array.from({ length: K }, (_, m) => scores(i, m))])];
}
function scoreTable() {
  const [head, ...rows] = scoreRows(), columns = Math.min(head.length, 2 + (model.answers?.columns.length ?? 0) + 6);
  let by = 0, down = false;
  const box = el("div");
  const order = (a, b) => {
    const x = a[by], y = b[by], less = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y), "en", { numeric: true });
    return down ? -less : less;
  };
  const draw = () => {
    const heads = head.slice(0, columns).map((t, k) => el("button", { type: "button", class: "link", "aria-label": `sort by ${t}`, onclick: () => { down = by === k && !down; by = k; draw(); } }, `${t}${k === by ? (down ? " \u25bc" : " \u25b2") : ""}`));
    box.replaceChildren(table(heads, [...rows].sort(order).map((r) => r.slice(0, columns).map((x) => (typeof x === "number" ? show(x) : x))),
      head.slice(0, columns).map((_, k) => k).filter((k) => typeof rows[0]?.[k] === "number")));
  };
  draw();
  return el("details", {}, el("summary", {}, `Scores of the shapes as a table (lengths in ${unitNote()})`),
    head.length > columns && el("p", { class: "soft small" }, `The first ${columns - 2 - (model.answers?.columns.length ?? 0)} modes are shown; the CSV has all ${model.variances.length}.`), savesOf("scores", null, scoreRows), box);
}

function fillQuality() {
  const body = byId("quality").querySelector(".body"), e = model.evaluation;
  const sd = model.variances.map(Math.sqrt), total = model.variances.reduce((a, b) => a + b, 0) || 1;
  const figure = (title, chart, text) => {
    const node = el("figure", { class: "chart" }, el("h3", {}, title), chart, el("p", {}, text));
    node.append(savesOf(title, () => node));
    return node;
  };
  const charts = el("div", { class: "charts" });
  const one = (key, title, yLabel, text, errors) =>
    e[key]?.length > 0 && charts.append(figure(title, curve({ title: `${title} by number of modes`, values: e[key], errors, yLabel }), text));
  one("compactness", "Compactness", "share of variance", "Share of the variance in the first modes; higher is better.");
  one("generalization", "Generalization", `distance, ${unitNote()}`, "Leave one out: mean distance of a shape\u2019s particles to their best fit by a model of the others; lower is better. Band: one standard error.", e.generalization_standard_error);
  one("specificity", "Specificity", `distance, ${unitNote()}`, `Mean distance of ${e.specificity_samples.toLocaleString("en")} random shapes of the model to the nearest real one; lower is better. Band: one standard error.`, e.specificity_standard_error);

  const plot = el("figure", { class: "chart" }), plotTools = el("div", { class: "tools" }), K = model.mean.modes.length;
  const draw = () => {
    const [p, q] = state.axes;
    plot.replaceChildren(
      el("h3", {}, "Shapes by their modes"),
      plotTools,
      scatter({
        title: `scores of mode ${p + 1} and mode ${q + 1}`, ring: 2, onpick: (i) => chooseShape(i),
        xLabel: `mode ${p + 1} (${percent(model.variances[p] / total)}), sd`, yLabel: `mode ${q + 1} (${percent(model.variances[q] / total)}), sd`,
        points: model.shapes.map((s, i) => {
          const x = s.scores[p] / sd[p], y = s.scores[q] / sd[q];
          return { index: i, name: shorts[i], x, y, title: `${s.name}: ${show(x)} sd, ${show(y)} sd`, chosen: i === state.chosen, always: i === state.chosen };
        }),
      }),
      el("p", {}, "Dashed: two standard deviations. Click a point to choose its shape; names that would overlap are left out."),
      savesOf("scores of modes", () => plot));
  };
  if (K >= 2) {
    charts.append(plot);
    refresh.shape.push(draw);
    const list = model.mean.modes.map((_, m) => [String(m), `mode ${m + 1}`]);
    plotTools.append(
      choice("Across", list, "0", (v) => { state.axes[0] = Number(v); draw(); }),
      choice("up", list, "1", (v) => { state.axes[1] = Number(v); draw(); }));
  }
  body.prepend(el("p", { class: "soft" }, `Distances are means over particles. By the definition \u201c${e.definition}\u201d, ${e.definition_text}.`));
  put(body, charts);
  const n = e.compactness.length, heads = ["compactness", "generalization", "generalization_standard_error", "specificity", "specificity_standard_error"];
  const figures = () => [["modes", ...heads], ...Array.from({ length: n }, (_, m) => [m + 1, ...heads.map((h) => e[h]?.[m])])];
  put(body, scoreTable(), el("details", {}, el("summary", {}, "The figures as a table"), savesOf("quality", null, figures),
    table(["modes", "compactness", "generalization", "standard error", "specificity", "standard error"],
      Array.from({ length: n }, (_, m) => [String(m + 1), show(e.compactness[m], 4), show(e.generalization[m]), show(e.generalization_standard_error[m], 2), show(e.specificity[m]), show(e.specificity_standard_error[m], 2)]),
      [0, 1, 2, 3, 4, 5])));
}

// ---- certificate ----

let fidelity = null;
function showParticle(i, j) {
  chooseShape(i, { go: true });
  fidelity.showParticles();
  state.pin = -1;
  state.hover = -1;
  pickParticle(j, "click");
  gl.face([...normalsOf(i).slice(3 * j, 3 * j + 3)]);
}
function trouble(c) {
  return [
    ["lost neighbours", c.lost?.map((j) => [j, String(j)])],
    ["stretched", c["mismatched_1.5_2.0"]?.filter((j) => !c.lost?.includes(j)).map((j) => [j, String(j)])],
    ["swapped", c.swaps?.map((s) => [s[0], s.join("\u2194")])],
    ["folded", c.folds?.map((f) => [f[0], f.join("-")])],
    ["slipped", c.judged?.slipped?.map((j) => [j, String(j)])],
    ["unlike the others", c.judged?.unlike?.map((j) => [j, String(j)])],
    ["surface beyond", c.judged?.beyond?.map((j) => [j, String(j)])],
    ["on the other side", c.judged?.opposed?.map((j) => [j, String(j)])],
  ].filter(([, list]) => list?.length > 0);
}
function showTrouble(i) {
  const first = trouble(facts[i].certificate)[0]?.[1][0][0];
  if (first === undefined) chooseShape(i, { go: true });
  else showParticle(i, first);
}
function places(i, c) {
  const links = (list) => list.map(([j, text]) => el("button", { type: "button", class: "link", title: `show particle ${j} on ${facts[i].name}`, onclick: () => showParticle(i, j) }, text));
  return trouble(c).map(([word, list]) => el("div", {}, `${word}: `, links(list.slice(0, 8)),
    list.length > 8 && el("details", {}, el("summary", { class: "small" }, `${list.length - 8} more`), links(list.slice(8)))));
}

function fillCertificate() {
  const body = byId("certificate").querySelector(".body"), c = model.certificate, limits = c.thresholds ?? {};
  const order = facts.map((_, i) => i).sort((a, b) => Number(facts[a].fine) - Number(facts[b].fine) || facts[b].lost - facts[a].lost || facts[b].mismatched - facts[a].mismatched || a - b);
  const bad = facts.filter((f) => !f.fine).length;
  const list = (some) => table(["shape", "verdict", "lost neighbours", "stretched", "swaps", "folds", "off surface", "closest pair", "where and why"], some.map(row), [2, 3, 4, 5, 6, 7]);
  const row = (i) => {
    const f = facts[i], k = f.certificate;
    return [
      el("button", { type: "button", class: "link", onclick: () => chooseShape(i, { go: true }) }, f.name),
      el("span", { class: `badge ${f.fine ? "good" : "bad"}` }, f.fine ? "\u2713 certified" : `! ${k.verdict}`),
      `${f.lost} (${show((100 * f.lost) / model.J, 2)}\u00a0%)`, String(f.mismatched), String(k.swaps?.length ?? "\u2013"), String(k.folds?.length ?? "\u2013"),
      k.off_surface_max < 1e-6 ? "0" : show(k.off_surface_max, 2), show(k.min_separation, 2),
      el("div", {}, k.reasons?.length > 0 && el("div", {}, k.reasons.join("; ") + likely(k)), places(i, k)),
    ];
  };
  put(body,
    el("p", {}, `Certified: ${c.certified} of ${c.shapes}. In all: ${countsText()}. A shape is certified if its particles keep their neighbours (at most ${100 * (limits.mismatched_share ?? 0.02)}\u00a0% have lost one), none have changed places, no triangle of neighbours is turned over, and all lie on the surface and apart from each other; and if, compared with the other shapes, it lies as they do, is no mirror image, belongs to them in form and size, and no region has slipped or end was missed.`),
    ...kindsOfNotes().map(({ kind, notes }) => notes.length > 5
      ? el("details", { class: "soft" }, el("summary", {}, `${notes.length} shapes: ${kind}`), notes.map((n) => el("p", {}, `${n.shape}: ${n.text}`)))
      : notes.map((n) => el("p", { class: "soft" }, `${n.shape}: ${n.text}`))),
    el("details", { class: "soft" }, el("summary", {}, "What the columns mean"), el("p", {}, `Compared with the template ${c.template}. A particle has lost neighbours if one that is beside it on the template is far from it on the shape, along the surface: farther than twice the closest, and than ${show(limits.stretch ?? 1.75)} times their distance on the template. It is stretched if a neighbour within 1.5 times the spacing is farther than 2 times the spacing: a strong stretch looks like that, too, and does not cost the certificate. Lengths in the table are in units of the mean neighbour distance, ${length(c.h)}.`)),
    el("p", { class: "small screen" }, "Click a particle\u2019s number to see it on the shape."),
    savesOf("certificate", null, certificateRows),
    list(order.slice(0, Math.max(bad, 15))),
    order.length <= Math.max(bad, 15) ? "" : el("details", {}, el("summary", {}, `${order.length - Math.max(bad, 15)} more, certified`), list(order.slice(Math.max(bad, 15)))),
  );
}

const certificateRows = () => [["name", "verdict", "lost_neighbours", "stretched", "swaps", "folds", "off_surface_max", "min_separation", "reasons"],
  ...facts.map((f) => [f.name, f.certificate.verdict, f.lost, f.mismatched, f.certificate.swaps?.length, f.certificate.folds?.length, f.certificate.off_surface_max, f.certificate.min_separation, f.certificate.reasons?.join("; ")])];

// ---- a link to what is seen ----

let modesPart = null;
const linkState = () => ({
  pose: { ...gl.pose }, shape: model.shapes[state.chosen].name,
  modes: Object.fromEntries([...modesPart.weight].flatMap((b, m) => (b === 0 ? [] : [[m + 1, Number(b.toFixed(3))]]))),
  of: modesPart.of,
  part: [...document.querySelectorAll("main section:not([hidden])")].filter((s) => s.getBoundingClientRect().top < innerHeight / 2).pop()?.id,
});
function followLink(to) {
  const i = model.shapes.findIndex((s) => s.name === to.shape);
  if (to.of && modesPart.sets[to.of]) modesPart.use(to.of);
  for (const [m, b] of Object.entries(to.modes)) if (m >= 1 && m <= modesPart.weight.length) modesPart.setMode(m - 1, Math.min(Math.max(b, -SLIDER), SLIDER));
  gl.turn(to.pose);
  if (i >= 0) chooseShape(i);
  if (to.part && byId(to.part)) byId(to.part).scrollIntoView();
}

// ---- provenance ----

function fillProvenance() {
  const body = byId("provenance").querySelector(".body"), m = model.manifest, stages = Object.entries(m.stages ?? {});
  const seconds = (s) => (s >= 100 ? `${Math.round(s)}\u00a0s` : `${show(s)}\u00a0s`);
  const sum = (key) => stages.reduce((a, [, s]) => a + (s[key] ?? 0), 0);
  put(body,
    el("p", {}, `Made by apsm ${m.apsm}, seed ${m.options?.seed ?? "0"}, ${plural(m.inputs.length, "input")}.`),
    ...(m.cropped?.ends ?? []).map((e) => el("p", {}, `${e.cut} of ${m.inputs.length} shapes were cut off at one end, by the edge of an image perhaps. All are cropped there to what ${e.shortest}, the shortest, holds; shapes lose ${show(100 * m.cropped.mean_loss)}\u00a0% of their surface on average, ${m.cropped.loser} ${show(100 * m.cropped.most_loss)}\u00a0%.`)),
    stages.length > 0 && table(["step", "wall clock", "processor", "memory so far", "threads"],
      stages.map(([name, s]) => [name, seconds(s.wall_seconds), seconds(s.cpu_seconds), `${Math.round(s.peak_memory_mb)}\u00a0MB`, String(s.threads)])
        .concat([["together", seconds(sum("wall_seconds")), seconds(sum("cpu_seconds")), "", ""]]), [1, 2, 3, 4]),
    el("details", {}, el("summary", {}, `Options (${Object.keys(m.options ?? {}).length})`),
      table(["option", "value"], Object.entries(m.options ?? {}).map(([k, v]) => [el("code", {}, k), el("code", {}, /^-?\d+\.\d{9,}$/.test(v) ? String(Number(v)) : v)]))),
    el("details", {}, el("summary", {}, `Inputs (${m.inputs.length}) with SHA-256`),
      table(["name", "file", "bytes", "SHA-256"], m.inputs.map((f) => [f.name, f.path, f.bytes.toLocaleString("en"), el("code", {}, f.sha256 || "\u2013")]), [2])),
  );
}

// ---- light and dark, printing ----

function chooseTheme() {
  const dark = matchMedia("(prefers-color-scheme: dark)"), root = document.documentElement, button = byId("theme");
  let own = null;
  const apply = (theme) => {
    root.dataset.theme = theme;
    button.textContent = theme === "dark" ? "\u2600 Light" : "\u263e Dark";
    gl.invalidateAll();
  };
  button.addEventListener("click", () => apply((own = root.dataset.theme === "dark" ? "light" : "dark")));
  dark.addEventListener("change", () => own ?? apply(dark.matches ? "dark" : "light"));
  apply(dark.matches ? "dark" : "light");
  let before, opened;
  addEventListener("beforeprint", () => {
    before = root.dataset.theme;
    root.dataset.theme = "light";
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((d) => (d.open = true));
    gl.setPrinting(true);
  });
  addEventListener("afterprint", () => {
    opened.forEach((d) => (d.open = false));
    apply(before);
    gl.setPrinting(false);
  });
}

function problem(text) {
  byId("problem").textContent = text;
  byId("problem").hidden = false;
}

/** Where to look first. */
function worstShape() {
  const rank = (f) => (f.fine ? 0 : 1e9) + (Number.isFinite(f.mean) ? f.mean : 0);
  return facts.reduce((best, f, i) => (rank(f) > rank(facts[best]) ? i : best), 0);
}

/** The points farthest from c in many directions (a spiral on the sphere): enough to frame all. */
function hullOf(clouds, c) {
  const DIRECTIONS = 150, far = Array.from({ length: DIRECTIONS }, (_, k) => {
    const z = 1 - (2 * k + 1) / DIRECTIONS, r = Math.sqrt(1 - z * z), t = k * Math.PI * (3 - Math.sqrt(5));
    return { d: [r * Math.cos(t), r * Math.sin(t), z], most: -Infinity, p: null };
  });
  for (const X of clouds)
    for (let k = 0; k < X.length; k += 3)
      for (const f of far) {
        const h = X[k] * f.d[0] + X[k + 1] * f.d[1] + X[k + 2] * f.d[2];
        if (h > f.most) { f.most = h; f.p = [X[k] - c[0], X[k + 1] - c[1], X[k + 2] - c[2]]; }
      }
  return far.map((f) => f.p);
}

/** Where all shapes lie, so that every view has the same scale. */
function setStage() {
  const clouds = [model.array(model.mean.vertices, "positions"), ...model.shapes.map((_, i) => particlesOf(i))];
  const { centre, radius, yaw } = stageOf(model.array(model.mean.particles, "positions"), clouds);
  gl.setStage(centre, radius, yaw, hullOf(clouds, centre), model.axes);
  return radius;
}

/** A page of new shapes: data of the class Fits or Norms. */
function startShapes(data, V0, fillPage) {
  byId("link").hidden = true;
  const clouds = [V0, ...data.clouds()], stage = stageOf(V0, clouds);
  gl.setStage(stage.centre, stage.radius, stage.yaw, hullOf(clouds, stage.centre));
  tryGraphics();
  const page = fillPage(data, { radius: 0.02 * stage.radius });
  window.apsmReport = { model: data, ...page, pose: gl.pose, idle: gl.idle };
  document.documentElement.dataset.ready = "yes";
}

function tryGraphics() {
  try {
    gl.startGraphics();
  } catch (error) {
    problem("This browser cannot draw in three dimensions (no WebGL); figures and tables are complete all the same.");
  }
}

function startContours(page) {
  window.apsmReport = { model: page, ...fillContours(page), idle: () => true };
  document.documentElement.dataset.ready = "yes";
}

async function start() {
  chooseTheme();
  const page = await readPage(byId("data").textContent, { "apsm-report": Model, "apsm-fits": Fits, "apsm-norms": Norms, "apsm-contours": Contours });
  byId("data").remove();
  if (page instanceof Fits) return startShapes(page, page.V0, fillFits);
  if (page instanceof Contours) return startContours(page);
  if (page instanceof Norms) return startShapes(page, page.surfaces(0).expected, fillNorms);
  model = page;
  setUnit(model.unit ?? null);
  const reach = setStage();
  radius = Math.min(0.15 * (model.certificate.h || reach), 0.03 * reach);
  tint = particleColours(model.array(model.colours, "integers"));
  shorts = shortNames(model.shapes.map((s) => s.name));
  facts = gatherFacts();
  partOfParticle = partsOfParticles(model);
  fields = fieldsOf(model);
  tryGraphics();
  fillHeader();
  const parts = fillParts(model);
  const modes = (modesPart = fillModes());
  const tiles = fillCohort(findOutliers());
  fidelity = fillFidelity();
  fillCompare(model, { makeView, viewTools, legend, surfaceGeometry: meanGeometry, surfaceOf, facts, basis: modeBasis(model) });
  fillQuality();
  fillAnswers(model, { makeView, legend, shorts, choose: (i) => chooseShape(i, { go: true }), surfaceGeometry: meanGeometry });
  fillCertificate();
  fillProvenance();
  chooseShape(worstShape());
  const link = readLink();
  if (link) followLink(link);
  // The browser went to #section before the page had its height.
  else if (/^#[a-z]+$/.test(location.hash)) document.querySelector(location.hash)?.scrollIntoView();
  addEventListener("keydown", (e) => {
    if (e.target.closest?.("input, select, button, summary") || e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.key === "n" || e.key === "p") chooseShape((state.chosen + (e.key === "n" ? 1 : -1) + model.I) % model.I);
    if (e.key === "," || e.key === ".") stepParticle(e.key === "." ? 1 : -1);
    if (e.key === "Escape") { state.hover = -1; if (state.pin >= 0) pickParticle(state.pin, "click"); }
  });
  window.apsmReport = { model, state, pose: gl.pose, modes, tiles, parts, idle: gl.idle }; // for tests and the curious
  document.documentElement.dataset.ready = "yes";
}

start().catch((error) => {
  byId("summary").textContent = "";
  problem(`The model cannot be shown: ${error.message}`);
});
