import assert from "node:assert/strict";
import test from "node:test";
import {pushOf} from "../src/drag.js";

test("a way of the pointer is a push in its direction, and no larger than the largest", () => {
  assert.deepEqual(pushOf({x: 0.5, z: 0}, 1, 300), {force: 150, towards: 0});
  const left = pushOf({x: 0, z: -4}, 1, 300); // our y is -z there
  assert.equal(left.force, 300);
  assert.ok(Math.abs(left.towards - 90) < 1e-12);
});

test("a push has whole newtons, as the slider of a push has", () => {
  assert.equal(pushOf({x: 0.1234, z: 0}, 1, 60).force, 7);
});
