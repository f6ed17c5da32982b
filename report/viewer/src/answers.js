// What tests have found: sentences, tables, maps on the mean surface, and the scores coloured by what is
// known of the subjects.  All figures come from the results of `apsm test`; nothing is tested here.
import { byId, checkbox, choice, el, percent, plural, show, svg, table } from "./dom.js";
import { vertexNormals } from "./data.js";
import { colourAt, cssGradient, palettes } from "./colors.js";
import { agreement, colourScatter, regressions } from "./charts.js";
import { saveButton, saveSvg } from "./save.js";
import { weightsAt } from "./surface.js";

const GROUPS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a1f1f", "#5b3a8c"];
const pText = (p) => (p < 1e-3 ? p.toExponential(1).replace("-", "\u2212") : show(p, 2));

// ---- one test ----

const correction = { p_familywise: "family-wise", p_cluster: "by clusters", q: "false discovery rate", p_uncorrected: "uncorrected" };

// Names that need no backquotes have them for the program's sake.
const plain = (t) => t.formula.replaceAll("`", "");
const unitOf = (t) => (!t.title ? "subjects" : t.title.startsWith("Directional") ? "sides of subjects" : "shapes");
const heading = (t) => `${t.title ? `${t.title}: ` : ""}${t.of} on ${t.on}`;

function sentence(t) {
  const what = { form: "form (shape and size)", shape: "shape (size taken out)", size: "size", modes: "the modes taken together" }[t.on] ?? t.on;
  const share = `p = ${pText(t.p)}, ${percent(t.share_of_variance)} of the variance that the other terms leave.`;
  if (t.title) return `${t.title} of ${what} is ${t.p <= 0.05 ? "" : "not "}shown: ${share}`;
  const strength = t.p <= 0.05 ? "goes with" : "is not shown to go with";
  const verb = t.on === "modes" ? strength.replace("goes", "go").replace("is not", "are not") : strength;
  return `${what[0].toUpperCase()}${what.slice(1)} ${verb} ${t.of}: ${share}`;
}
const orders = (t) => {
  const n = t.permutations.toLocaleString("en");
  const early = t.stopping?.early ? `, more being stopped when every conclusion at 5 % was known with a risk of ${t.stopping.risk} (confidence sequences)` : "";
  if (t.variances === "unequal") return `${n} random draws of the signs of what the other terms leave, since groups may vary by different amounts${early}`;
  return t.exact ? `all ${n} permutations of the subjects` : `${n} random permutations of the subjects${early}`;
};

function methods(t) {
  const many = t.statistic.length > 1, particles = t.p_cluster !== undefined;
  const [word, ...rest] = t.on_text.split(": "), on = `${t.on === "column" || !rest.length || word === "column" ? t.on : word} (${rest.join(": ")})`;
  return `${t.title ? `${t.title} of ${on}` : `The effect of ${t.of} on ${on}`} was tested in ${t.subjects} ${unitOf(t)} with the linear model ${plain(t)}` +
    `${t.within ? `, within ${t.within},` : ""} by permutation (Freedman and Lane), with ${orders(t)}` +
    `${t.exact ? "" : ` (standard error of p ${show(t.p_standard_error, 2)})`}. ` +
    "All variables together were tested by the ratio of explained to residual sums of squares. " +
    (particles ? "Single particles were tested by Lawley and Hotelling\u2019s trace of their three coordinates, " : many ? "Single variables were tested by the same ratio, " : "") +
    (many ? "corrected for their number by the largest of all (family-wise) and by Benjamini and Hochberg\u2019s false discovery rate" : "") +
    (particles ? ", and with threshold-free cluster enhancement over the graph of the six nearest particles" : "") + (many ? ". " : "") +
    (t.effects[0]?.low ? "Bands of effects are 95 % percentile bootstrap intervals. " : "") +
    (t.classification ? `Groups were told apart with ${t.classification.folds}-fold cross-validation, all steps within the folds, and DeLong\u2019s interval. ` : "") +
    (t.left_out.length ? `${plural(t.left_out.length, "subject")} with unknown values ${t.left_out.length === 1 ? "was" : "were"} left out. ` : "") +
    "Computed with apsm.";
}

function copyButton(text, label = "Copy") {
  const button = el("button", { type: "button", onclick: async () => {
    try {
      await navigator.clipboard.writeText(text());
      button.textContent = "Copied";
    } catch (error) {
      button.textContent = "The browser does not allow copying: select the text and copy it by hand";
    }
    setTimeout(() => (button.textContent = label), 2500);
  } }, label);
  return button;
}

function figuresOf(t) {
  const rows = [["p, all together", pText(t.p)], ["share of variance", percent(t.share_of_variance)], [unitOf(t), String(t.subjects)],
    [t.variances === "unequal" ? "draws of signs" : "permutations", `${t.permutations.toLocaleString("en")}${t.exact ? ", all" : t.stopping?.early ? ", ended early" : ""}`]];
  if (t.variance_ratio) rows.push(["variance of the groups, largest to smallest", show(t.variance_ratio, 2)]);
  const unit = t.p_cluster ? "particles" : "variables";
  if (t.statistic.length > 1)
    for (const [key, word] of Object.entries(correction))
      if (t[key]) rows.push([`${unit} at 5 %, ${word}`, `${t[key].filter((p) => p <= 0.05).length} of ${t[key].length}`]);
  const c = t.classification, d = t.detectable;
  if (c) rows.push(["area under the ROC curve", `${show(c.auc, 2)} (95 %: ${show(c.auc_low, 2)} to ${show(c.auc_high, 2)})`]);
  if (d) rows.push(["shift found 4 times in 5", `${show(d.one_variable, 2)} sd of one variable, ${show(d.any_of_all, 2)} of any`]);
  if (t.statistic.length === 1 && t.effects.length)
    for (const e of t.effects)
      rows.push([e.name, `${show(e.along_normal[0])}${e.low ? ` (95 %: ${show(e.low[0])} to ${show(e.high[0])})` : ""}`]);
  return rows;
}

/** The mean surface with a test's map on it, and a slider from group to group. */
function mapOf(t, stage) {
  const { V0, F, N0, at, tools } = stage;
  const V = V0.slice(), N = N0.slice(), value = new Float32Array(V.length / 3), D = new Float32Array(V.length), one = new Float32Array(V.length / 3);
  const surface = tools.surfaceGeometry(V, F, N, value);
  const { view, box } = tools.makeView(`mean surface with the effect of ${t.of}`);
  const some = t.effects.length > 0;
  const state = { effect: 0, what: some ? "along" : "share", by: t.p_cluster ? "p_cluster" : "p_familywise", limit: 1, amount: 0 };
  const key = el("div"), told = el("p", { class: "small soft", "aria-live": "polite" }), ends = el("span", { class: "value" });
  const difference = some && / minus /.test(t.effects[0].name) && !/mean of all/.test(t.effects[0].name);
  const signedOf = (e) => e.along_normal, maps = {
    ...(some && { along: ["effect along the normal", signedOf, "signed"], standardised: ["effect in standard deviations", (e) => e.standardised, "heat"] }),
    share: ["share of variance", () => t.share, "heat"], p: ["\u2212log10 p", () => t[state.by].map((p) => -Math.log10(Math.max(p, 1e-12))), "heat"],
  };
  const draw = () => {
    const e = t.effects[state.effect], [word, values, palette] = maps[state.what], x = values(e), p = t[state.by];
    at.spread(x, 1, one);
    let most = 0, kept = 0;
    for (const v of x) most = Math.max(most, Math.abs(v));
    most = most || 1;
    for (let v = 0; v < one.length; v++) value[v] = p[at.nearest(v)] <= state.limit ? one[v] : 0;
    kept = p.filter((q) => q <= state.limit).length;
    if (e) at.spread(e.effect.flat(), 3, D);
    for (let k = 0; k < V.length; k++) V[k] = V0[k] + state.amount * D[k];
    vertexNormals(V, F, N);
    for (const name of ["position", "normal", "value"]) surface.getAttribute(name).needsUpdate = true;
    view.set({ surface, particles: null, palette, range: palette === "signed" ? [-most, most] : [0, most] });
    key.replaceChildren(tools.legend(palette, palette === "signed" ? [`\u2212${show(most)} inward`, "0", `+${show(most)} outward`] : ["0", word, show(most)]));
    told.textContent = state.limit >= 1 ? `All ${p.length} particles are coloured.` : `${kept} of ${p.length} particles have p \u2264 ${show(state.limit, 2)} (${correction[state.by]}); elsewhere the surface is plain.`;
    const [a, b] = difference ? e.name.split(" minus ") : ["", ""];
    ends.textContent = difference ? (Math.abs(state.amount) < 0.01 ? "between both" : state.amount === 0.5 ? `mean of ${a}` : state.amount === -0.5 ? `mean of ${b}` : `${show(2 * Math.abs(state.amount), 2)} \u00d7 towards ${state.amount > 0 ? a : b}`)
      : state.amount === 0 ? "the mean itself" : `${state.amount < 0 ? "\u2212" : "+"}${show(Math.abs(state.amount), 2)} \u00d7 the effect`;
  };
  const limit = el("input", { type: "range", min: -4, max: 0, step: 0.01, value: 0, "aria-label": "threshold of p", oninput: () => { state.limit = Number(limit.value) >= 0 ? 1 : 10 ** Number(limit.value); draw(); } });
  const reach = difference ? 2 : Math.max(1, Math.abs(stage.scaleOf(t)));
  const amount = el("input", { type: "range", min: -reach, max: reach, step: reach / 200, value: 0, "aria-label": "along the effect", oninput: () => { state.amount = Number(amount.value); if (difference && Math.abs(Math.abs(state.amount) - 0.5) < 0.03) state.amount = Math.sign(state.amount) / 2; draw(); } });
  const only = (keys) => keys.filter((k) => t[k]).map((k) => [k, correction[k]]);
  const node = el("div", { class: "split" },
    el("div", { class: "main" }, box, key, told),
    el("div", {},
      el("div", { class: "tools" },
        t.effects.length > 1 && choice("Effect", t.effects.map((e, k) => [String(k), e.name]), "0", (v) => { state.effect = Number(v); draw(); }),
        choice("Colour", Object.entries(maps).map(([k, m]) => [k, m[0]]), state.what, (v) => { state.what = v; draw(); }),
        choice("p", only(["p_cluster", "p_familywise", "q", "p_uncorrected"]), state.by, (v) => { state.by = v; draw(); }),
        el("button", { type: "button", onclick: () => { limit.value = Math.log10(0.05); state.limit = 0.05; draw(); } }, "Only p \u2264 0.05"),
        el("button", { type: "button", onclick: () => { limit.value = 0; state.limit = 1; draw(); } }, "All")),
      el("label", { class: "stack" }, "Threshold of p: from 0.0001 to all", limit),
      some && el("label", { class: "stack" }, difference ? `From ${t.effects[0].name.split(" minus ")[1]} to ${t.effects[0].name.split(" minus ")[0]}: ` : "Mean surface along the effect: ", ends, amount),
      difference && el("div", { class: "tools" }, [[-0.5, t.effects[0].name.split(" minus ")[1]], [0, "between"], [0.5, t.effects[0].name.split(" minus ")[0]]].map(([s, word]) =>
        el("button", { type: "button", onclick: () => { amount.value = s; state.amount = s; draw(); } }, word))),
      stage.tableOf(t)));
  draw();
  return { node, state, draw };
}

function showTest(t, stage) {
  const mapped = t.p_cluster !== undefined && t.share.length === stage.J;
  const tableOf = () => el("div", {}, table(["figure", "value"], figuresOf(t)), copyButton(() => figuresOf(t).map((r) => r.join("\t")).join("\n"), "Copy the table"));
  const map = mapped ? mapOf(t, { ...stage, tableOf }) : null;
  const modes = !mapped && t.statistic.length > 1 && el("details", {}, el("summary", {}, `Every mode (${t.statistic.length})`),
    table(["mode", "p", "p family-wise", "q", "share of variance"], t.statistic.map((_, k) => [String(k + 1), pText(t.p_uncorrected[k]), pText(t.p_familywise[k]), pText(t.q[k]), percent(t.share[k])]), [0, 1, 2, 3, 4]));
  return el("article", { class: "test" }, el("h3", {}, `${heading(t)}: ${plain(t)}`), el("p", {}, sentence(t)),
    t.not_certified.length > 0 && el("p", { class: "problem" }, `Not certified among the subjects: ${t.not_certified.slice(0, 8).join(", ")}${t.not_certified.length > 8 ? " and more" : ""}. Look at these shapes before you trust the result.`),
    t.left_out.length > 0 && el("p", { class: "soft" }, `Left out for unknown values: ${t.left_out.slice(0, 8).join(", ")}${t.left_out.length > 8 ? ` and ${t.left_out.length - 8} more` : ""}.`),
    map ? map.node : tableOf(), modes,
    el("details", {}, el("summary", {}, "Methods, for the manuscript"), el("p", {}, methods(t)), copyButton(() => methods(t), "Copy the text")));
}

// ---- left and right ----

const sources = { individuals: "subjects differ", directional: "sides differ, in all alike", fluctuating: "sides differ, in each in its own way", error: "measured again" };

function showAsymmetry(a) {
  const rows = a.sources.map((s) => [sources[s.source] ?? s.source, show(s.degrees_of_freedom), show(s.sum_of_squares), show(s.mean_square), show(s.f), s.p === null ? "\u2013" : pText(s.p)]);
  const head = ["source", "df", "sum of squares", "mean square", "F", "p"];
  return el("article", { class: "test" }, el("h3", {}, `Asymmetry of ${a.on}: ${a.sides.join(" against ")}`),
    el("p", {}, `${plural(a.subjects, "subject")}, ${plural(a.shapes, "shape")}. Directional asymmetry is tested against fluctuating, that against error; degrees of freedom are those of one number.` +
      (a.sources.some((s) => s.source === "fluctuating" && s.p !== null) ? "" : " Sides were not measured repeatedly, so that fluctuating asymmetry holds the error of measurement and is not tested.")),
    table(head, rows, [1, 2, 3, 4, 5]), copyButton(() => [head, ...rows].map((r) => r.join("\t")).join("\n"), "Copy the table"));
}

// ---- what shape tells of a column ----

function tellPrediction(p) {
  const [low, high] = p.share_interval;
  if (p.levels.length) return `Shape separates ${p.levels[1]} from ${p.levels[0]} with an area under the ROC curve of ${show(p.auc, 2)}.`;
  if (p.share_explained <= 0) return `Not shown to be predictable: shape tells ${p.of} no better than its mean does (left out, ${percent(p.share_explained)} of the variance; 95 %: ${percent(low)} to ${percent(high)}).`;
  return `${low > 0 ? "" : "Not shown to be predictable: "}${percent(p.share_explained)} of the variance of ${p.of} (95 %: ${percent(low)} to ${percent(high)}) is predicted by shape, with a mean error of ${show(p.mean_absolute_error)}.`;
}

/** The mean surface as the column changes. */
function sliderOf(p, stage) {
  const { V0, F, N0, at, tools } = stage, V = V0.slice(), N = N0.slice(), value = new Float32Array(V.length / 3), D = new Float32Array(V.length);
  at.spread(p.pattern.flat(), 3, D);
  const known = p.per_subject.map((s) => (p.levels.length ? p.levels.indexOf(s.value) : s.value));
  const lo = Math.min(...known), hi = Math.max(...known), surface = tools.surfaceGeometry(V, F, N, value);
  const { view, box } = tools.makeView(`mean surface for values of ${p.of}`), text = el("span", { class: "value" });
  let reach = 0;
  for (let k = 0; k < V.length; k += 3) {
    const along = D[k] * N0[k] + D[k + 1] * N0[k + 1] + D[k + 2] * N0[k + 2];
    reach = Math.max(reach, Math.abs(along) * Math.max(hi - p.mean, p.mean - lo));
  }
  reach = reach || 1;
  const draw = () => {
    const y = Number(slider.value) - p.mean;
    for (let k = 0; k < V.length; k++) V[k] = V0[k] + y * D[k];
    for (let k = 0; k < V.length; k += 3) value[k / 3] = y * (D[k] * N0[k] + D[k + 1] * N0[k + 1] + D[k + 2] * N0[k + 2]);
    vertexNormals(V, F, N);
    for (const name of ["position", "normal", "value"]) surface.getAttribute(name).needsUpdate = true;
    view.set({ surface, particles: null, palette: "signed", range: [-reach, reach] });
    text.textContent = p.levels.length ? `${p.levels[0]} \u2194 ${p.levels[1]}` : show(Number(slider.value));
  };
  const slider = el("input", { type: "range", min: lo, max: hi, step: (hi - lo) / 200, value: p.mean, "aria-label": p.of, oninput: draw });
  draw();
  return { box: el("div", { class: "main" }, box, tools.legend("signed", [`\u2212${show(reach)} inward`, "0", `+${show(reach)} outward`])),
    control: el("label", { class: "stack" }, `The expected shape: ${p.of} `, text, slider) };
}

function showPrediction(p, stage) {
  const rows = [["subjects", String(p.subjects)], ["variance predicted, left out", `${percent(p.share_explained)} (95 %: ${percent(p.share_interval[0])} to ${percent(p.share_interval[1])})`],
    p.levels.length ? ["area under the ROC curve", show(p.auc, 2)] : ["mean error", show(p.mean_absolute_error)],
    p.half_width === null || p.levels.length ? null : ["95 % interval of a new shape", `\u00b1${show(p.half_width)}`]].filter(Boolean);
  const map = p.pattern.length === stage.J && stage.at ? sliderOf(p, stage) : null;
  const plot = p.levels.length ? null : el("figure", { class: "chart" },
    agreement({ title: `${p.of}: known and predicted`, onpick: stage.tools.choose, xLabel: p.of, yLabel: `${p.of} from shape, left out`,
      points: p.per_subject.map((s) => ({ index: stage.indexOf(s.name), x: s.value, y: s.predicted, title: `${s.name}: ${show(s.value)}, from shape ${show(s.predicted)}` })) }));
  return el("article", { class: "test" }, el("h3", {}, `${p.of} from shape`), el("p", {}, tellPrediction(p)),
    p.not_certified.length > 0 && el("p", { class: "problem" }, `Not certified among the subjects: ${p.not_certified.slice(0, 8).join(", ")}${p.not_certified.length > 8 ? " and more" : ""}. Look at these shapes before you trust the result.`),
    el("div", { class: "split" }, map ? map.box : el("div", {}), el("div", {}, map && map.control, table(["figure", "value"], rows), plot)),
    p.new.length > 0 && table(["new shape", p.of, "95 %"], p.new.map((s) => [s.name, p.levels.length ? `${s.value} (${show(s.predicted, 2)})` : show(s.predicted), p.levels.length || s.interval[0] === null ? "\u2013" : `${show(s.interval[0])} to ${show(s.interval[1])}`]), [1]));
}

// ---- scores by columns ----

function showScores(model, columns, tools, tested) {
  const K = model.mean.modes.length, sd = model.variances.map(Math.sqrt), total = model.variances.reduce((a, b) => a + b, 0) || 1;
  if (K < 2 || columns.length === 0) return null;
  const first = Math.max(0, columns.findIndex((c) => c.name === tested), tested ? -1 : columns.findIndex((c) => c.name !== "mirrored"));
  const state = { column: first, p: 0, q: 1, ellipses: true, line: false }, plot = el("figure", { class: "chart wide" });
  const draw = () => {
    const c = columns[state.column], { p, q } = state, known = c.values.filter((v) => v !== null);
    const lo = Math.min(...known), hi = Math.max(...known);
    const css = (v) => `rgb(${colourAt(palettes.heat, 0.15 + (0.75 * (v - lo)) / (hi - lo || 1)).map(Math.round).join(" ")})`;
    const colour = (v) => (v === null ? "transparent" : c.category ? GROUPS[v % GROUPS.length] : css(v));
    const across = axes[p], up = axes[q], points = model.shapes.flatMap((s, i) => (across.at(i) === null || up.at(i) === null ? [] : [{
      index: i, name: tools.shorts[i], x: across.at(i), y: up.at(i), colour: colour(c.values[i]), group: c.category ? c.values[i] : null,
      title: `${s.name}: ${c.name} ${c.values[i] === null ? "unknown" : c.category ? c.levels[c.values[i]] : show(c.values[i])}`, chosen: false, always: false,
    }]));
    plot.replaceChildren(el("h4", {}, `Scores, coloured by ${c.name}`), el("div", { class: "split even" }, el("div", {},
      colourScatter({ title: `${across.name} and ${up.name} by ${c.name}`, ring: 2, onpick: tools.choose, points, ellipses: state.ellipses && c.category,
        lines: state.line ? (c.category ? "groups" : "all") : null, xLabel: across.name, yLabel: up.name })), el("div", {},
      c.category
        ? el("p", { class: "keys" }, c.levels.map((word, k) => [el("span", { class: "key", style: `background:${GROUPS[k % GROUPS.length]}` }), ` ${word} (${c.values.filter((v) => v === k).length})  `]))
        : el("div", { class: "legend" }, Object.assign(el("div", { class: "strip" }), { style: `background:${cssGradient(palettes.heat)}` }), el("div", { class: "ends" }, el("span", {}, show(lo)), el("span", {}, c.name), el("span", {}, show(hi)))),
      ...(state.line ? [el("p", {}, "Lines of least squares: ", regressions(points, c.category).map((r) => `${r.group === null ? "all shapes" : c.levels[r.group]} ${show(r.slope)} sd up for 1 across, r = ${show(r.r, 2)} (${r.n})`).join("; "), ".")] : []),
      el("p", {}, `${c.category ? "Ellipses: where 95 % of a group's shapes are expected (normal distribution, three shapes at least). " : ""}${c.values.some((v) => v === null) ? "Empty circles: unknown. " : ""}Dashed: two standard deviations of all.`),
      el("p", { class: "saves screen" }, saveButton("SVG", "this plot", () => saveSvg(`scores_${p + 1}_${q + 1}`, plot.querySelector("svg")))))));
  };
  // Modes, and columns of numbers, all in standard deviations.
  const numeric = columns.filter((c) => !c.category);
  const axes = [
    ...model.mean.modes.map((_, m) => ({ name: `mode ${m + 1} (${percent(model.variances[m] / total)}), sd`, at: (i) => model.shapes[i].scores[m] / sd[m] })),
    ...numeric.map((c) => {
      const known = c.values.filter((v) => v !== null), mean = known.reduce((a, v) => a + v, 0) / known.length;
      const spread = Math.sqrt(known.reduce((a, v) => a + (v - mean) ** 2, 0) / (known.length - 1)) || 1;
      return { name: `${c.name} (mean ${show(mean)}, sd ${show(spread)}), sd`, at: (i) => (c.values[i] === null ? null : (c.values[i] - mean) / spread) };
    }),
  ];
  const modes = [...model.mean.modes.map((_, m) => `mode ${m + 1}`), ...numeric.map((c) => c.name)].map((word, k) => [String(k), word]);
  draw();
  return el("article", { class: "test" },
    el("div", { class: "tools" },
      choice("Colour by", columns.map((c, k) => [String(k), c.name]), String(first), (v) => { state.column = Number(v); draw(); }),
      choice("across", modes, "0", (v) => { state.p = Number(v); draw(); }), choice("up", modes, "1", (v) => { state.q = Number(v); draw(); }),
      checkbox("Ellipses", true, (on) => { state.ellipses = on; draw(); }), checkbox("Regression lines", false, (on) => { state.line = on; draw(); })), plot);
}

/** Fills the section if there is something to tell; tools are main.js's. */
export function fillAnswers(model, tools) {
  const section = byId("answers"), answers = model.answers;
  const columns = (answers?.columns ?? []).filter((c) => c.values.some((v) => v !== null) && !(c.category && c.levels.length < 2));
  const predictions = answers?.predictions ?? [], asymmetries = answers?.asymmetries ?? [];
  if (!answers || (answers.tests.length === 0 && asymmetries.length === 0 && columns.length === 0 && predictions.length === 0)) {
    section.hidden = true;
    document.querySelector('nav a[href="#answers"]').hidden = true;
    return;
  }
  const V0 = model.array(model.mean.vertices, "positions"), F = model.array(model.mean.faces, "integers"), P0 = model.array(model.mean.particles, "positions");
  const scaleOf = (t) => {
    const values = columns.find((c) => c.name === t.of && !c.category)?.values.filter((v) => v !== null);
    return values ? 2 * Math.max(...values.map((v) => Math.abs(v - values.reduce((a, b) => a + b, 0) / values.length))) : 1;
  };
  let at = null;
  const body = section.querySelector(".body");
  body.append(el("p", { class: "soft" }, answers.tests.length > 0
    ? "What apsm test found in this model. Begin with the p of all particles together: if that is large, do not go looking among single particles."
    : "What is known about the subjects. apsm test asks whether shape is related to it."));
  if (answers.tests.some((t) => t.p_cluster) || predictions.length > 0) at = weightsAt(V0, P0);
  const stage = { V0, F, N0: vertexNormals(V0, F), at, tools, J: model.J, scaleOf, indexOf: (name) => model.shapes.findIndex((s) => s.name === name) };
  // What has a map comes first; all but the first test are folded.
  const rank = (t) => (t.p_cluster ? 0 : 1);
  const tests = [...answers.tests].sort((a, b) => rank(a) - rank(b));
  const nodes = [];
  tests.forEach((t, k) => {
    if (k === 0) return nodes.push(showTest(t, stage));
    const fold = el("details", { ontoggle: () => { if (fold.open && fold.children.length === 1) fold.append(showTest(t, stage)); } },
      el("summary", {}, `${heading(t)}: p = ${pText(t.p)} (${plain(t)})`));
    nodes.push(fold);
  });
  predictions.forEach((p, k) => {
    if (k === 0 && tests.length === 0) return nodes.push(showPrediction(p, stage));
    const fold = el("details", { ontoggle: () => { if (fold.open && fold.children.length === 1) fold.append(showPrediction(p, stage)); } },
      el("summary", {}, `${p.of} from shape: ${p.levels.length ? `area under the ROC curve ${show(p.auc, 2)}` : p.share_explained > 0 ? `${percent(p.share_explained)} of its variance` : "no better than the mean"}`));
    nodes.push(fold);
  });
  body.append(...nodes);
  body.append(...asymmetries.map(showAsymmetry));
  const scores = showScores(model, columns, tools, tests.map((t) => t.of).find((of) => columns.some((c) => c.name === of)));
  if (scores) body.append(scores);
}
