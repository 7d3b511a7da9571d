// Sentences about the live robot: what limits it now.

const SIDES = {L: "left", R: "right"}, ENDS = {F: "front", R: "rear", H: "hind"};
const SLIPPING = 0.97; // fraction of the actual friction limit
const WEAK = 1e-4; // a multiplier: a smaller one hardly changes the motion
const MISSED = 0.25; // fraction of the weight on one foot: a smaller difference is contact softness

// "FL_foot" -> "front left foot", "left_sole_link corner 1" -> "left foot".
export function footName(name) {
  const [, end, side] = /^([FRH])([LR])_/i.exec(name) ?? [];
  if (end) return `${ENDS[end.toUpperCase()]} ${SIDES[side.toUpperCase()]} foot`;
  const [human] = /left|right/.exec(name) ?? [];
  return human ? `${human} foot` : name;
}

// "FL_calf_joint" -> "front left calf joint", "leg_left_4_joint" -> "leg left 4 joint".
export function jointName(name) {
  const [, end, side, rest] = /^([FRH])([LR])_(.+?)(?:_joint)?$/.exec(name) ?? [];
  return end ? `${ENDS[end]} ${SIDES[side]} ${rest.toLowerCase()} joint`
    : name.replaceAll("_", " ");
}

function list(names) {
  const unique = [...new Set(names)];
  if (unique.length < 2) return unique.join("");
  return `${unique.slice(0, -1).join(", ")} and ${unique.at(-1)}`;
}

// "The front left foot is", "The front left foot and the rear left foot are".
function subject(names) {
  const unique = [...new Set(names)].map((name) => `the ${name}`), text = list(unique);
  return `${text[0].toUpperCase()}${text.slice(1)} ${unique.length > 1 ? "are" : "is"}`;
}

// Feet whose measured force is at the actual friction limit, and far from the planned force.
export function slippingFeet({measured, planned, settings}, {points, weight}) {
  return points.filter((_, i) => {
    const [x, y, z] = measured.subarray(3 * i, 3 * i + 3);
    const away = Math.hypot(...[0, 1, 2].map((c) => planned[3 * i + c] - measured[3 * i + c]));
    return z > 0 && Math.hypot(x, y) > SLIPPING * settings.actualMu * z
      && away > MISSED * weight / points.length;
  }).map(footName);
}

const STOPPED = {
  fell: "The robot fell. It is put on its feet again in a moment.",
  "left the ground": "The robot left the ground. It is put on its feet again in a moment.",
  infeasible: "No torques satisfy all the constraints, so the controller stopped. The Python " +
    "library names the constraints that are in conflict. The robot is put on its feet again in a " +
    "moment.",
  "no answer": "The controller of this page has no answer in this state. The Python library " +
    "has a slower method for it. The robot is put on its feet again in a moment.",
};

// What limits the robot: {rank, text}. The least rank is the most important. frame: what the worker
// sends. robot: its summary.
export function limitOf(frame, robot) {
  if (frame.outcome) return {rank: 0, text: STOPPED[frame.outcome] ?? frame.outcome};
  const slipping = slippingFeet(frame, robot);
  if (slipping.length) {
    return {rank: 1, text: `${subject(slipping)} slipping: the ground gives less friction than ` +
      "the controller plans with."};
  }
  const owners = (part) => frame.seen
    .filter(([kind, , , multiplier]) => kind.endsWith(part) && multiplier > WEAK)
    .filter(([kind]) => kind !== "largest normal force") // before a foot lifts off
    .map(([, owner]) => owner);
  const motors = owners("torque limit").map(jointName);
  if (motors.length) {
    const many = new Set(motors).size > 1;
    return {rank: 2, text: `${subject(motors)} at ${many ? "their torque limits" :
      "its torque limit"}.`};
  }
  const unloaded = new Set(owners("normal force").map(footName));
  const gripping = owners("friction").map(footName).filter((name) => !unloaded.has(name));
  if (gripping.length) {
    const many = new Set(gripping).size > 1;
    return {rank: 3, text: `${subject(gripping)} at ${many ? "their friction limits" :
      "its friction limit"}.`};
  }
  if (unloaded.size) {
    return {rank: 4, text: `${subject([...unloaded])} unloaded: a foot can push on the ground, ` +
      "but not pull."};
  }
  const joints = owners("joint limit").map(jointName);
  if (joints.length) return {rank: 5, text: `${subject(joints)} near the end of its range.`};
  return {rank: 6, text: "No constraint is active: every force is inside its friction cone."};
}

// Sentences that stay long enough to be read. Of those within one period, the most important one is
// said.
export function createVoice(say, period = 600) {
  let best = null, next = 0;
  return ({rank, text}, now) => {
    if (best === null || rank < best.rank) best = {rank, text};
    if (now < next) return;
    say(best.text);
    best = null;
    next = now + period;
  };
}

// The active constraints and their multipliers, the largest first.
export function multiplierText(active) {
  if (!active.length) return "No active constraints.";
  const all = active.map(([kind, owner, number, value]) => {
    const name = kind.includes("torque") || kind.includes("joint") ? jointName(owner)
      : footName(owner);
    const facet = kind === "friction" ? ` (facet ${number + 1})` : "";
    return {value, text: `${kind}${facet}, ${name}: ${value.toPrecision(2)}`};
  });
  const shown = all.sort((a, b) => b.value - a.value).slice(0, 6).map(({text}) => text);
  const more = active.length - shown.length;
  const rest = more ? [`and ${more} more`] : [];
  return ["Multipliers of active constraints:", ...shown, ...rest].join("\n");
}
