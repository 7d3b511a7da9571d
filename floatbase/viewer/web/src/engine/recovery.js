// The largest push that the robot survives in each direction, by the same bisection as
// `fb.push_recovery`: all pushes are multiples of the resolution.

import {STEP, createEngine} from "./engine.js";

const START = 0.2; // s before the push
const OBSERVED = 1.5; // s after it
const MOST = 100; // times the weight: a larger push shows that it does not act

// mj, module, robot: as for `createEngine`. settings: those of the page. directions: angles, rad.
// Yields {direction, push} for each of them, rad and N.
export async function* pushRecovery({mj, module, robot, settings, directions, duration,
  resolution}) {
  const engine = createEngine(mj, module, robot);
  try {
    for (const direction of directions) {
      yield {direction, push: resolution * largest(engine, robot, settings, {
        direction, duration, resolution,
      })};
      await new Promise((go) => { setTimeout(go); }); // messages, such as one to stop
    }
  } finally {
    engine.free();
  }
}

function largest(engine, robot, settings, given) {
  let survived = 0, fatal = Math.ceil(robot.weight / given.resolution);
  while (survives(engine, settings, given, fatal)) {
    [survived, fatal] = [fatal, 2 * fatal];
    if (fatal * given.resolution > MOST * robot.weight) break;
  }
  while (fatal - survived > 1) {
    const middle = Math.floor((survived + fatal) / 2);
    if (survives(engine, settings, given, middle)) survived = middle;
    else fatal = middle;
  }
  return survived;
}

function survives(engine, settings, {direction, duration, resolution}, count) {
  engine.set(settings);
  engine.reset();
  const size = count * resolution;
  const force = [size * Math.cos(direction), size * Math.sin(direction), 0];
  engine.push({force, start: START, duration});
  const steps = Math.ceil((START + duration + OBSERVED) / STEP - 1e-9);
  for (let i = 0; i < steps; i++) if (engine.step() !== "") return false;
  return true;
}
