import assert from "node:assert/strict";
import test from "node:test";
import {isCrowded, isFewer, shadedItems} from "../src/legend.js";

// a legend 220 pixels wide and 100 high at the lower left
const crowded = (width, height, more = {}) => isCrowded({
  lines: {right: 220, top: height - 100, bottom: height}, player: null, titleBottom: 30,
  width, height, ...more,
});

test("a legend is open where it is beside what the camera looks at", () => {
  assert.ok(!crowded(1000, 480));
  assert.ok(!crowded(1300, 600));
});

test("a legend is folded where it would cover it, or the title", () => {
  assert.ok(crowded(420, 360));
  assert.ok(crowded(590, 480));
  assert.ok(crowded(1300, 160));
  assert.ok(crowded(1300, 320));
  assert.ok(crowded(1000, 480, {titleBottom: 400}));
});

test("a player takes room from a legend", () => {
  assert.ok(crowded(1300, 600, {player: {left: 200}}));
  assert.ok(!crowded(1300, 600, {player: {left: 400}}));
});

test("only entries that disappear, and no new ones, are fewer", () => {
  const [a, b] = [["#a", "force", "line"], ["#b", "cone", "cone"]];
  assert.ok(isFewer([a], [a, b]));
  assert.ok(isFewer([], [a]));
  assert.ok(!isFewer([a, b], [a, b]));
  assert.ok(!isFewer([["#c", "push", "patch"]], [a, b]));
});

test("items are shown in the theme's shades, and each colour once", () => {
  const items = [["#a", "force", "line"], ["#b", "cone"], ["#a", "another"]];
  assert.deepEqual(shadedItems(items, (colour) => `dark ${colour}`), {
    shaded: [["dark #a", "force", "line"], ["dark #b", "cone"], ["dark #a", "another"]],
    colours: ["dark #a", "dark #b"],
  });
});
