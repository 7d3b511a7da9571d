import assert from "node:assert/strict";
import test from "node:test";
import {difference, over} from "../src/difference.js";

const KEYS = [
  ["/meshcat/arrow", "set_object"], ["/meshcat/arrow", "set_transform"],
  ["/meshcat/arrow", "set_property"], ["/meshcat/arrow/label", "set_object"],
  ["/", "set_title"], ["", "set_animation"],
];
const scene = (...commands) => over(new Map(), commands.flatMap(
  (command, key) => command === null ? [] : [key, command],
));

test("changes replace and delete commands and leave the first scene as it was", () => {
  const first = scene(10, 11, 12);
  assert.deepEqual([...over(first, [1, 21, 2, -1])], [[0, 10], [1, 21]]);
  assert.equal(first.size, 3);
});

test("two equal scenes differ in nothing", () => {
  const one = scene(10, 11, 12, 13, 14);
  assert.deepEqual(difference(one, new Map(one), KEYS), {ended: false, gone: [], commands: []});
});

test("commands come in the order in which they can be done", () => {
  const goal = over(new Map(), [5, 15, 4, 14, 2, 12, 1, 11, 0, 10]);
  assert.deepEqual(difference(new Map(), goal, KEYS).commands, [10, 11, 12, 14, 15]);
});

test("a new shape gets its properties again", () => {
  const now = scene(10, 11, 12), goal = scene(20, 11, 12);
  assert.deepEqual(difference(now, goal, KEYS).commands, [20, 12]);
});

test("what is below a deleted path is drawn again", () => {
  const now = scene(10, 11, 12, 13), goal = scene(null, null, null, 13);
  const found = difference(now, goal, KEYS);
  assert.deepEqual(found, {ended: false, gone: ["/meshcat/arrow"], commands: [13]});
});

test("an animation ends when another or none follows", () => {
  const [one, same, other] = [15, 15, 25].map((number) => new Map([[5, number]]));
  assert.deepEqual([same, other, new Map()].map((goal) => difference(one, goal, KEYS).ended),
    [false, true, true]);
  assert.equal(difference(new Map(), one, KEYS).ended, false);
});
