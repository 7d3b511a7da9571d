// Which settings and pushes of a live robot are valid. The ranges are those of its controls, in
// floatbase/live/settings.json. The terms of eq. (7) are those of floatbase/live/equation.json.

import terms from "../../../../live/equation.json" with {type: "json"};
import rows from "../../../../live/settings.json" with {type: "json"};

const WEIGHT_PER_MASS = 9.81; // m/s²
const FARTHEST = 10; // m: where a push can act, from the middle of a body
const MOST_SHOWN = 40; // characters of a value in a message
const ROUNDING = 1e-9; // of a vector that was made from its length and direction

export {rows, terms};

// The default settings of the engine. Friction, payload and the terms of eq. (7) that are switched
// off have two values: the one that the controller assumes, and the actual one.
export const defaults = (robot) => ({
  mu: robot.mu, actualMu: robot.mu, payload: 0, actualPayload: 0, gravity: robot.gravity,
  height: 0, forward: 0, left: 0, facets: robot.facets[0], torque: 1, lifted: null,
  gait: null, speed: 0, turn: 0, // m/s and rad/s
  assumedOff: [], actualOff: [], // names of terms
  leg: Object.keys(robot.legs)[0], // whose force the term "forces" switches off
});

// A value or a message that makes no sense; the text says why.
export class Refusal extends Error {}

// Range of a row of the table for a robot, in the row's unit. The largest push is given in robot
// weights, the largest payload in robot masses.
export function rangeOf(key, {weight}) {
  const {low, high, step} = rows[key];
  if (key === "push") {
    const first = Math.max(step, Math.round(rows.push.first * weight));
    return {low, high: 5 * Math.ceil(high * weight / 5), step, first};
  }
  if (key !== "payload") return {low, high, step};
  const heaviest = Math.max(1, Math.round(high * weight / WEIGHT_PER_MASS));
  return {low, high: heaviest, step: heaviest / 20};
}

// Rules: {words, fits(value)}.
export const numberRule = (low, high) => ({
  words: `a number from ${low} to ${high}`,
  fits: (value) => typeof value === "number" && value >= low && value <= high,
});
export const choiceRule = (values) => ({
  words: values.length ? `one of ${values.map(String).join(", ")}` : "left out for this robot",
  fits: (value) => values.includes(value),
});
const termsRule = (part) => {
  const names = terms.filter((term) => term[part]).map(({name}) => name);
  return {
    words: `a list of terms (${names.join(", ")})`,
    fits: (value) => Array.isArray(value) && value.every((name) => names.includes(name)),
  };
};
export const SWITCH = {words: "true or false", fits: (value) => typeof value === "boolean"};
const vectorRule = (most) => ({
  words: `a vector of three numbers${most < Infinity ? `, of at most ${most}` : ""}`,
  fits: (value) => Array.isArray(value) && value.length === 3 && value.every(Number.isFinite)
    && Math.hypot(...value) <= most * (1 + ROUNDING),
});

// Refuse a value that does not follow its rule.
export function check(name, value, {words, fits}) {
  if (!fits(value)) throw new Refusal(refusalText(name, value, words));
}
export const refusalText = (name, value, words) => `${name} must be ${words}, not ${shown(value)}.`;

// Refuse what is no object with some of these names.
export function checkNames(given, names, what) {
  if (Object.prototype.toString.call(given) !== "[object Object]") {
    throw new Refusal(`A ${what} must be an object, not ${shown(given)}.`);
  }
  for (const name of Object.keys(given)) {
    if (!names.includes(name)) {
      throw new Refusal(`A ${what} has no ${shown(name)}, only ${names.join(", ")}.`);
    }
  }
}

function checkEach(given, rules, what) {
  checkNames(given, Object.keys(rules), what);
  for (const [name, value] of Object.entries(given)) check(name, value, rules[name]);
}

function shown(value) {
  if (Array.isArray(value)) return "this list";
  if (typeof value === "object" && value !== null) return "this object";
  return typeof value === "string" ? `"${value.slice(0, MOST_SHOWN)}"` : String(value);
}

// Feet that the robot can lift.
export const liftedFeet = ({problems}) =>
  [...new Set(Object.values(problems).map(({lifted}) => lifted).filter(Boolean))];

// Refuse changes of the engine's settings that make no sense. robot: its data.
export function checkSettings(changes, robot) {
  const row = (key) => {
    const {low, high} = rangeOf(key, robot), {scale = 1} = rows[key];
    return numberRule(low * scale, high * scale);
  };
  const gaits = robot.walking?.gaits ?? {};
  const fastest = [0, 1].map((i) => Math.max(0, ...Object.values(gaits).map(({most}) => most[i])));
  checkEach(changes, {
    mu: row("friction"), actualMu: row("friction"),
    payload: row("payload"), actualPayload: row("payload"), gravity: row("gravity"),
    height: row("com_z"), forward: row("com_x"), left: row("com_y"),
    facets: choiceRule(robot.facets), torque: row("torque_limits"),
    lifted: choiceRule([null, ...liftedFeet(robot)]),
    gait: choiceRule([null, ...Object.keys(gaits)]),
    speed: numberRule(-fastest[0], fastest[0]), turn: numberRule(-fastest[1], fastest[1]),
    assumedOff: termsRule("assumed_switch"), actualOff: termsRule("actual_switch"),
    leg: choiceRule(Object.keys(robot.legs)),
  }, "change of the settings");
}

// Refuse a push that makes no sense. most: N, the largest force.
export function checkPush(push, robot, most = rangeOf("push", robot).high) {
  checkEach(push, {
    body: choiceRule(robot.bodies), at: vectorRule(FARTHEST), force: vectorRule(most),
    start: numberRule(0, Number.MAX_SAFE_INTEGER),
    duration: numberRule(rows.duration.low, rows.duration.high),
  }, "push");
}
