import assert from "node:assert/strict";
import test, {mock} from "node:test";
import {
  createAddress, isKept, numbersOf, readHash, refusalOf, textOf, valueOf, writeHash,
} from "../src/address.js";

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

test("a text that is no value of the control is refused in words", () => {
  for (const [command, text, words] of [
    [gait, "hop", /one of stand, trot/], [gait, "1", /one of/], [gait, "constructor", /one of/],
    ...["many", "", " ", "Infinity", "NaN", "1e308", "0x10", "0b11", "2", "17", "-4", "7 N", "7,5",
      "constructor", "x".repeat(999)].map((odd) => [facets, odd, /from 3 to 16, not ".{0,40}"/]),
    [foot, "maybe", /on or off/], [foot, "constructor", /on or off/], [foot, "true", /on or off/],
  ]) {
    assert.equal(valueOf(command, text), undefined, text);
    assert.match(refusalOf(command, text), words);
  }
  for (const text of ["3", "16", "+7.5", "1e1", " 4 "]) {
    assert.equal(valueOf(facets, text), Number(text));
  }
});

test("buttons, hidden sliders and links to pages are not in the address", () => {
  const push = {name: "push [N]", value: 1, min: 0, max: 9, on_release: true};
  const term = {name: "g", value: true, term: "g", part: "model"};
  assert.ok([gait, facets, foot, term, push].every(isKept));
  assert.ok(isKept({name: "challenge", value: 0, choices: ["a"], section: ""}));
  assert.ok(!isKept({...push, is_hidden: true}));
  assert.ok(!isKept({name: "robot", value: 0, choices: ["a", "b"], opens_page: true}));
  assert.ok(!isKept({name: "b", section: "stance"}));
});

test("a view or a push in the address is a list of numbers, or nothing", () => {
  assert.deepEqual(numbersOf("1,-2.5, 3e1", 3), [1, -2.5, 30]);
  for (const text of ["", "1,2", "1,2,3,4", "1,2,x", "1,2,Infinity", "1,2,1e9", "1;2;3", "1,,2"]) {
    assert.equal(numbersOf(text, 3), undefined, text);
  }
});

test("a key that is no control is refused, and a control that is added late has its value", () => {
  Object.assign(globalThis, {
    location: {hash: "#facets=7&gait=trot&gai=hop", pathname: "/", search: ""},
    history: {replaceState: (_, __, address) => { globalThis.location.hash = address.slice(1); }},
    addEventListener() {},
  });
  mock.timers.enable({apis: ["setTimeout"]});
  const values = {facets: 4, gait: 0}, said = [];
  const controls = Object.fromEntries(Object.keys(values).map((name) => [name, {
    getValue: () => values[name], setValue: (value) => { values[name] = value; },
  }]));
  const address = createAddress(controls, (text) => said.push(text));
  address.added(facets);
  address.apply();
  address.changed();
  mock.timers.tick(500); // the address is written
  address.added(gait);
  values.gait = 1; // the window has this value already
  controls.gait.setValue = () => assert.fail("the window would hear the value again");
  address.apply();
  mock.timers.tick(1000);
  mock.timers.reset();
  for (const key of ["location", "history", "addEventListener"]) delete globalThis[key];
  assert.deepEqual(values, {facets: 7, gait: 1});
  assert.match(said.join(), /no control "gai".*Similar names: gait\./);
});
