// Compare the page's engine with the Python library: `node reference.mjs FOLDER [MODULE]`. The
// folder holds what tests/live_reference.py writes. Prints the largest differences as JSON.

import {readFileSync} from "node:fs";
import process from "node:process";
import loadMujoco from "@mujoco/mujoco";
import {FILES, NUMBERS, compare} from "./compare.js";

const [folder, wasm] = process.argv.slice(2);
const numbers = (bytes) => new Float64Array(bytes.buffer.slice(bytes.byteOffset,
  bytes.byteOffset + bytes.length));
const read = (name) => readFileSync(`${folder}/${name}`);
const given = {
  mj: await loadMujoco(),
  module: new WebAssembly.Module(
    readFileSync(wasm ?? new URL("../../live/tick.wasm", import.meta.url))),
  files: Object.fromEntries([...FILES.map((name) => [name, JSON.parse(read(name))]),
    ...NUMBERS.map((name) => [name, numbers(read(name))])]),
};
console.log(JSON.stringify(await compare(given), null, 1));
