import assert from "node:assert/strict";
import test from "node:test";
import {createUnseen} from "../src/meshcat.js";

test("an item that hardly moves is not drawn again, until it has moved farther", () => {
  const isUnseen = createUnseen(), path = "/a";
  const at = (x) => ({type: "set_transform", path, matrix: [1, 0, x]});
  assert.ok(!isUnseen(at(0)));
  assert.ok(isUnseen(at(5e-6)));
  assert.ok(!isUnseen(at(8e-5)));
  assert.ok(!isUnseen({type: "set_object", path}));
  assert.ok(!isUnseen({type: "delete", path: ""}));
  assert.ok(!isUnseen(at(8e-5))); // it was made again
  assert.ok(!isUnseen({type: "set_animation", path: "", animations: []}));
  assert.ok(!isUnseen(at(8e-5))); // the animation has moved it
});
