import assert from "node:assert/strict";
import test from "node:test";
import {challenges, createJudge} from "../src/engine/challenges.js";
import {createClock} from "../src/engine/clock.js";
import {createHistory} from "../src/engine/history.js";
import {
  checkPush, checkSettings, choiceRule, defaults, numberRule, rangeOf, rows, terms,
} from "../src/engine/settings.js";
import {numberOf} from "../src/controls.js";
import {readAddress} from "../src/live/attributes.js";
import {setParameter} from "../src/engine/tick.js";
import {controlsOf, labelOf} from "../src/live/controls.js";
import {footText, nearestFacet, polygon} from "../src/live/foot_view.js";
import {arrowMatrix, coneStatus} from "../src/live/painter.js";
import {largest} from "../src/engine/recovery.js";
import {briefly, deal, mapText, outline, ringsFor, wayOf} from "../src/live/recovery_map.js";
import {multiplierText} from "../src/live/words.js";

test("a clock gives the steps of the time that has passed, in slow motion too", () => {
  const clock = createClock(1e-3);
  assert.equal(clock.steps(1000), 0);
  assert.equal(clock.steps(1016), 16);
  clock.setScale(0.25);
  assert.equal(clock.steps(1032), 4);
});

test("with slow pictures the clock slows down, so that a push of 0.1 s is seen in several", () => {
  const clock = createClock(1e-3);
  clock.steps(0);
  assert.equal(clock.steps(100), 100);
  assert.equal(clock.steps(400), 100);
  let pictures = 0;
  for (let gone = 0, now = 400; gone < 100; pictures++) gone += clock.steps(now += 250, true);
  assert.ok(pictures >= 3);
  clock.done(30, 1);
  assert.ok(clock.factor < 1);
});

test("a paused clock gives single steps only", () => {
  const clock = createClock(1e-3);
  clock.steps(0);
  clock.pause(true);
  clock.single();
  assert.equal(clock.steps(16), 1);
  assert.equal(clock.steps(32), 0);
});

test("a machine that is too slow does not catch up, and the factor says so", () => {
  const clock = createClock(1e-3);
  clock.steps(0);
  for (let now = 100; now <= 20000; now += 100) {
    assert.equal(clock.steps(now), 100);
    clock.done(50, 85);
  }
  assert.ok(Math.abs(clock.factor - 0.5) < 0.01);
});

test("a page that was out of sight has stood still", () => {
  const clock = createClock(1e-3);
  clock.steps(0);
  assert.equal(clock.steps(60000), 0);
});

test("parameters set the numbers that depend on them", () => {
  const numbers = new Float64Array(4);
  setParameter(numbers, {at: [1], base: [2], slope: [-3], lengthAt: [3], lengthBase: [1],
    lengthSlope: [0.5]}, 2);
  assert.deepEqual([...numbers], [0, -4, 0, Math.sqrt(3)]);
});

test("an arrow begins at its point and ends along its vector", () => {
  const sizes = {size: 1, slenderness: 0.1, arrowLength: 0.2};
  for (const vector of [[0, 0, 2], [1, -2, 0.5]]) {
    const matrix = arrowMatrix([1, 2, 3], vector, sizes);
    assert.deepEqual(matrix.slice(12, 15), [1, 2, 3]);
    assert.deepEqual(matrix.slice(8, 11), vector);
    const across = matrix[0] * vector[0] + matrix[1] * vector[1] + matrix[2] * vector[2];
    assert.ok(Math.abs(across) < 1e-12);
  }
});

test("a force is inside its cone, outside, or nothing", () => {
  assert.equal(coneStatus([0, 6, 10], 0.7, 0.1), "inside");
  assert.equal(coneStatus([0, 8, 10], 0.7, 0.1), "outside");
  assert.equal(coneStatus([0, 0, 0.01], 0.7, 0.1), "idle");
});

test("the label of a map has few settings", () => {
  assert.equal(briefly("standing, facets 8, CoM x [cm] 2"), "standing, facets 8, CoM x [cm] 2");
  assert.equal(briefly("trot, 0.3 m/s, facets 8, CoM x [cm] 2, CoM y [cm] 1"),
    "trot, 0.3 m/s, facets 8 and 2 more");
});

test("a control has its name, its symbol and its unit", () => {
  assert.equal(labelOf(rows.com_x), "CoM x [cm]");
  assert.equal(labelOf(rows.friction), "friction μ");
  assert.equal(labelOf(rows.facets), "facets");
});

test("controls begin at the settings of the engine and change what they name", () => {
  const data = {
    weight: 100, mu: 0.7, gravity: 9.81, facets: [4, 8], gaits: {trot: {}},
    legs: ["FL_foot", "RR_foot"], points: ["FL_foot", "RR_foot"],
  };
  const settings = defaults({...data, legs: {FL_foot: [], RR_foot: []}});
  const push = {force: 30, towards: 90, duration: 0.1};
  const chosen = [], drawn = [];
  const made = Object.fromEntries(controlsOf({...data, lifted: ["FL_foot"]}, settings, push, {
    names: ["go2"], name: "go2", open() {}, walk: (gait) => { chosen.push(gait); },
    draw: (...term) => { drawn.push(term); },
  }).map((control) => [control.command.name, control]));
  for (const {command, shown} of Object.values(made)) {
    if (shown) assert.equal(command.value, shown(settings));
  }
  for (const [name, setting] of [["friction μ model", "mu"], ["friction μ reality", "actualMu"],
    ["payload [kg] model", "payload"], ["gravity g [m/s²]", "gravity"]]) {
    assert.equal(made[name].command.value, settings[setting]);
  }
  assert.deepEqual(made["payload [kg] reality"].change(2), {set: {actualPayload: 2}});
  for (const [name, setting] of [["torque limits [%]", "torque"], ["CoM x [cm]", "forward"],
    ["CoM y [cm]", "left"], ["CoM z [cm]", "height"]]) {
    const {command, change} = made[name], {value, min, max} = command;
    assert.deepEqual(change(value), {set: {[setting]: settings[setting]}});
    assert.deepEqual(change(min), {set: {[setting]: 0.01 * min}});
    assert.ok(min < max);
  }
  assert.equal(made["push [N]"].change(55), undefined); // the button pushes
  assert.equal(push.force, 55);
  assert.deepEqual(made.facets.change(1), {set: {facets: 8}});
  assert.deepEqual(made.lift.change(1), {set: {lifted: "FL_foot"}});
  made.gait.change(1);
  made.gait.change(0);
  assert.deepEqual(chosen, ["trot", null]);
  assert.deepEqual(made["leg of Jᵀλ"].change(1), {set: {leg: "RR_foot"}});
  made["show gravity"].change(true);
  assert.deepEqual(drawn, [["gravity", true]]);
});

test("the board has every term, and a switch keeps the other terms of its side", () => {
  const page = {
    weight: 100, facets: [4], gaits: {}, lifted: [], legs: ["FL_foot"], points: ["FL_foot"],
  };
  const settings = defaults({mu: 0.7, gravity: 9.81, facets: [4], legs: {FL_foot: []}});
  const calls = {names: [], name: "", open() {}, walk() {}, draw() {}};
  const made = controlsOf(page, settings, {}, calls).filter(({command}) => command.term);
  const control = (name) => made.find(({command}) => command.name === name);
  for (const term of terms) {
    const parts = made.filter(({command}) => command.term === term.symbol)
      .map(({command}) => command.part);
    const expected = ["shown", ...(term.assumed_switch ? ["model"] : []),
      ...(term.actual_switch ? ["reality"] : [])];
    assert.deepEqual(parts, expected);
  }
  const inModel = control("gravity in the model");
  assert.deepEqual(inModel.change(false), {set: {assumedOff: ["gravity"]}});
  assert.deepEqual(control("drift of the contacts in the model").change(false),
    {set: {assumedOff: ["gravity", "drift"]}});
  assert.equal(inModel.shown({...settings, assumedOff: ["cones"]}), true); // after "undo"
  assert.deepEqual(inModel.change(false), {set: {assumedOff: ["cones", "gravity"]}});
  assert.deepEqual(control("gravity in reality").change(false), {set: {actualOff: ["gravity"]}});
  assert.match(control("show zeros").command.description, /playground/);
  assert.ok(control("show zeros").command.disabled && !control("show gravity").command.disabled);
});

test("undo restores the settings before a change, and a moving slider is one change", () => {
  const history = createHistory();
  history.remember({mu: 1}, {mu: 2}, 0);
  history.remember({mu: 2}, {mu: 3}, 500);
  history.remember({mu: 3}, {torque: 0.5}, 600);
  history.remember({mu: 3, torque: 0.5}, {torque: 0.5}, 5000); // changes nothing
  assert.deepEqual(history.undo({mu: 3, torque: 0.5}), {mu: 3});
  assert.deepEqual(history.undo({mu: 3}), {mu: 1});
  assert.equal(history.undo({mu: 1}), null);
});

const go2 = {
  weight: 150, points: [{name: "FL_foot"}, {name: "FR_foot"}], facets: [4, 8], bodies: [0, 1, 2],
  problems: {"all/4": {lifted: null}, "FL_foot/4": {lifted: "FL_foot"}},
  walking: {gaits: {trot: {most: [0.6, 0.8]}, walk: {most: [0.2, 0.15]}}}, mu: 0.7, gravity: 9.81,
  legs: {FL_foot: ["FL_foot"], FR_foot: ["FR_foot"]},
};

test("a judge names what must not be changed in the words of the controls", () => {
  const start = defaults(go2), pushes = [];
  const changed = {...start, payload: 1, torque: 0.5, assumedOff: ["gravity"], actualMu: 0.2};
  const said = challenges.map((challenge) => {
    const judge = createJudge(challenge, start);
    judge.observe({time: 0, span: 1, feet: [], facets: [], pushes}, changed);
    return judge.status.message;
  });
  const most = said.find((text) => /torque/.test(text));
  assert.match(most, /payload.* terms of the model.*torque limits/);
  assert.ok(said.some((text) => /friction in reality/.test(text)));
  for (const text of said) assert.doesNotMatch(text, /_|Off/);
});

test("a very short push is no large one, but it is a push", () => {
  const judges = Object.fromEntries(challenges.map((challenge) => (
    [challenge.judge, createJudge(challenge, defaults(go2))])));
  const sample = {time: 0, span: 1, feet: [], facets: []};
  for (const duration of [0.05, 0.1]) {
    for (const name of ["survive", "topple"]) {
      judges[name].push({force: [300, 0, 0], duration});
      judges[name].observe(sample, defaults(go2));
    }
    const said = judges.survive.status.message;
    assert.match(said, duration < 0.1 ? /^Push the robot/ : /^Standing/);
  }
  assert.match(judges.topple.status.message, /more than one push/);
});

test("both ends of every control are valid settings, and what is beyond them is refused", () => {
  checkSettings(defaults(go2), go2);
  const push = {force: 30, towards: 90, duration: 0.1}, page = {...go2, lifted: ["FL_foot"],
    legs: Object.keys(go2.legs), points: Object.keys(go2.legs), gaits: go2.walking.gaits};
  const made = controlsOf(page, defaults(go2), push, {
    names: ["go2"], name: "go2", open() {}, walk: (gait) => ({set: {gait}}),
    draw() {}, watch() {},
  });
  const names = made.map(({command: {name, column = ""}}) => name.replace(column, "").trim());
  for (const row of Object.values(rows).filter(({low, section, places}) =>
    (low !== undefined || section) && places.includes("live"))) {
    assert.ok(names.includes(labelOf(row)), `the page has no control ${labelOf(row)}`);
  }
  let beyond = 0;
  for (const {command: {min, max, choices, value}, change} of made) {
    const ends = choices ? choices.map((_, i) => i) : min === undefined ? [!value] : [min, max];
    for (const end of ends) checkSettings(change(end)?.set ?? {}, go2);
    if (min === undefined || !change(max)?.set) continue;
    beyond++;
    for (const end of [min - 1e-3, max + 1e-3]) {
      assert.throws(() => checkSettings(change(end).set, go2), /must be a number from/);
    }
  }
  assert.ok(beyond >= 9);
});

test("the largest push of the slider is the largest push in each direction", () => {
  const {high} = rangeOf("push", go2), push = {duration: 0.1, start: 0, at: [0, 0, 0], body: 1};
  assert.equal(high, 375);
  for (let towards = -180; towards <= 180; towards += 5) {
    const angle = towards * Math.PI / 180;
    checkPush({...push, force: [high * Math.cos(angle), high * Math.sin(angle), 0]}, go2);
  }
  assert.throws(() => checkPush({...push, force: [1, high, 0]}, go2), /of at most 375/);
});

test("attributes that make no sense are refused in words and count as not given", () => {
  const gaits = choiceRule(["trot", "walk"]), friction = numberRule(0.05, 1.5);
  const sensible = readAddress("?gait=trot&mu=0.6&push=");
  assert.equal(sensible.read("gait", gaits), "trot");
  assert.equal(sensible.read("mu", friction, numberOf), 0.6);
  assert.equal(sensible.read("push", friction, numberOf), undefined); // empty
  assert.equal(sensible.read("panel", gaits), undefined); // not given
  assert.deepEqual(sensible.refused, []);
  for (const gait of ["constructor", "__proto__", "toString", "Trot", "trot ", "hop", "0"]) {
    const odd = readAddress(new URLSearchParams({gait}));
    assert.equal(odd.read("gait", gaits), undefined);
    assert.match(odd.refused[0], /^gait must be one of trot, walk, not "/);
  }
  for (const mu of ["Infinity", "NaN", "1e308", "-0.5", "0", "0x1", "0,6", "0.6 N", "−1", "∞"]) {
    const odd = readAddress(new URLSearchParams({mu}));
    assert.equal(odd.read("mu", friction, numberOf), undefined);
    assert.match(odd.refused[0], /^mu must be a number from 0.05 to 1.5, not "/);
  }
});

test("a robot without gaits cannot walk", () => {
  assert.throws(() => checkSettings({gait: "trot"}, {...go2, walking: null}), /gait must be/);
  assert.throws(() => checkSettings({speed: 0.1}, {...go2, walking: null}), /speed must be/);
  checkSettings({gait: null, speed: 0}, {...go2, walking: null});
});

test("the polygon of a foot is that of its facets, and knows the nearest one", () => {
  const facets = [[1, 0, -0.5], [0, 1, -0.5], [-1, 0, -0.5], [0, -1, -0.5]]; // a square
  const corners = polygon(facets, 10);
  for (const at of corners) for (const x of at) assert.ok(Math.abs(Math.abs(x) - 5) < 1e-9);
  assert.equal(new Set(corners.map((at) => at.map(Math.sign).join())).size, 4);
  const {distance, facet} = nearestFacet(facets, [1, -4, 10]);
  assert.ok(facet === 3 && Math.abs(distance - 1) < 1e-12);
  assert.match(footText(facets, [1, -4, 10], null, 1), /1.0 N inside .*facet 4/);
  const worth = {now: 2, then: 1.5, cost: 0.12};
  assert.match(footText(facets, [1, -5, 10], worth, 1), /0.50 m\/s² closer .* 2.0 .* 0.12/);
  assert.match(footText(facets, [0, 0, 0], null, 1), /no force/);
});

test("the largest multipliers come first", () => {
  const lines = multiplierText([["friction", "FL_foot", 0, 0.1],
    ["upper torque limit", "FL_calf_joint", 0, 2]]).split("\n");
  assert.match(lines[1], /torque.*2\.0/);
  assert.match(lines[2], /facet 1.*0\.10/);
});

test("directions are dealt to all workers, each once", () => {
  const hands = deal(16, 3);
  assert.equal(new Set(hands.flat()).size, 16);
  assert.ok(hands.every((hand) => hand.length >= 5));
});

test("a search finds the largest number that passes, wherever it begins", () => {
  for (const answer of [0, 1, 7, 38, 39, 200]) {
    for (const [first, step] of [[30, 30], [1, 1], [38, 1], [60, 1]]) {
      let tried = 0;
      const passes = (count) => { tried++; return count <= answer; };
      assert.equal(largest(passes, first, step, 1e4), answer);
      assert.ok(tried <= 2 + 2 * Math.log2(2 + Math.abs(answer - first)), `${tried} tries`);
    }
  }
  assert.ok(largest(() => true, 30, 30, 100) > 100);
});

test("a map grows around its centre and closes when it is complete", () => {
  const found = [{direction: Math.PI / 2, push: 20}, {direction: 0, push: 10}];
  const points = outline(found, [1, 1], 0.1, false);
  assert.deepEqual(points[0].slice(0, 2), [2, 1]);
  assert.ok(Math.abs(points[1][1] - 3) < 1e-12);
  assert.equal(outline(found, [1, 1], 0.1, true).length, 3);
  assert.match(mapText(found, "standing", 1), /from 10 N \(forwards\) to 20 N \(left\)/);
  const ways = [-170, -90, -20, 30, 180].map((degrees) => wayOf((degrees + 360) * Math.PI / 180));
  assert.deepEqual(ways, ["backwards", "right", "forwards", "forwards left", "backwards"]);
});

test("a few round rings measure every push", () => {
  for (const most of [1, 3, 7, 24, 40, 41, 99, 100, 255, 260, 1900]) {
    const rings = ringsFor(most);
    assert.ok(rings.length >= 1 && rings.length <= 4, `${most}: ${rings}`);
    assert.ok(rings.at(-1) <= most && most < 2 * rings.at(-1) + 1, `${most}: ${rings}`);
  }
});
