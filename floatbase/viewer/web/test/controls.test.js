import assert from "node:assert/strict";
import test from "node:test";
import {createReports, digits, isUndo, kindOf, rowOf, sliderText} from "../src/controls.js";

test("a command's fields say which control it is", () => {
  assert.equal(kindOf({value: 0.5, min: 0, max: 1, step: 0.1}), "slider");
  assert.equal(kindOf({value: 1, choices: ["a", "b"]}), "choice");
  assert.equal(kindOf({value: false}), "checkbox");
  assert.equal(kindOf({}), "button");
  assert.equal(kindOf({value: true, term: "M q̈", part: "shown"}), "toggle");
});

test("two columns of a name are one row, and rows of two sections are two", () => {
  const [model, reality] = ["model", "reality"].map(
    (column) => rowOf({name: `friction ${column}`, column, section: "ground"}),
  );
  assert.deepEqual(model, {label: "friction", key: "ground/friction"});
  assert.deepEqual(reality, model);
  assert.deepEqual(rowOf({name: "__proto__"}), {label: "__proto__", key: "/__proto__"});
});

test("Ctrl+Z and ⌘Z undo, Z alone and Ctrl+Shift+Z do not", () => {
  assert.ok(isUndo({key: "z", ctrlKey: true}) && isUndo({key: "Z", metaKey: true}));
  assert.ok(!isUndo({key: "z"}) && !isUndo({key: "Z", ctrlKey: true, shiftKey: true}));
});

test("a slider shows the digits of its step, and a word for its largest value", () => {
  assert.deepEqual([1, 0.5, 0.1, 0.05, 0.002, 1e-9, 0, 10].map(digits), [0, 1, 1, 2, 3, 6, 0, 0]);
  assert.equal(sliderText({value: 0.7, max: 1, step: 0.05}), "0.70");
  assert.equal(sliderText({value: 20, max: 20, step: 1, at_most: "perfect"}), "perfect");
  assert.equal(sliderText({value: 19, max: 20, step: 1, at_most: "perfect"}), "19");
});

test("a page moves no control for its own older reports, and for all others", () => {
  const sent = [], {report, isNews} = createReports((message) => sent.push(message), "me");
  report("force", 1);
  report("force", 2);
  assert.deepEqual(sent[1], {type: "control", name: "force", value: 2, by: "me"});
  assert.ok(!isNews({name: "force", value: 1, by: "me"}));
  assert.ok(isNews({name: "force", value: 2, by: "me"}));
  assert.ok(isNews({name: "force", value: 1, by: "another"}));
  assert.ok(isNews({name: "force", value: 1}));
});
