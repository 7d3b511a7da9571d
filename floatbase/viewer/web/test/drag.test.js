import assert from "node:assert/strict";
import test from "node:test";
import {pushOf, sliderDrag} from "../src/drag.js";

test("a way of the pointer is a push in its direction, and no larger than the largest", () => {
  assert.deepEqual(pushOf({x: 0.5, z: 0}, 1, 300), {force: 150, towards: 0});
  const left = pushOf({x: 0, z: -4}, 1, 300); // our y is -z there
  assert.equal(left.force, 300);
  assert.ok(Math.abs(left.towards - 90) < 1e-12);
});

test("a push has whole newtons, as the slider of a push has", () => {
  assert.equal(pushOf({x: 0.1234, z: 0}, 1, 60).force, 7);
});

const control = (value, calls, name) => ({
  getMax: () => 9, getValue: () => value, fire: () => calls.push(name),
  setValue: (now) => calls.push([name, (value = now)]), release: (now) => calls.push([name, now]),
});

test("a drag needs the force and the direction; a push of an address leaves the sliders", () => {
  const calls = [], controls = {};
  for (const [name, value] of [["push [N]", 1], ["duration [s]", 3], ["push", 0]]) {
    controls[name] = control(value, calls, name);
  }
  assert.ok(!sliderDrag(controls).isWanted());
  controls["towards [°]"] = control(2, calls, "towards [°]");
  const drag = sliderDrag(controls);
  assert.ok(drag.isWanted());
  drag.push([7, 8, 9]);
  assert.deepEqual(calls.slice(0, 3), [["towards [°]", 8], ["duration [s]", 9], ["push [N]", 7]]);
  assert.deepEqual(drag.now().slice(1), [2, 3]);
});
