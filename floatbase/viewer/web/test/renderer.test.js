import assert from "node:assert/strict";
import test from "node:test";
import {adaptPixels, isSoftware} from "../src/renderer.js";

test("renderers that draw without a graphics card are recognized by their names", () => {
  for (const name of ["ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)))",
    "llvmpipe (LLVM 17.0.6, 256 bits)", "softpipe", "Apple Software Renderer",
    "ANGLE (Microsoft, Microsoft Basic Render Driver Direct3D11)"]) assert.ok(isSoftware(name));
  for (const name of ["ANGLE (NVIDIA, NVIDIA GeForce RTX 4070)", "Mesa Intel(R) UHD Graphics 620",
    "Apple M3", "Adreno (TM) 650", "Mali-G78", ""]) assert.ok(!isSoftware(name));
});

// A viewer whose pictures take `time` ms: the ratio of each picture, the last one after a rest.
async function ratios(time, isCheap, count = 7, isChanged = false) {
  Object.assign(globalThis, {window: {}, devicePixelRatio: 3});
  const now = performance.now.bind(performance), drawn = [];
  let late = 0, ratio = 1;
  performance.now = () => now() + late;
  const gl = {readPixels: () => { late += time; }};
  const renderer = {getContext: () => gl, getPixelRatio: () => ratio,
    setPixelRatio: (wanted) => { ratio = wanted; }};
  const viewer = {renderer, render: () => drawn.push(ratio)};
  adaptPixels(viewer, isCheap);
  for (let i = 0; i < count; i++) viewer.render();
  viewer.needs_render = isChanged;
  await new Promise((done) => setTimeout(done, 450));
  performance.now = now;
  return drawn;
}

test("a fast machine draws two pixels per pixel at most", async () => {
  assert.deepEqual(new Set(await ratios(5, false)), new Set([2]));
});

test("a slow machine draws few pixels while the picture moves, and all once it rests", async () => {
  assert.deepEqual((await ratios(150, false)).slice(5), [0.5, 0.5, 1]);
  assert.deepEqual(await ratios(150, true, 2), [0.5, 0.5, 1]);
});

test("a picture at rest does not take the place of one that must follow a change", async () => {
  assert.deepEqual(await ratios(5, true, 2, true), [0.5, 0.5]);
});
