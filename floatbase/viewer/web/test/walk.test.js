import assert from "node:assert/strict";
import test from "node:test";
import {liftsLater, nextLiftOff, phasesOf, stanceAt, swingAt} from "../src/engine/gait.js";
import {moved, pendulum, planeThrough} from "../src/engine/walk.js";
import {knobAt, motionText} from "../src/live/joystick.js";

const gait = {offsets: {a: 0, b: 0.5}, period: 1, swing: 0.4, start: 2, stop: Infinity};

test("feet swing at their times, and no longer after the gait has stopped", () => {
  assert.deepEqual(swingAt(gait, "a", 2.1), [2, 2.4]);
  assert.equal(swingAt(gait, "a", 1.9), null);
  assert.deepEqual(stanceAt(gait, 2.6), ["a"]);
  assert.equal(nextLiftOff(gait, "b", 2.6), 3.5);
  const stopped = {...gait, stop: 2.2};
  assert.deepEqual(swingAt(stopped, "a", 2.3), [2, 2.4]); // it comes down as planned
  assert.ok(!liftsLater(stopped, 2.3) && liftsLater(gait, 2.3));
});

test("phases follow one another, and an endless stance ends the list", () => {
  const phases = phasesOf(gait, 1.5, 3, 5);
  assert.deepEqual(phases.map(({stance}) => stance.join("")), ["ab", "b", "ab"]);
  assert.ok(phases.every(({begin}, i) => i === 0 || begin === phases[i - 1].end));
  assert.deepEqual(phasesOf({...gait, stop: 0}, 1, 3, 5),
    [{begin: 1, end: 6, stance: ["a", "b"]}]);
});

test("the path reaches its velocity at the largest acceleration", () => {
  const path = {time: 0, position: [0, 0], yaw: 0, velocity: [0, 0, 0]};
  const desired = {first: [0, 0, 0], later: [0.5, 0, 0], firstUntil: 0, begin: 0};
  const {position: [x, y], velocity} = moved(path, desired, [1, 1, 1], 2, Math);
  assert.ok(Math.abs(x - (0.125 + 0.75)) < 1e-12 && y === 0);
  assert.deepEqual(velocity, [0.5, 0, 0]);
});

test("a plane passes through points on it", () => {
  const points = [[0, 0, 1], [1, 0, 1.2], [0, 2, 0.6], [3, 1, 1.4]];
  const {slope, level} = planeThrough(points);
  [0.2, -0.2].forEach((expected, i) => assert.ok(Math.abs(slope[i] - expected) < 1e-12));
  assert.ok(Math.abs(level - 1) < 1e-12);
});

test("the pendulum begins at the centre of mass and comes to rest above its last point", () => {
  const segments = [{begin: 0, end: 0.5, from: [0, 0], to: [0.1, 0]},
    {begin: 0.5, end: 1, from: [0.1, 0], to: [0.1, 0.05]}];
  const rows = pendulum(segments, [0.02, 0.01], 5, Math);
  const [, px, , , , ax, , bx] = rows[0];
  assert.ok(Math.abs(px + ax + bx - 0.02) < 1e-12);
  const [begin, x, y, , , growX, growY] = rows.at(-1);
  assert.deepEqual([begin, x, y, growX, growY], [1, 0.1, 0.05, 0, 0]);
});

test("the joystick's middle is the middle, its edge the largest velocity", () => {
  assert.deepEqual(knobAt(1, -40, 40), [0, 1]);
  assert.deepEqual(knobAt(-80, 20, 40), [-1, -0.5]);
  assert.equal(motionText(0, 0), "on the spot");
  assert.equal(motionText(0.3, -0.5), "0.30 m/s forwards, 29°/s to the right");
});
