import assert from "node:assert/strict";
import test from "node:test";
import {createSequence} from "../src/sequence.js";

test("frames are drawn in order once the page has said hello", () => {
  const sequence = createSequence();
  assert.equal(sequence.receive(1), "skip");
  sequence.begin();
  assert.deepEqual([1, 2, 3].map(sequence.receive), ["draw", "draw", "draw"]);
  assert.deepEqual([sequence.nextDrawn(), sequence.nextDrawn()], [1, 2]);
});

test("a frame that got lost has the page loaded anew, once", () => {
  const sequence = createSequence();
  sequence.begin();
  sequence.receive(1);
  assert.equal(sequence.receive(3), "reload");
  sequence.lose();
  assert.ok(sequence.isLost());
  assert.deepEqual([4, 5].map(sequence.receive), ["skip", "skip"]);
  sequence.begin();
  assert.equal(sequence.receive(1), "draw");
  assert.equal(sequence.nextDrawn(), 1);
});

test("frames of an earlier connection are skipped before the first of a new one", () => {
  const sequence = createSequence();
  sequence.begin();
  assert.deepEqual([17, 18, 1, 2].map(sequence.receive), ["skip", "skip", "draw", "draw"]);
});
