import assert from "node:assert/strict";
import test from "node:test";
import {
  copyGreys, darkShades, hasDarkLetters, isLight, toChannels, toCode, toNumber,
} from "../src/colours.js";

const CONFIG = {
  backgrounds: {
    light: ["#FBFCFE", "#DFE5EC", "#BCC5CF", "#222222"],
    dark: ["#1E2227", "#282C32", "#4B525A", "#F2F2F2"],
  },
  shades: {"#0072B2": "#1C80C0"},
};

test("codes, numbers and channels are the same colour", () => {
  assert.equal(toNumber("#0072B2"), 0x0072b2);
  assert.equal(toCode(0x0072b2), "#0072b2");
  assert.deepEqual(toChannels(0x1e2227), [0x1e, 0x22, 0x27]);
});

test("the dark has shades of the named colours, of the paper, its lines and its text", () => {
  assert.deepEqual([...darkShades(CONFIG, "light")].map((pair) => pair.map(toCode)), [
    ["#0072b2", "#1c80c0"], ["#bcc5cf", "#4b525a"], ["#222222", "#f2f2f2"],
    ["#fbfcfe", "#1e2227"],
  ]);
  for (const [colour, shade] of darkShades(CONFIG, "dark")) {
    if (colour !== 0x0072b2) assert.equal(shade, colour);
  }
});

test("words are light or dark in all the ways that a style gives their colour", () => {
  for (const light of ["rgb(238, 238, 238)", "rgba(255, 255, 255, 0.8)", "color(srgb 1 1 1)"]) {
    assert.ok(isLight(light), light);
  }
  for (const dark of ["rgb(34, 34, 34)", "rgba(0, 0, 0, 1)", "color(srgb 0.2 0.2 0.2)"]) {
    assert.ok(!isLight(dark), dark);
  }
  assert.ok(isLight("rgb(0, 255, 0)") && !isLight("rgb(255, 0, 255)")); // as eyes see it
});

test("a label with dark letters is inverted in the dark and comes back", () => {
  const label = Uint8Array.of(255, 255, 20, 255, 0, 0), shown = label.slice();
  assert.ok(hasDarkLetters(label));
  copyGreys(label, shown, true);
  assert.deepEqual(shown, Uint8Array.of(0, 255, 235, 255, 255, 0));
  copyGreys(label, shown, false);
  assert.deepEqual(shown, label);
});

test("a label with light letters stays, whatever its transparent pixels are", () => {
  assert.ok(!hasDarkLetters(Uint8Array.of(240, 255, 0, 0, 10, 200)));
});
