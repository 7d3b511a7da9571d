// Sentences about the live robot: what limits it now.

import {isInAir} from "../engine/contacts.js";
import table from "../../../../live/limits.json" with {type: "json"};

export const WEAK = 1e-4; // a multiplier: a smaller one hardly changes the motion
const IN_AIR = 1; // rank of the sentence about flight, which is no limit
const REASON_TIME = 1; // s before a fall in which a limit may be its reason
const CALM = table.limits.length + 2; // rank of a sentence that names no limit

// "FL_foot" -> "front left foot", "left_sole_link corner 1" -> "left foot".
export function footName(name) {
  const [, end, side] = /^([FRH])([LR])_/i.exec(name) ?? [];
  if (end) return `${table.ends[end.toUpperCase()]} ${table.sides[side.toUpperCase()]} foot`;
  const [human] = /left|right/.exec(name) ?? [];
  return human ? `${human} foot` : name;
}

// "left_sole_link corner 1" -> "left foot, corner 2": the name of a contact point.
export function pointName(name) {
  const [, corner] = / corner (\d+)$/.exec(name) ?? [];
  return corner ? `${footName(name)}, corner ${Number(corner) + 1}` : footName(name);
}

// "FL_calf_joint" -> "front left calf joint", "leg_left_4_joint" -> "leg left 4 joint".
export function jointName(name) {
  const [, end, side, rest] = /^([FRH])([LR])_(.+?)(?:_joint)?$/.exec(name) ?? [];
  return end ? `${table.ends[end]} ${table.sides[side]} ${rest.toLowerCase()} joint`
    : name.replaceAll("_", " ");
}

// "A", "A and B", "A, B and 3 more".
function list(names) {
  const most = table.most_names, more = names.length - most;
  return more > 0 ? `${names.slice(0, most).join(", ")} and ${more} more` : names.join(" and ");
}

const STOPPED = {
  fell: "The robot fell. It will be back on its feet in a moment.",
  "left the ground": "The robot left the ground. It will be back on its feet in a moment.",
  "no answer": "The controller of this page has no answer in this state. The Python library " +
    "has a slower method for it. The robot will be back on its feet in a moment.",
};

const ownerOf = ([kind, owner]) => (kind.includes("joint") || kind.includes("torque")
  ? jointName(owner) : footName(owner));

// What stopped a controller without an answer. conflict: [kind, owner, number], see what_if.js.
function conflictText(conflict) {
  const all = conflict.map((one) => (
    `${one[0].replace(/^(upper|lower) /, "")} of the ${ownerOf(one)}`));
  return "Feet and motors cannot keep all limits at once: " +
    `${list([...new Set(all)])} conflict. ` +
    "The robot will be back on its feet in a moment.";
}

// The conflict in full, a line for each kind.
export function conflictLines(conflict) {
  const kinds = [...new Set(conflict.map(([kind]) => kind))].map((kind) => {
    const those = conflict.filter((one) => one[0] === kind);
    const names = those.map((one) => (
      kind === "friction" ? `${ownerOf(one)} (facet ${one[2] + 1})` : ownerOf(one)));
    return `${those.length} × ${kind}: ${[...new Set(names)].join(", ")}`;
  });
  return ["In conflict. Without any one of these constraints, the others can hold:", ...kinds]
    .join("\n");
}

// What limits the robot: {rank, text}. The least rank is the most important. frame: what the worker
// sends. robot: its summary. before: the sentence about the limit just before the robot fell.
function limitOf(frame, robot, before = "") {
  if (frame.outcome) {
    const slipped = frame.hasSlipped ? "The feet slipped. " : "";
    const text = frame.conflict.length ? conflictText(frame.conflict) : STOPPED[frame.outcome];
    const reason = slipped || frame.conflict.length || !before ? "" : ` Just before: ${before}`;
    return {rank: 0, text: slipped + (text ?? frame.outcome) + reason};
  }
  if (isInAir(frame, robot)) return {rank: IN_AIR, text: table.air};
  const owners = (part) => frame.seen
    .filter(([kind, , , multiplier]) => kind.endsWith(part) && multiplier > WEAK)
    .filter(([kind]) => kind !== "largest normal force") // before a foot lifts off
    .map(([, owner]) => owner);
  const unloaded = owners("normal force").map(footName);
  const found = {
    slipping: frame.slipping.map(footName), torque: owners("torque limit").map(jointName), unloaded,
    friction: owners("friction").map(footName).filter((name) => !unloaded.includes(name)),
    range: owners("joint limit").filter((name) => !robot.resting.includes(name)).map(jointName),
  };
  const rank = table.limits.findIndex(([key]) => found[key].length);
  if (rank < 0) {
    const state = frame.settings.gait ? "walks" : "stands";
    return {rank: CALM, text: table[frame.height < table.low_height ? "low" : state]};
  }
  const [key, one, several] = table.limits[rank], names = [...new Set(found[key])];
  const subject = `The ${list(names.map((name, i) => (i ? `the ${name}` : name)))}`;
  return {rank: rank + 2, text: `${subject} ${names.length > 1 ? several : one}`};
}

// Returns a function of each frame that says what limits the robot, or limited it before its fall.
export function watchLimits(robot) {
  let before = null; // the last limit
  return (frame) => {
    if (frame.time < before?.time) before = null; // the robot is back on its feet
    const limit = limitOf(frame, robot, before?.text);
    if (frame.outcome) return limit;
    const {rank} = limit;
    if (rank > IN_AIR && rank < CALM) before = {...limit, time: frame.time};
    else if (frame.time > before?.time + REASON_TIME) before = null;
    return limit;
  };
}

// Sentences that stay long enough to be read, `stays` ms, unless a more important one follows. Of
// those in the meantime, the most important one is said.
export function createVoice(say, period = 600) {
  let best = null, next = 0, said = {rank: Infinity};
  return ({rank, text, stays = period}, now) => {
    if (best === null || rank < best.rank) best = {rank, text, stays};
    if (now < next && best.rank >= said.rank) return;
    if (best.text !== said.text) say(best.text);
    said = best;
    next = now + best.stays;
    best = null;
  };
}

// The active constraints and their multipliers, the largest first.
export function multiplierText(all) {
  const active = all.filter(([, , , multiplier]) => multiplier > WEAK);
  if (!active.length) return "No active constraints.";
  const lines = active.map(([kind, owner, number, value]) => {
    const name = ownerOf([kind, owner]);
    const facet = kind === "friction" ? ` (facet ${number + 1})` : "";
    return {value, text: `${kind}${facet}, ${name}: ${value.toPrecision(2)}`};
  });
  const shown = lines.sort((a, b) => b.value - a.value).slice(0, 6).map(({text}) => text);
  const more = active.length - shown.length;
  const rest = more ? [`and ${more} more`] : [];
  return ["Multipliers of active constraints:", ...shown, ...rest].join("\n");
}
