import assert from "node:assert/strict";
import test from "node:test";
import {plotText, polyline, withPoint} from "../src/plot.js";

test("a plot keeps eight seconds and begins anew when time goes back", () => {
  let points = [];
  for (const t of [0, 3, 7.9, 8.5]) points = withPoint(points, t, t);
  assert.deepEqual(points, [[3, 3], [7.9, 7.9], [8.5, 8.5]]);
  assert.deepEqual(withPoint(points, 0.1, 5), [[0.1, 5]]);
});

test("its line ends at the right and has its peak below the upper edge", () => {
  const line = polyline([[0, 0], [4, 22], [8, 11]], 560, 110);
  assert.deepEqual(line.map(([x]) => x), [0, 280, 560]);
  const [low, peak] = line.map(([, y]) => y);
  assert.equal(low, 106);
  assert.ok(peak > 4 && peak < 20);
  assert.equal(polyline([[0, 0]], 560, 110)[0][1], 106); // all zeros
});

test("its text says the value now and the largest", () => {
  const points = [[0, 12.34], [1, 0.04]], name = "forces differ by";
  assert.equal(
    plotText({name, value: 0.04, unit: "N"}, points),
    "forces differ by: 0 N (at most 12 in the last 8 s)",
  );
  assert.match(plotText({name, value: 3.21, unit: "N"}, points), /^forces differ by: 3\.2 N/);
});
