// The largest push that the robot survives in each direction, as by `fb.push_recovery`: all pushes
// are multiples of the resolution. Each search begins at the result of the direction before it.

import {STEP, createEngine} from "./engine.js";

const START = 0.2; // s before the push
const SETTLED = 2; // s before it, if the robot first has to walk, lift a foot or move
const OBSERVED = 1.5; // s after it
const MOST = 100; // times the weight: a larger push shows that it does not act

// mj, module, robot: as for `createEngine`. settings: those of the page. directions: angles, rad.
// Yields {direction, push} for each of them, rad and N.
export function* pushRecovery({mj, module, robot, settings, directions, duration,
  resolution}) {
  const engine = createEngine(mj, module, robot), weight = robot.weight / resolution;
  let first = Math.ceil(weight), step = first;
  try {
    for (const direction of directions) {
      const isSurvived = (count) => survives(engine, settings, {
        direction, duration, size: count * resolution,
      });
      const found = largest(isSurvived, first, step, MOST * weight);
      yield {direction, push: resolution * found};
      [first, step] = [Math.max(1, found), 1];
    }
  } finally {
    engine.free();
  }
}

// The largest number that passes, if all smaller ones do: from `first` on with steps that double,
// then by bisection.
export function largest(passes, first, step, most) {
  let passed = 0, failed = Infinity;
  for (let count = first; failed - passed > 1;) {
    if (passes(count)) passed = count;
    else failed = count;
    if (passed > most) break;
    count = failed === Infinity ? passed + step
      : Math.max(Math.floor((passed + failed) / 2), failed - step);
    step *= 2;
  }
  return passed;
}

function survives(engine, settings, {direction, duration, size}) {
  engine.set(settings);
  engine.reset();
  const force = [size * Math.cos(direction), size * Math.sin(direction), 0];
  const {gait, lifted, forward, left, height} = engine.settings;
  const start = gait || lifted || forward || left || height ? SETTLED : START;
  engine.push({force, start, duration}, Infinity);
  const steps = Math.ceil((start + duration + OBSERVED) / STEP - 1e-9);
  for (let i = 0; i < steps; i++) if (engine.step() !== "") return false;
  return true;
}
