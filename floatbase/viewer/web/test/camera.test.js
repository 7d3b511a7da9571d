import assert from "node:assert/strict";
import test from "node:test";
import {
  followFraction, groundHeight, labelScale, liftOf, smoothHeight, zoomFor,
} from "../src/camera.js";

test("the ground is the highest of its planes", () => {
  const planes = [{normal: [0, 1, 0], offset: 0}, {normal: [-0.6, 0.8, 0], offset: 0}];
  const ground = {planes, boxes: []};
  assert.equal(groundHeight(ground, {x: -1, z: 3}), 0);
  assert.ok(Math.abs(groundHeight(ground, {x: 2, z: 0}) - 1.5) < 1e-12);
  assert.equal(smoothHeight(ground, {x: 2, z: 0}), groundHeight(ground, {x: 2, z: 0}));
});

test("a box is ground within its bounds, and the camera rises to it along a ramp", () => {
  const planes = [{normal: [0, 1, 0], offset: 0}];
  const ground = {planes, boxes: [[0.6, 9, -1, 0.4, 0.2], [0.8, 9, -1, 0.4, 0.1]]};
  assert.equal(groundHeight(ground, {x: 0.7, z: 0.5}), 0.2);
  assert.equal(groundHeight(ground, {x: 0.7, z: -0.5}), 0);
  assert.equal(groundHeight(ground, {x: 0.5, z: 0}), 0);
  const heights = [0.4, 0.5, 0.75, 1, 3].map((x) => smoothHeight(ground, {x, z: 0}));
  [0, 0, 0.1, 0.2, 0.2].forEach((h, i) => assert.ok(Math.abs(heights[i] - h) < 1e-12));
});

test("the camera rises with a robot that flies away, but not with a step or a jump", () => {
  assert.deepEqual([0.1, 0.3, 0.45, 0.6].map((now) => liftOf(0.3, now)), [0, 0, 0, 0]);
  assert.ok(Math.abs(liftOf(0.3, 0.8) - 0.4) < 1e-12);
  assert.equal(liftOf(0.3, 4), 3.7);
  assert.equal(liftOf(0, 0.2), 0);
  assert.equal(liftOf(-0.1, 0.05), 0);
});

test("the camera follows alike at any rate of pictures", () => {
  const remaining = (elapsed) => 1 - followFraction(elapsed);
  assert.ok(Math.abs(remaining(200) - remaining(50) ** 4) < 1e-12);
  assert.equal(followFraction(0), 0);
  assert.equal(followFraction(60000), followFraction(1000)); // a browser that drew nothing
});

test("a picture is smaller in a narrow window, never larger", () => {
  assert.equal(zoomFor(1600, 600), 1);
  assert.ok(zoomFor(600, 600) < 1);
  assert.ok(zoomFor(1600, 600, 100) < 1);
  assert.ok(zoomFor(500, 600) < zoomFor(600, 600));
  assert.equal(zoomFor(10, 2000), 0.2);
  assert.equal(zoomFor(600, 0), 1); // folded
});

test("labels keep their size on the screen until the picture is very small", () => {
  assert.equal(labelScale(0.8) * 0.8, 1);
  assert.equal(labelScale(0.2), 1.5);
});
