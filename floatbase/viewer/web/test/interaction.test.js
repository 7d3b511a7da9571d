import assert from "node:assert/strict";
import test from "node:test";
import {actionOf, createWheelOwner} from "../src/interaction.js";

test("arrows turn, plus and minus approach, h goes home, space plays, others do nothing", () => {
  assert.ok(actionOf("ArrowLeft").orbit.aside < 0 && actionOf("ArrowDown").orbit.down > 0);
  assert.ok(actionOf("+").orbit.distance < 1);
  assert.equal(actionOf("+").orbit.distance * actionOf("-").orbit.distance, 1);
  assert.equal(actionOf("h").view, "default");
  assert.ok(actionOf(" ").play);
  for (const key of ["a", "Escape", "Tab", "constructor"]) assert.equal(actionOf(key), undefined);
});

test("the wheel is the page's until the reader clicks into the picture, or with Ctrl", () => {
  const owner = createWheelOwner(), wheel = {ctrlKey: false};
  assert.ok(!owner.isPictures(wheel) && owner.isPictures({ctrlKey: true}));
  for (const leave of [() => owner.keyDown({key: "Escape"}), owner.pointerLeave]) {
    owner.pointerDown({pointerType: "mouse"});
    owner.keyDown({key: "a"});
    assert.ok(owner.isPictures(wheel));
    leave();
    assert.ok(!owner.isPictures(wheel));
  }
});

test("a finger does not enter a picture", () => {
  const owner = createWheelOwner();
  owner.pointerDown({pointerType: "touch"});
  assert.ok(!owner.isPictures({ctrlKey: false}));
});
