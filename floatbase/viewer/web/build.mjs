// Build dist/ from src/: `node build.mjs`. With --check nothing is written, and the exit code is 1
// where a file in dist/ is not what would be written. dist/ is committed, so that Python needs no
// node; sources.sha256 says what it was built from (tests/viewer/test_web.py compares it).

import {createHash} from "node:crypto";
import {mkdirSync, readFileSync, readdirSync, writeFileSync} from "node:fs";
import process from "node:process";
import {build} from "esbuild";

process.chdir(import.meta.dirname);
// older browsers than src/messages.js asks for must be able to read the code, to say so
const TARGET = "es2020";
const common = {bundle: true, minify: true, charset: "utf8", target: TARGET, write: false};

const bundles = await Promise.all([
  build({...common, entryPoints: ["src/page.js"], outdir: "dist", format: "iife",
    globalName: "floatbase"}),
  build({...common, entryPoints: ["src/widget.js"], outdir: "dist", format: "esm"}),
  build({...common, entryPoints: ["src/pictures.js", "src/page.css"], outdir: "dist"}),
  build({...common, entryPoints: ["src/robot.js"], outdir: "dist", format: "iife",
    globalName: "floatbaseRobot"}),
  build({...common, entryPoints: {"floatbase-live": "src/embed.js"}, outdir: "dist"}),
  // the worker loads MuJoCo, which is not part of dist/
  build({...common, entryPoints: {engine: "src/engine/worker.js"}, outdir: "dist", format: "esm",
    external: ["./mujoco.js"], target: "es2022"}),
]);
const built = Object.fromEntries(bundles.flatMap(({outputFiles}) => outputFiles)
  .map(({path, text}) => [path.split("/").at(-1), text]));
built["page.html"] = readFileSync("src/page.html", "utf8");

const digest = createHash("sha256");
const sources = readdirSync("src", {recursive: true, withFileTypes: true})
  .filter((entry) => entry.isFile()).map(({parentPath, name}) => `${parentPath}/${name}`).sort();
const tables = readdirSync("../../live").filter((name) => name.endsWith(".json")).sort()
  .map((name) => `../../live/${name}`);
for (const name of ["build.mjs", "package-lock.json", ...tables, ...sources]) {
  const data = readFileSync(name);
  digest.update(`${name} ${data.length}\n`).update(data);
}
built["sources.sha256"] = `${digest.digest("hex")}\n`;

const readBuilt = (name) => {
  try { return readFileSync(`dist/${name}`, "utf8"); } catch { return null; }
};
if (process.argv.includes("--check")) {
  const stale = Object.keys(built).filter((name) => readBuilt(name) !== built[name]);
  if (stale.length) {
    console.error(`dist/ is out of date: ${stale.join(", ")}; run \`make web\` and commit it.`);
    process.exit(1);
  }
} else {
  mkdirSync("dist", {recursive: true});
  for (const [name, text] of Object.entries(built)) writeFileSync(`dist/${name}`, text);
}
