// Pictures of a report for the documents: node report-pictures.mjs CHROMIUM REPORT.html OUT.png SECTION [W H]
// Needs playwright-core beside it or in NODE_PATH; scripts/make-figures calls it.
import { pathToFileURL } from "node:url";
import { createRequire } from "node:module";
const require = createRequire(`${process.env.PACKAGES}/`);
const { chromium } = require("playwright-core");
const [browserPath, report, out, section, width = "1200", height = "760"] = process.argv.slice(2);
const browser = await chromium.launch({ executablePath: browserPath, args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"] });
const page = await browser.newPage({ viewport: { width: Number(width), height: Number(height) } });
page.setDefaultTimeout(180e3); // on a busy machine without a graphics card
await page.goto(pathToFileURL(report).href);
await page.waitForFunction(() => document.documentElement.dataset.ready === "yes");
await page.evaluate((id) => {
  if (id === "modes") apsmReport.modes.setMode(0, 2);
  document.getElementById(id).scrollIntoView({ behavior: "instant" });
}, section);
await page.waitForTimeout(400);
await page.waitForFunction(() => apsmReport.idle());
await page.waitForTimeout(400);
await page.screenshot({ path: out });
await browser.close();
