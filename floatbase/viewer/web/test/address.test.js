import assert from "node:assert/strict";
import test from "node:test";
import {isKept, readHash, textOf, valueOf, writeHash} from "../src/address.js";

const gait = {name: "gait", value: 0, choices: ["stand", "trot"], section: "walking"};
const facets = {name: "facets", value: 4, min: 3, max: 16, section: "quadratic program"};
const foot = {name: "lift FL", value: false, section: "stance"};

test("a value survives the way through the address", () => {
  for (const [command, value] of [[gait, 1], [facets, 7], [foot, false], [foot, true]]) {
    assert.equal(valueOf(command, textOf(command, value)), value);
  }
  const hash = writeHash([["CoM x [cm]", "-2"], ["a & b", "c=d"]]);
  assert.deepEqual([...readHash(hash)], [["CoM x [cm]", "-2"], ["a & b", "c=d"]]);
  assert.equal(writeHash([]), "");
  assert.equal(readHash("").size, 0);
});

test("a text that is no value of the control is ignored", () => {
  for (const [command, text] of [
    [gait, "hop"], [gait, "1"], [facets, "many"], [facets, ""], [facets, "Infinity"],
    [foot, "maybe"], [foot, "constructor"],
  ]) assert.equal(valueOf(command, text), undefined);
});

test("controls at the top of the panel and buttons are not in the address", () => {
  assert.ok([gait, facets, foot, {name: "g", value: true, term: "g", part: "model"}].every(isKept));
  assert.ok(!isKept({name: "push [N]", value: 1, min: 0, max: 9, on_release: true}));
  assert.ok(!isKept({name: "challenge", value: 0, choices: ["a"], section: ""}));
  assert.ok(!isKept({name: "b", section: "stance"}));
});
