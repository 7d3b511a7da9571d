// The challenges of floatbase/live/challenges.json that a live robot can judge, as
// floatbase/playground/challenges.py does.

import table from "../../../../live/challenges.json" with {type: "json"};

const {limits, words} = table;
export const challenges = table.challenges.filter(({live}) => live);
// settings of the playground -> those of the page, assumed and actual value of a pair
const PAGE_SETTINGS = {
  mass: ["payload", "actualPayload", "gravity"], friction: ["mu", "actualMu"],
  assumed_off: ["assumedOff"], actual_off: ["actualOff"], facets: ["facets"],
  com_shift: ["forward", "left", "height"], lifted_feet: ["lifted"], gait: ["gait"],
  torque_fraction: ["torque"],
};
const ONE_PUSH_ONLY = "That was more than one push. Reset, and push only once.";

const sizeOf = ({force}) => Math.hypot(...force);
// The largest force of a push, without very short ones; null before the first.
const largest = (pushes) => pushes.filter(({duration}) => duration >= limits.push_time)
  .reduce((most, push) => Math.max(most, sizeOf(push)), null);

// Functions watch(sample, memory, held): true when the challenge is solved, otherwise its status.
// held(holds): for how long a condition has held without interruption, s.
const WATCHES = {
  survive({pushes}, memory, held) {
    const size = largest(pushes);
    if (size === null) return "Push the robot with 300 N in any direction.";
    if (size < limits.survived_push - limits.force_rounding) {
      return `${size.toFixed(0)} N is not enough.`;
    }
    const time = held(true);
    return time >= limits.survival_time || `Standing for ${time.toFixed(1)} s.`;
  },
  on_an_edge({feet, facets}) {
    const counts = feet.filter(({planned}) => planned[2] > limits.min_load).map(({planned: f}) => (
      facets.filter(([x, y, z]) => (
        x * f[0] + y * f[1] + z * f[2] > -limits.facet_tolerance * f[2])).length));
    const most = Math.max(0, ...counts);
    return most >= 2 || `Most active facets at one foot: ${most}.`;
  },
  infeasible: () => "The quadratic program has been feasible at every control step.",
  quick_foot({feet, time}, memory, held) {
    const front = Math.max(...feet.filter(({name}) => name.startsWith("F")).map((foot) => (
      foot.height)));
    if (memory.up === undefined) {
      if (feet.every(({stands, load}) => stands && load > limits.min_load)) memory.all = time;
      if (front <= limits.lifted_height || memory.all === undefined) {
        return "Lift a front foot 2 cm, and stand on the other three for one second.";
      }
      memory.up = time - memory.all;
    }
    const up = held(front > limits.lifted_height), took = memory.up.toFixed(2);
    if (up === 0) {
      delete memory.up;
      return "The foot came down again.";
    }
    if (memory.up >= limits.lifting_time) return `Lifting took ${took} s. Reset, and lean first.`;
    memory.score = `${took} s.`;
    return up >= limits.lifted_time || `Lifted in ${took} s, in the air for ${up.toFixed(1)} s.`;
  },
  on_ice({feet, pushes}, memory, held) {
    const size = largest(pushes), places = feet.map(({at}) => at);
    memory.places ??= places;
    if (size === null || size < limits.ice_push - limits.force_rounding) {
      memory.places = places;
      return size === null ? "Push the robot with 10 N." : "Push with at least 10 N.";
    }
    const slips = places.map((at, i) => Math.hypot(...at.map((x, k) => x - memory.places[i][k])));
    const moved = Math.max(...slips), shown = 1e3 * moved;
    if (moved > limits.ice_slip) return `A foot has slipped by ${shown.toFixed(0)} mm. Reset.`;
    const time = held(true);
    return time >= limits.survival_time
      || `No foot has slipped more than ${shown.toFixed(1)} mm for ${time.toFixed(1)} s.`;
  },
  topple: ({pushes}) => pushes.length > 1 ? ONE_PUSH_ONLY
    : "Topple the robot with one push, as small as possible.",
};
// The same when the run has stopped: end(outcome, pushes, memory).
const ENDS = {
  infeasible: (outcome) => outcome === "infeasible"
    || `The run ended for another reason: ${outcome}`,
  topple(outcome, pushes, memory) {
    if (outcome !== "fell" || !pushes.length) return "A push must make the robot fall.";
    if (pushes.length > 1) return ONE_PUSH_ONLY;
    const impulse = sizeOf(pushes[0]) * pushes[0].duration, shown = impulse.toFixed(1);
    memory.score = `${shown} N·s.`;
    return impulse <= limits.toppling_impulse || `${shown} N·s toppled the robot. From the right ` +
      `side, ${limits.toppling_impulse.toFixed(0)} N·s are enough.`;
  },
};

// The settings with which a challenge starts, as a change of the default ones.
export const startOf = ({start = {}}) => Object.fromEntries(Object.entries(start).flatMap(
  ([name, values]) => PAGE_SETTINGS[name].map((key, i) => [key, values[i]]),
));

// A judge that watches a run from one reset to the next. start: the settings at the beginning.
export function createJudge({judge, text, locked, locked_actual: actual = []}, start) {
  const memory = {}, pushes = [];
  let message = "", isWon = false, violation = "", time = 0;
  const held = (holds, span) => {
    time = holds ? time + span : 0;
    return time;
  };
  const isChanged = (settings) => (key) => (
    JSON.stringify(settings[key]) !== JSON.stringify(start[key]));
  function violations(settings) {
    const keys = (name) => PAGE_SETTINGS[name] ?? [], changed = isChanged(settings);
    return [
      ...locked.filter((name) => keys(name).some(changed))
        .map((name) => words[name] ?? name.replaceAll("_", " ")),
      ...actual.filter((name) => changed(keys(name).at(-1))).map((name) => `${name} in reality`),
    ];
  }
  function apply(verdict, settings) {
    if (isWon) return;
    const changed = violations(settings);
    if (changed.length) {
      violation = `${changed.join(" and ")} must not be changed in this challenge. ` +
        'Press "reset everything".';
    }
    if (violation) message = violation;
    else if (verdict === true) {
      isWon = true;
      message = `Solved. ${memory.score ?? ""}`.trim();
    } else message = verdict;
  }
  return {
    get status() { return {text, message, isWon}; },
    push(push) { pushes.push(push); },
    // sample: see `sampleOf`. settings: present ones.
    observe(sample, settings) {
      const verdict = WATCHES[judge]({...sample, pushes}, memory,
        (holds) => held(holds, sample.span));
      apply(verdict, settings);
    },
    ended(outcome, settings) {
      if (ENDS[judge]) apply(ENDS[judge](outcome, pushes, memory), settings);
    },
  };
}

// What a judge looks at after steps that took `span` s.
export function sampleOf(engine, robot, span) {
  const {problem} = engine.tick, {geom_xpos: places} = engine.actual.data;
  const [measured, planned] = [engine.measuredForces(), engine.plannedForces()];
  const feet = robot.points.map(({name, geom, radius}, i) => {
    const at = [...places.subarray(3 * geom, 3 * geom + 3)];
    return {
      name, at, height: at[2] - radius, load: measured[3 * i + 2],
      planned: [...planned.subarray(3 * i, 3 * i + 3)], stands: problem.points.includes(name),
    };
  });
  return {time: engine.time, span, feet, facets: engine.facets()};
}
