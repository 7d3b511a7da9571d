// Sentences about the live robot: what limits it now.

import {isInAir} from "../engine/contacts.js";

const SIDES = {L: "left", R: "right"}, ENDS = {F: "front", R: "rear", H: "rear"};
const WEAK = 1e-4; // a multiplier: a smaller one hardly changes the motion
const MOST_NAMES = 2; // in a sentence
const IN_AIR = 1; // rank of the sentence about flight, which is no limit
const LOW = 0.75; // of its height: a lower robot does not stand
const CALM = 7; // rank of a sentence that names no limit

// "FL_foot" -> "front left foot", "left_sole_link corner 1" -> "left foot".
export function footName(name) {
  const [, end, side] = /^([FRH])([LR])_/i.exec(name) ?? [];
  if (end) return `${ENDS[end.toUpperCase()]} ${SIDES[side.toUpperCase()]} foot`;
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
  return end ? `${ENDS[end]} ${SIDES[side]} ${rest.toLowerCase()} joint`
    : name.replaceAll("_", " ");
}

function list(names) {
  const unique = [...new Set(names)];
  if (unique.length > MOST_NAMES) {
    return `${unique.slice(0, MOST_NAMES).join(", ")} and ${unique.length - MOST_NAMES} more`;
  }
  return unique.join(" and ");
}

// "The front left foot is", "The front left foot and the rear left foot are".
function subject(names) {
  const unique = [...new Set(names)].map((name) => `the ${name}`), text = list(unique);
  return `${text[0].toUpperCase()}${text.slice(1)} ${unique.length > 1 ? "are" : "is"}`;
}

const STOPPED = {
  fell: "The robot fell. It will be back on its feet in a moment.",
  "left the ground": "The robot left the ground. It will be back on its feet in a moment.",
  "no answer": "The controller of this page has no answer in this state. The Python library " +
    "has a slower method for it. The robot will be back on its feet in a moment.",
};

const kindOf = ([kind]) => kind.replace(/^(upper|lower) /, "");
const ownerOf = ([kind, owner]) => (kind.includes("joint") || kind.includes("torque")
  ? jointName(owner) : footName(owner));

// What stopped a controller without an answer. conflict: [kind, owner, number], see what_if.js.
function conflictText(conflict) {
  const kinds = [...new Set(conflict.map(kindOf))].map((kind) => {
    const owners = conflict.filter((one) => kindOf(one) === kind).map(ownerOf);
    return `${kind} of the ${list(owners)}`;
  });
  return `These constraints cannot hold together: ${kinds.join("; ")}. ` +
    "The robot will be back on its feet in a moment.";
}

// The conflict in full, a line for each kind.
export function conflictLines(conflict) {
  const kinds = [...new Set(conflict.map(([kind]) => kind))].map((kind) => {
    const those = conflict.filter((one) => one[0] === kind);
    const names = those.map((one) => (
      kind === "friction" ? `${ownerOf(one)} (facet ${one[2] + 1})` : ownerOf(one)));
    return `${those.length} × ${kind}: ${names.join(", ")}`;
  });
  return ["In conflict. Without any one of these constraints, the others can hold:", ...kinds]
    .join("\n");
}

// What limits the robot: {rank, text}. The least rank is the most important. frame: what the worker
// sends. robot: its summary. before: the sentence about the limit just before the robot fell.
export function limitOf(frame, robot, before = "") {
  if (frame.outcome) {
    const slipped = frame.hasSlipped ? "The feet slipped. " : "";
    const text = frame.conflict.length ? conflictText(frame.conflict) : STOPPED[frame.outcome];
    const reason = slipped || frame.conflict.length || !before ? "" : `\nJust before: ${before}`;
    return {rank: 0, text: slipped + (text ?? frame.outcome) + reason};
  }
  if (isInAir(frame, robot)) {
    return {rank: IN_AIR, text: "The robot is in the air: the ground exerts no force on its feet."};
  }
  const slipping = frame.slipping.map(footName);
  if (slipping.length) {
    return {rank: 2, text: `${subject(slipping)} slipping: the ground gives less friction than ` +
      "the controller plans with."};
  }
  const owners = (part) => frame.seen
    .filter(([kind, , , multiplier]) => kind.endsWith(part) && multiplier > WEAK)
    .filter(([kind]) => kind !== "largest normal force") // before a foot lifts off
    .map(([, owner]) => owner);
  const motors = owners("torque limit").map(jointName);
  if (motors.length) {
    const many = new Set(motors).size > 1;
    return {rank: 3, text: `${subject(motors)} at ${many ? "their torque limits" :
      "its torque limit"}.`};
  }
  const unloaded = new Set(owners("normal force").map(footName));
  const gripping = owners("friction").map(footName).filter((name) => !unloaded.has(name));
  if (gripping.length) {
    const many = new Set(gripping).size > 1;
    return {rank: 4, text: `${subject(gripping)} at ${many ? "their friction limits" :
      "its friction limit"}.`};
  }
  if (unloaded.size) {
    return {rank: 5, text: `${subject([...unloaded])} unloaded: a foot can push on the ground, ` +
      "but not pull."};
  }
  const joints = owners("joint limit").filter((name) => !robot.resting.includes(name))
    .map(jointName);
  if (joints.length) {
    const many = new Set(joints).size > 1;
    return {rank: 6, text: `${subject(joints)} near the end of ${many ? "their ranges" :
      "its range"}.`};
  }
  const calm = frame.height < LOW ? "The robot is too low" : frame.settings.gait
    ? "The robot walks" : "The robot stands";
  return {rank: CALM, text: `${calm}: no foot and no motor is at a limit.`};
}

export const isLimit = ({rank}) => rank > IN_AIR && rank < CALM;

// Sentences that stay long enough to be read, `stays` ms. Of those in the meantime, the most
// important one is said.
export function createVoice(say, period = 600) {
  let best = null, next = 0;
  return ({rank, text, stays = period}, now) => {
    if (best === null || rank < best.rank) best = {rank, text, stays};
    if (now < next) return;
    say(best.text);
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
