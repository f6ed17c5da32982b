// The report in headless Chromium, offline from a file: it loads, draws, reacts, and asks for nothing.
//   node test_report.mjs APSM CHROMIUM [FOLDER for screenshots]
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";
import { NAMES, writeCohort, writeJoints } from "./cohort.mjs";

const [apsm, browserPath, pictures] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "apsm-report-"));
const model = join(folder, "model \u2018<i>\u2019 & co");
const run = (...words) => execFileSync(apsm, words, { stdio: ["ignore", "ignore", "inherit"] });

// ---- a model, with one shape that needs review ----

const HARM = "</script><script>window.harmed = 1</script><!--";

function makeModel() {
  const inputs = join(folder, "in");
  mkdirSync(inputs);
  writeCohort(inputs);
  run("run", inputs, "-o", model, "-J", "48", "--faces", "1500", "--stage1-epochs", "6", "--stage2-epochs", "4", "--unit", "cm", "-q");
  const first = statSync(join(model, "report.html"));
  assert.ok(first.size > 100e3 && first.size < 2e6, `size of the page at the end of run: ${first.size}`);
  const path = join(model, "certificate.json"), c = JSON.parse(readFileSync(path, "utf8"));
  for (const shape of c.per_shape)
    Object.assign(shape, { verdict: "certified", reasons: [], swaps: [], folds: [], lost: [], "mismatched_1.5_2.0": [] });
  Object.assign(c.per_shape[2], { verdict: "needs review", reasons: [HARM, "particles have changed places"], swaps: [[7, 11]] });
  c.per_shape[3]["mismatched_1.5_2.0"] = [5];
  c.per_shape[3].lost = [5];
  Object.assign(c, { verdict: "needs review", certified: 7 });
  writeFileSync(path, JSON.stringify(c));
  // A table whose texts are as strange as the names, and a test by it.
  const table = join(folder, "table.csv"), quoted = (text) => `"${text.replaceAll('"', '""')}"`;
  const names = JSON.parse(readFileSync(join(model, "project.swproj"), "utf8")).data.map((row) => row.name);
  writeFileSync(table, ["name,side,age", ...names.map((n, i) => `${quoted(n)},${quoted(i % 2 ? "left" : HARM)},${20 + ((i * 5) % 7)}`)].join("\n"));
  run("test", model, "--subjects", table, "--formula", "~ side + age", "--permutations", "200", "--bootstraps", "50", "-q");
  const before = readFileSync(join(model, "report.html"));
  run("report", model, "-q", "--threads", "1");
  assert.ok(before.equals(readFileSync(join(model, "report.html"))), "the page depends on threads");
}

// ---- the browser ----

const complaints = [];
async function open(browser, options = {}, folderOfPage = model, file = "report.html") {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, offline: true, ...options });
  const page = await context.newPage();
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && complaints.push(`console: ${m.text()}`));
  page.on("pageerror", (e) => complaints.push(`page: ${e.message}`));
  page.on("dialog", (d) => (complaints.push(`dialog: ${d.message()}`), d.dismiss()));
  page.on("request", (r) => /^(file|data|blob):/.test(r.url()) || complaints.push(`request: ${r.url()}`));
  await page.goto(pathToFileURL(join(folderOfPage, file)).href);
  await page.waitForFunction(() => document.documentElement.dataset.ready === "yes");
  await settle(page);
  const slips = (await page.evaluate(() => document.body.innerText)).match(/.{0,30}(undefined|\bNaN\b|\[object ).{0,30}|^\s*(true|false|null)\s*$/gm);
  if (slips) complaints.push(`text: ${slips.join(" | ")}`);
  return page;
}
const settle = (page) => page.waitForFunction(() => apsmReport.idle(), null, { timeout: 30000 });

async function show(page, selector) {
  await page.evaluate((s) => document.querySelector(s).scrollIntoView({ block: "center", behavior: "instant" }), selector);
  await page.waitForTimeout(150);
  await settle(page);
}

/** What a canvas shows: share of drawn pixels, a sum to compare, their colours' variety. */
const look = (page, selector) =>
  page.evaluate((s) => {
    const canvas = document.querySelector(s);
    if (canvas.width === 0) return { share: 0, sum: 0, vivid: 0 }; // not yet seen to be on the screen
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const flat = copy.getContext("2d", { willReadFrequently: true });
    flat.drawImage(canvas, 0, 0);
    const { data } = flat.getImageData(0, 0, canvas.width, canvas.height);
    let drawn = 0, sum = 0, vivid = 0;
    for (let k = 0; k < data.length; k += 4) {
      if (data[k + 3] < 128) continue;
      drawn++;
      sum = (sum * 31 + data[k] + 3 * data[k + 1] + 7 * data[k + 2] + k) % 1000000007;
      if (Math.max(data[k], data[k + 1], data[k + 2]) - Math.min(data[k], data[k + 1], data[k + 2]) > 60) vivid++;
    }
    return { share: drawn / (data.length / 4), sum, vivid: vivid / Math.max(drawn, 1) };
  }, selector);

/** The same once there are colours: a view is drawn when the browser finds time to say that it is on the screen. */
async function lookAtColours(page, selector) {
  for (let k = 0; k < 40; k++) {
    const seen = await look(page, selector);
    if (seen.vivid > 0.02) return seen;
    await page.waitForTimeout(250);
  }
  return look(page, selector);
}

const tests = {
  async "the summary, the verdict and all names are there, as text"(page) {
    assert.match(await page.title(), /model .<i>. & co/);
    assert.match(await page.textContent("#summary"), /8 shapes, 48 particles/);
    assert.match(await page.textContent("#verdict"), /1 of 8 shapes needs review/);
    const names = await page.$$eval("#fidelity option", (o) => o.map((x) => x.textContent));
    for (const name of NAMES) assert.ok(names.includes(name), `${name} is missing`);
    assert.equal(await page.evaluate(() => window.harmed), undefined);
    assert.equal(await page.locator("#certificate img, #cohort img, #cohort b").count(), 0);
    assert.ok((await page.textContent("#certificate")).includes(HARM));
    assert.match(await page.textContent("#certificate"), /1 swapped pair, no folds, 1 of 384 particles have lost neighbours, on 1 shape \(at most 1 of 48, on d\)/);
  },
  async "the mean is drawn, and a slider moves it, by the keyboard too"(page) {
    const canvas = "#modes canvas", range = "#modes input[type=range]";
    await show(page, canvas);
    const mean = await look(page, canvas);
    assert.ok(mean.share > 0.05 && mean.share < 0.9, `share of pixels ${mean.share}`);
    assert.ok(mean.vivid < 0.05, "the mean has no displacement to colour");
    await page.locator(range).first().fill("3");
    await settle(page);
    const moved = await look(page, canvas);
    assert.notEqual(moved.sum, mean.sum);
    assert.ok(moved.vivid > 0.1, "no colour by displacement");
    assert.match(await page.textContent("#modes .value"), /\+3\.00 sd/);
    await page.locator(range).first().press("ArrowLeft");
    assert.match(await page.textContent("#modes .value"), /\+2\.99 sd/);
    await page.getByRole("button", { name: "Reset to the mean" }).click();
    await settle(page);
    assert.equal((await look(page, canvas)).sum, mean.sum);
  },
  async "the mode at 2 sd is where the model says"(page) {
    const errors = await page.evaluate(() => {
      const { model, modes } = apsmReport, before = modes.V.slice();
      modes.setMode(0, 2);
      const d = model.array(model.mean.modes[0].vertices, "displacements");
      const worst = d.reduce((w, x, k) => Math.max(w, Math.abs(modes.V[k] - before[k] - 2 * x)), 0);
      const far = d.reduce((w, x) => Math.max(w, Math.abs(x)), 0);
      modes.setMode(0, 0);
      return { worst, far };
    });
    assert.ok(errors.worst < 1e-4 && errors.far > 0.5, JSON.stringify(errors));
  },
  async "lengths have a unit, a scale bar and a ruler"(page) {
    assert.match(await page.textContent("#summary"), /Lengths are in cm\./);
    assert.match(await page.textContent("#modes .legend"), /cm inward/);
    await show(page, "#modes canvas");
    await page.locator("#modes input[type=checkbox]").first().check(); // measure
    const box = await page.locator("#modes canvas").boundingBox();
    for (const x of [0.45, 0.55]) await page.mouse.click(box.x + x * box.width, box.y + box.height / 2);
    const measured = await page.evaluate(() => document.querySelector("#modes canvas").view.measured);
    assert.equal(measured.length, 2);
    const size = Math.hypot(...[0, 1, 2].map((k) => measured[0][k] - measured[1][k]));
    assert.ok(size > 0.09 * box.width * await page.evaluate(() => document.querySelector("#modes canvas").view.perPixel * (devicePixelRatio || 1)), `measured ${size}`);
    await page.locator("#modes input[type=checkbox]").first().uncheck();
  },
  async "what is seen can be saved: picture, surface, plot, tables"(page) {
    const save = async (name) => {
      const [file] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name, exact: true }).first().click()]);
      return [file.suggestedFilename(), readFileSync(await file.path())];
    };
    const [pngName, png] = await save("save picture"), [, stl] = await save("save this surface as STL"), [, svg] = await save("save Compactness as a picture");
    assert.match(pngName, /mean\.png$/);
    assert.deepEqual([...png.subarray(1, 4)], [80, 78, 71]);
    const faces = await page.evaluate(() => apsmReport.model.array(apsmReport.model.mean.faces, "integers").length / 3);
    assert.equal(stl.readUInt32LE(80), faces);
    assert.equal(stl.length, 84 + 50 * faces);
    const x = await page.evaluate(() => apsmReport.modes.V[3 * apsmReport.model.array(apsmReport.model.mean.faces, "integers")[0]]);
    assert.equal(stl.readFloatLE(84 + 12), Math.fround(x));
    assert.match(svg.toString(), /^<svg [^>]*xmlns="http:\/\/www.w3.org\/2000\/svg".*stroke="rgb/s);
    const [, csv] = await save("save certificate as a table");
    assert.equal(csv.toString().split("\n").length, 2 + NAMES.length);
    assert.ok(csv.toString().includes(`,"${HARM.replaceAll('"', '""')}; particles`) || csv.toString().includes(HARM));
  },
  async "every mode is offered, and the scores give the shapes back"(page) {
    const [modes, worst, size] = await page.evaluate(() => {
      const { model, modes } = apsmReport, mean = model.array(model.mean.vertices, "positions"), shape = model.array(model.shapes[4].warped, "warped");
      const sd = model.variances.map(Math.sqrt), sum = Float64Array.from(mean);
      for (let m = 0; m < sd.length; m++) {
        const b = model.shapes[4].scores[m] ?? NaN, D = modes.D(m);
        for (let k = 0; k < sum.length; k++) sum[k] += (b / sd[m]) * D[k];
      }
      return [document.querySelectorAll("#modes .mode").length, sum.reduce((w, x, k) => Math.max(w, Math.abs(x - shape[k])), 0), Math.max(...mean)];
    });
    assert.ok(modes >= 5 && worst < 1e-3 * size, `${modes} modes, off by ${worst} of ${size}`);
  },
  async "two shapes are compared on one view"(page) {
    await show(page, "#compare canvas");
    const one = await lookAtColours(page, "#compare canvas");
    assert.ok(one.vivid > 0.02, "no difference is coloured");
    await page.locator("#compare select").nth(1).selectOption({ index: 0 });
    await page.locator("#compare select").nth(0).selectOption({ index: 0 });
    await settle(page);
    assert.match(await page.textContent("#compare table"), /without sign0/);
  },
  async "a link brings the state back"(page) {
    await page.evaluate(() => { apsmReport.modes.setMode(1, -1.25); Object.assign(apsmReport.pose, { yaw: 1, pitch: 0.5 }); });
    await page.getByRole("button", { name: "Link to this view" }).click();
    const link = await page.evaluate(() => location.href);
    assert.match(link, /#s=/);
    await page.reload();
    await page.waitForFunction(() => document.documentElement.dataset.ready === "yes");
    assert.deepEqual(await page.evaluate(() => [apsmReport.modes.weight[1], apsmReport.pose.yaw]), [-1.25, 1]);
    for (const bad of ["#s=%7B", "#s=%7B%22pose%22%3A7%7D", "#s=1", "#modes"]) {
      await page.goto(page.url().split("#")[0] + bad);
      await page.reload();
      await page.waitForFunction(() => document.documentElement.dataset.ready === "yes");
    }
  },
  async "play runs and stops"(page) {
    const play = page.getByRole("button", { name: "play mode 1", exact: true }), value = () => page.textContent("#modes .value");
    await play.click();
    const first = await value();
    await page.waitForFunction((text) => document.querySelector("#modes .value").textContent !== text, first);
    await play.click();
    const stopped = await value();
    await page.waitForTimeout(200);
    assert.equal(await value(), stopped);
    await page.getByRole("button", { name: "Reset to the mean" }).click();
  },
  async "all shapes are drawn with particles, and turn together"(page) {
    await show(page, "#cohort .grid");
    const tile = (k) => `#cohort .tile:nth-child(${k}) canvas`;
    const before = [await lookAtColours(page, tile(1)), await lookAtColours(page, tile(5))];
    for (const b of before) assert.ok(b.share > 0.05 && b.vivid > 0.02, JSON.stringify(b));
    await page.locator(tile(1)).focus();
    await page.keyboard.press("ArrowLeft");
    await settle(page);
    assert.notEqual((await look(page, tile(1))).sum, before[0].sum);
    assert.notEqual((await look(page, tile(5))).sum, before[1].sum);
    const box = await page.locator(tile(2)).boundingBox(), yaw = await page.evaluate(() => apsmReport.pose.yaw);
    await page.mouse.move(box.x + 40, box.y + 40);
    await page.mouse.down();
    await page.mouse.move(box.x + 90, box.y + 40, { steps: 4 });
    await page.mouse.up();
    assert.notEqual(await page.evaluate(() => apsmReport.pose.yaw), yaw);
    await page.keyboard.press("Escape");
  },
  async "a click on a particle marks it on every shape"(page) {
    await show(page, "#cohort .grid");
    await lookAtColours(page, "#cohort .tile:nth-child(2) canvas");
    const at = await page.evaluate(() => {
      const { tiles } = apsmReport, view = tiles[1].view, c = view.canvas;
      for (let y = 10; y < c.clientHeight; y += 3)
        for (let x = 10; x < c.clientWidth; x += 3) {
          const j = view.particleAt(x, y);
          if (j >= 0) return { x, y, j };
        }
      return null;
    });
    assert.ok(at, "no particle can be picked");
    const canvas = page.locator("#cohort .tile canvas").nth(1), other = "#cohort .tile:nth-child(6) canvas";
    const plain = await look(page, other);
    await canvas.hover({ position: at });
    await settle(page);
    assert.equal(await page.evaluate(() => apsmReport.state.hover), at.j);
    assert.notEqual((await look(page, other)).sum, plain.sum, "hover shows on no other shape");
    await canvas.click({ position: at });
    await page.mouse.move(2, 2);
    await settle(page);
    const marks = await page.evaluate(() => [apsmReport.state.pin, apsmReport.state.hover, apsmReport.state.chosen]);
    assert.deepEqual(marks, [at.j, -1, 1]);
    assert.match(await page.textContent("#cohort"), new RegExp(`particle ${at.j} \\(kept`));
    await page.keyboard.press("Escape");
    assert.equal(await page.evaluate(() => apsmReport.state.pin), -1);
  },
  async "the cohort sorts"(page) {
    const order = () => page.$$eval("#cohort .tile", (t) => t.map((x) => Number(x.textContent.match(/([\d.]+) from the mean/)?.[1])));
    await page.locator("#cohort select").first().selectOption("distance");
    const far = await order();
    assert.equal(far.length, 8);
    assert.deepEqual(far, [...far].sort((a, b) => b - a));
    const facts = await page.evaluate(() => {
      const { model } = apsmReport, c = new Map(model.certificate.per_shape.map((s) => [s.name, s]));
      return model.shapes.map((s) => [s.name, c.get(s.name)["mismatched_1.5_2.0"].length,
        model.evaluation.surface_distance.per_shape.find((d) => d.name === s.name).mean]);
    });
    const names = () => page.$$eval("#cohort .tile figcaption button", (b) => b.map((x) => x.title.replace(/: show its surface distances$/, "")));
    await page.locator("#cohort select").first().selectOption("surface");
    const error = new Map(facts.map(([name, , mean]) => [name, mean])), byError = (await names()).map((name) => error.get(name));
    assert.deepEqual(byError, [...byError].sort((a, b) => b - a));
    assert.ok(byError[0] > byError[7]);
    await page.locator("#cohort select").first().selectOption("mismatched");
    assert.equal((await names())[0], "d", "the shape with a mismatched particle comes first");
    await page.locator("#cohort select").first().selectOption("name");
    assert.deepEqual(await names(), facts.map(([name]) => name));
  },
  async "a particle has one colour on all shapes"(page) {
    const tints = await page.evaluate(() => {
      const tint = (t) => [...t.view.scene.children[1].geometry.getAttribute("tint").array];
      return [tint(apsmReport.tiles[1]), tint(apsmReport.tiles[6]), [...apsmReport.model.array(apsmReport.model.colours, "integers")]];
    });
    assert.equal(tints[0].length, 3 * 48);
    assert.deepEqual(tints[0], tints[1]);
    const kinds = new Map(tints[2].map((c, j) => [c, tints[0].slice(3 * j, 3 * j + 3).join()]));
    assert.equal(new Set(kinds.values()).size, 10, "colours that cannot be told apart");
    tints[2].forEach((c, j) => assert.equal(tints[0].slice(3 * j, 3 * j + 3).join(), kinds.get(c)));
  },
  async "the keyboard alone reaches shapes, particles, views"(page) {
    const now = () => page.evaluate(() => [apsmReport.state.chosen, apsmReport.state.pin]);
    await page.evaluate(() => document.activeElement.blur());
    const [chosen] = await now();
    await page.keyboard.press("n");
    assert.deepEqual(await now(), [(chosen + 1) % 8, -1]);
    await page.keyboard.press("p");
    await page.keyboard.press(".");
    await page.keyboard.press(".");
    assert.deepEqual(await now(), [chosen, 1]);
    await page.keyboard.press(",");
    assert.deepEqual(await now(), [chosen, 0]);
    assert.match(await page.textContent("#modes .readout"), /particle 0 \(kept/);
    await page.keyboard.press("Escape");
    assert.deepEqual(await now(), [chosen, -1]);
    // Tab gets from the slider of one mode to the next; a view takes + and 0.
    await page.locator("#modes input[type=range]").first().focus();
    await page.keyboard.press("Tab");
    await page.keyboard.press("Tab");
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "mode 2 in standard deviations");
    await page.locator("#modes canvas").focus();
    const zoom = () => page.evaluate(() => apsmReport.pose.zoom);
    await page.keyboard.press("+");
    assert.ok((await zoom()) > 1.1);
    await page.keyboard.press("0");
    await page.waitForFunction(() => apsmReport.pose.zoom === 1);
  },
  async "heat maps and histogram follow the shape chosen"(page) {
    await show(page, "#fidelity .pair");
    const template = await page.evaluate(() => apsmReport.model.template);
    const other = template === 5 ? 6 : 5;
    await page.locator("#fidelity select").first().selectOption(String(other));
    await settle(page);
    const maps = [];
    for (const k of [0, 1]) maps.push(await page.evaluate((n) => document.querySelectorAll("#fidelity canvas")[n].id = `map${n}`, k));
    for (const id of maps) assert.ok((await lookAtColours(page, `#${id}`)).vivid > 0.02, "no heat");
    const before = await page.innerHTML("#fidelity svg");
    await page.getByRole("button", { name: "next shape" }).click();
    await settle(page);
    assert.notEqual(await page.innerHTML("#fidelity svg"), before);
  },
  async "figures and scatter are there; a point chooses its shape"(page) {
    assert.equal(await page.locator("#quality svg").count(), 4);
    assert.match(await page.textContent("#quality"), /definition .standard./);
    assert.equal(await page.locator("#quality svg .point").count(), 8);
    await page.locator("#quality svg .point").nth(3).press("Enter");
    assert.equal(await page.evaluate(() => apsmReport.state.chosen), 3);
  },
  async "a test is told, drawn, cut off at a threshold, and moves from group to group"(page) {
    const canvas = "#answers canvas";
    await show(page, canvas);
    assert.match(await page.textContent("#answers"), /side: p = /);
    assert.ok((await page.textContent("#answers")).includes(HARM));
    assert.equal(await page.evaluate(() => window.harmed), undefined);
    const all = await lookAtColours(page, canvas);
    assert.ok(all.vivid > 0.02, "no effect to be seen");
    await page.locator("#answers input[type=range]").first().fill("-4");
    await settle(page);
    assert.ok((await look(page, canvas)).vivid < 0.02, "coloured beyond the threshold");
    await page.getByRole("button", { name: "left", exact: true }).click();
    await settle(page);
    assert.match(await page.textContent("#answers .split"), /mean of left/);
    assert.equal(await page.locator("#answers .wide circle.point").count(), 8);
    assert.equal(await page.locator("#answers .wide svg > path[style*=stroke]").count(), 2);
    await page.locator("#answers label", { hasText: "Regression lines" }).click();
    assert.equal(await page.locator("#answers .wide path.regression").count(), 2);
    assert.match(await page.textContent("#answers .wide"), /Lines of least squares: .*r = /);
    await page.locator("#answers label", { hasText: "Ellipses" }).click();
    assert.equal(await page.locator("#answers .wide svg > path[style*=stroke]").count(), 2);
    await page.locator("#answers label", { hasText: "Regression lines" }).click();
    assert.equal(await page.locator("#answers .wide svg > path[style*=stroke]").count(), 0);
  },
  async "a click in the certificate goes to the place"(page) {
    await page.getByTitle("show particle 7 on c", { exact: true }).click();
    const now = await page.evaluate(() => [apsmReport.state.chosen, apsmReport.state.pin]);
    assert.deepEqual(now, [2, 7]);
    // It scrolls and turns smoothly: wait for the end of both.
    await page.waitForFunction(() => Math.abs(document.querySelector("#fidelity").getBoundingClientRect().top) < 400);
    await page.waitForFunction(() => {
      const view = document.querySelector("#fidelity canvas").view, n = view.pickable.N.slice(21, 24), p = apsmReport.pose;
      return n[0] * Math.sin(p.yaw) * Math.cos(p.pitch) - n[1] * Math.cos(p.yaw) * Math.cos(p.pitch) + n[2] * Math.sin(p.pitch) > 0.99;
    });
    await page.keyboard.press("Escape");
  },
  async "provenance names inputs with hashes, but no folders"(page) {
    const text = await page.textContent("#provenance");
    assert.match(text, /[0-9a-f]{64}/);
    assert.ok(text.includes("stage1_epochs"));
    assert.match(text, /Made by apsm \d+\.\d+\.\d+, seed 0, 8 inputs/);
    assert.match(text, /optimize[\d.]+\ss[\d.]+\ss\d+\sMB/);
    assert.ok(!(await page.content()).includes(folder));
  },
  async "text has enough contrast, light and dark"(page) {
    for (const theme of ["light", "dark"]) {
      const poor = await page.evaluate((name) => {
        document.documentElement.dataset.theme = name;
        const rgb = (text) => text.match(/[\d.]+/g).map(Number);
        const light = (c) => {
          const [r, g, b] = c.slice(0, 3).map((x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const ground = (node) => {
          for (let n = node; n; n = n.parentElement) {
            const c = rgb(getComputedStyle(n).backgroundColor);
            if (c.length < 4 || c[3] > 0.99) return c;
          }
          return [255, 255, 255];
        };
        const out = [];
        for (const node of document.querySelectorAll("body *")) {
          if (node.closest("script, style, noscript") || ![...node.childNodes].some((c) => c.nodeType === 3 && c.data.trim())) continue;
          const style = getComputedStyle(node), a = light(rgb(node.namespaceURI.includes("svg") ? style.fill : style.color)), b = light(ground(node));
          const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
          if (ratio < 4.5) out.push(`${name} ${node.tagName} ${node.textContent.slice(0, 30)} ${ratio.toFixed(2)}`);
        }
        return [...new Set(out)].slice(0, 5);
      }, theme);
      assert.deepEqual(poor, []);
    }
  },
  async "every control has a name"(page) {
    const nameless = await page.evaluate(() =>
      [...document.querySelectorAll("button, input, select, canvas, [role=button]")]
        .filter((n) => !n.getAttribute("aria-label") && !n.textContent.trim() && !n.closest("label")?.textContent.trim())
        .map((n) => n.outerHTML.slice(0, 80)));
    assert.deepEqual(nameless, []);
  },
};

async function picture(page, name) {
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`), fullPage: true });
}

async function main() {
  makeModel();
  const browser = await chromium.launch({
    executablePath: browserPath,
    args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--disable-quic", "--no-first-run",
      "--disable-background-networking", "--disable-component-update", "--disable-sync"],
  });
  let failed = 0;
  const check = async (name, test) => {
    try {
      await test();
      assert.deepEqual(complaints.splice(0), []);
      console.log(`ok   ${name}`);
    } catch (error) {
      failed++;
      console.log(`FAIL ${name}\n     ${String(error.message).replaceAll("\n", "\n     ")}`);
    }
  };
  const page = await open(browser);
  await picture(page, "light");
  for (const [name, test] of Object.entries(tests)) await check(name, () => test(page));
  await check("nothing is cut off on a phone in the dark", async () => {
    const phone = await open(browser, { viewport: { width: 360, height: 740 }, colorScheme: "dark", hasTouch: true, isMobile: true });
    assert.equal(await phone.evaluate(() => document.documentElement.dataset.theme), "dark");
    const wide = await phone.evaluate(() => [...document.querySelectorAll("main *, header *")]
      .filter((n) => !n.closest(".scroll, svg") && n.getBoundingClientRect().right > 361).map((n) => n.outerHTML.slice(0, 90)));
    assert.deepEqual(wide.slice(0, 3), []);
    await picture(phone, "phone");
    await phone.context().close();
  });
  await check("it prints", async () => {
    await page.emulateMedia({ media: "print" });
    await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
    assert.ok(await page.isHidden("nav") && await page.isHidden("#modes input[type=range]") && await page.isVisible("#provenance table"));
    assert.ok((await look(page, "#cohort .tile:nth-child(8) canvas")).share > 0.05, "a shape is not printed");
    await picture(page, "print");
    await page.evaluate(() => dispatchEvent(new Event("afterprint")));
    await page.emulateMedia({ media: "screen" });
    const pdf = await page.pdf({ format: "A4" });
    assert.ok(pdf.length > 30000);
    if (pictures) writeFileSync(join(pictures, "print.pdf"), pdf);
  });
  await check("new shapes are shown beside the mean", async () => {
    const fits = join(folder, "fits <b>");
    try { run("fit", model, join(folder, "in"), "-o", fits, "-q"); } catch { /* some are refused: exit code 1 */ }
    const pageOfFits = await open(browser, {}, fits);
    assert.equal(await pageOfFits.locator("#table tbody tr").count(), NAMES.length);
    assert.ok((await look(pageOfFits, "#shape figure:nth-child(1) canvas")).share > 0.05, "the shape is not drawn");
    assert.ok((await look(pageOfFits, "#shape figure:nth-child(2) canvas")).share > 0.05, "the mean is not drawn");
    const reach = await pageOfFits.evaluate(() => {
      const { model } = window.apsmReport, V = model.array(model.shown[0].vertices, "warped");
      return Math.max(...V.map((x, k) => Math.abs(x - model.V0[k])));
    });
    assert.ok(reach > 0 && reach < 10, `vertices are read wrongly: ${reach}`);
    await pageOfFits.selectOption("#shape .tools label:nth-child(2) select", "deviation");
    await pageOfFits.keyboard.press("n");
    assert.ok((await pageOfFits.locator("#shape svg path.curve").count()) > 0, "no scores");
    const saved = async (name) => {
      const [file] = await Promise.all([pageOfFits.waitForEvent("download"), pageOfFits.getByRole("button", { name, exact: true }).first().click()]);
      return readFileSync(await file.path());
    };
    const ply = await saved("save this surface as PLY, with its colours' values"), faces = await pageOfFits.evaluate(() => window.apsmReport.model.F.length / 3);
    assert.match(ply.toString("latin1").slice(0, 400), new RegExp(`element face ${faces}\\s`));
    assert.equal((await saved("save fits fits <b> as a table")).toString().trim().split("\n").length, 1 + NAMES.length);
    await picture(pageOfFits, "fits");
    await pageOfFits.context().close();
  });
  await check("a norm says what to know before it is trusted", async () => {
    const fits = join(folder, "guests"), norms = join(folder, "norms"), guest = join(folder, "guest.ply");
    copyFileSync(join(folder, "in", "b.ply"), guest);
    run("fit", model, guest, "-o", fits, "-q");
    run("norm", model, fits, "-o", norms, "-q");
    const pageOfNorms = await open(browser, {}, norms, "norm.html");
    for (const place of ["#verdict .verdict.bad", "#shape", "#table"])
      assert.match(await pageOfNorms.locator(place).innerText(), /is the model's own b/, place);
    await picture(pageOfNorms, "norms");
    await pageOfNorms.context().close();
  });
  await check("a joint's parts are shown, hidden, drawn apart; pose and shape are modes by themselves", async () => {
    const joint = join(folder, "joint"), inputs = join(folder, "parts");
    mkdirSync(inputs);
    writeJoints(inputs);
    run("run", inputs, "-o", joint, "--pattern", "*.ply", "--parts", "socket=_socket,hinge=_hinge", "--align-parts", "socket", "--features", "warm:0", "--landmarks", join(inputs, "marks.csv"),
      "-J", "32", "--faces", "1200", "--stage1-epochs", "4", "--stage2-epochs", "2", "-q");
    const page = await open(browser, {}, joint), canvas = "#modes canvas";
    await show(page, canvas);
    const whole = await look(page, canvas);
    assert.ok(whole.vivid > 0.2, "parts have no colours");
    await page.getByLabel("hinge", { exact: true }).uncheck();
    await settle(page);
    const socket = await look(page, canvas);
    assert.ok(socket.share < 0.8 * whole.share, `hidden part: ${socket.share} of ${whole.share}`);
    await page.getByLabel("hinge", { exact: true }).check();
    await page.getByLabel("parts drawn apart").fill("1");
    await settle(page);
    assert.notEqual((await look(page, canvas)).sum, whole.sum);
    await page.getByLabel("parts drawn apart").fill("0");
    // The first mode of pose turns the hinge about the socket and changes neither; the first of shape makes the socket longer.
    const told = await page.evaluate(() => {
      const { model, modes } = apsmReport, starts = model.joint.vertices, size = (X, a, b) => {
        const c = [0, 1, 2].map((k) => { let s = 0; for (let v = a; v < b; v++) s += X[3 * v + k] / (b - a); return s; });
        let s = 0;
        for (let v = a; v < b; v++) s += Math.hypot(X[3 * v] - c[0], X[3 * v + 1] - c[1], X[3 * v + 2] - c[2]) / (b - a);
        return { c, s };
      };
      const at = (d) => size(modes.V, starts[d], starts[d + 1]), both = () => [at(0), at(1)], far = (a, b) => Math.hypot(...a.map((x, k) => x - b[k]));
      modes.use("pose");
      const mean = both();
      modes.setMode(0, 2);
      const pose = both();
      modes.use("shape");
      modes.setMode(0, 2);
      const shape = both();
      modes.use("all");
      return { went: far(pose[1].c, mean[1].c), swelled: Math.abs(pose[1].s / mean[1].s - 1), stayed: far(shape[1].c, mean[1].c), grew: Math.abs(shape[0].s / mean[0].s - 1) };
    });
    assert.ok(told.went > 10 && told.swelled < 1e-4 && told.stayed < 1 && told.grew > 0.02, JSON.stringify(told));
    await page.selectOption("#modes .sliders select >> nth=0", { label: "mean warm" });
    await settle(page);
    assert.match(await page.textContent("#modes .main"), /warm/);
    await page.selectOption("#cohort .tools label:nth-child(4) select", { label: "warm" });
    assert.match(await page.textContent("#cohort .legend"), /warm/);
    assert.match(await page.textContent("#fidelity"), /socket \u2013 hinge/);
    assert.match(await page.textContent("#fidelity"), /socket <i>end<\/i>/);
    await picture(page, "joint");
    await page.context().close();
  });
  await check("contours are drawn, moved along modes, chosen and judged", async () => {
    const curves = join(folder, "curves"), made = join(folder, "contours");
    mkdirSync(curves);
    for (let i = 0; i < 5; i++) {
      const n = 90, at = (k) => { const t = (2 * Math.PI * k) / n, r = 50 + (4 + 2 * i) * Math.cos(3 * t) + 5 * Math.cos(t); return `${r * Math.cos(t)} ${r * Math.sin(t)} 0`; };
      const ks = Array.from({ length: n }, (_, k) => k);
      writeFileSync(join(curves, `<i>c${i}.vtk`), `# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS ${n} double\n${ks.map(at).join("\n")}\nLINES ${n} ${3 * n}\n${ks.map((k) => `2 ${k} ${(k + 1) % n}`).join("\n")}\n`);
    }
    run("run", curves, "-o", made, "-J", "24", "-q");
    const page = await open(browser, {}, made);
    assert.match(await page.textContent("#verdict"), /of 5 contours/);
    const shape = () => page.getAttribute("#modes svg path:last-of-type", "d"), before = await shape();
    await page.locator("#modes input[type=range]").fill("2");
    assert.notEqual(await shape(), before, "the slider moves nothing");
    assert.equal(await page.locator("#modes svg circle").count(), 24);
    await page.getByRole("button", { name: "c3" }).click();
    assert.match(await page.textContent("#shape p"), /c3: /);
    assert.equal(await page.locator("#certificate tbody tr").count(), 5);
    assert.doesNotMatch(await page.textContent("main"), /undefined|NaN/);
    await picture(page, "contours");
    await page.context().close();
  });
  await check("without WebGL the figures and tables are still there", async () => {
    const plain = await chromium.launch({ executablePath: browserPath, args: ["--no-sandbox", "--disable-gpu", "--disable-3d-apis", "--disable-background-networking"] });
    const context = await plain.newContext({ offline: true }), poor = await context.newPage();
    await poor.goto(pathToFileURL(join(model, "report.html")).href);
    await poor.waitForFunction(() => document.documentElement.dataset.ready === "yes");
    assert.match(await poor.textContent("#problem"), /WebGL/);
    assert.equal(await poor.locator("#quality svg").count(), 4);
    await plain.close();
  });
  await browser.close();
  return failed;
}

let code = 1;
try {
  code = (await main()) > 0 ? 1 : 0;
} finally {
  rmSync(folder, { recursive: true, force: true });
}
process.exit(code);
