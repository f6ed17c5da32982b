// Makes dist/viewer.html: page, style and program in one file, with a mark where the data go.
// `make viewer` calls it; the result is committed, so that building apsm needs neither node nor npm.
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const read = (name) => readFileSync(join(here, name), "utf8");

async function bundle(name) {
  const result = await build({
    entryPoints: [join(here, name)],
    bundle: true,
    minify: true,
    write: false,
    target: "es2020",
    charset: "ascii",
    legalComments: "none",
    absWorkingDir: here,
  });
  return result.outputFiles[0].text.trim();
}

const notice = read("node_modules/three/LICENSE").trim();
const script = (await bundle("src/main.js")).replaceAll("</script", "<\\/script");
const style = await bundle("src/style.css");
const html = read("src/page.html")
  .replace("/* STYLE */", () => style)
  .replace("/* SCRIPT */", () => `/* Contains three.js.\n\n${notice}\n*/\n${script}`);

// What the file was made from, for scripts/check-viewer.
const sha = (text) => createHash("sha256").update(text).digest("hex");
const sources = ["build.mjs", "package.json", "package-lock.json"].concat(
  readdirSync(join(here, "src")).sort().map((name) => `src/${name}`),
);
mkdirSync(join(here, "dist"), { recursive: true });
writeFileSync(join(here, "dist/viewer.html"), html);
const lines = sources.map((name) => `${sha(read(name))}  ${name}`);
lines.push(`${sha(html)}  dist/viewer.html`);
writeFileSync(join(here, "dist/SHA256SUMS"), lines.join("\n") + "\n");
console.log(`dist/viewer.html: ${(html.length / 1000).toFixed(0)} kB`);
