// What the control step would answer if its constraints were different.

import {NO_ANSWER} from "./tick.js";

const UNBOUNDED = 1e9; // N and N·m: a limit that is never reached

// Functions that take one constraint out of the step: [{row, remove()}]. row: its number. Both
// torque limits of a joint go together, and `row` is the upper one.
function constraints({views, problem}, {d}) {
  const {floats, inputs} = views, {parameters, points, rows} = problem;
  const {cones, torqueLimits, bounds} = parameters;
  const perPoint = rows.findIndex(([kind]) => kind === "largest normal force") / points.length;
  return rows.slice(0, (perPoint + 1) * points.length + d).map(([kind], row) => ({
    row,
    remove() {
      const point = Math.floor(row / perPoint);
      if (kind === "friction" || kind === "normal force") {
        floats.fill(0, cones + 5 * row, cones + 5 * row + 3);
        if (kind === "normal force") inputs[bounds + point] = -UNBOUNDED;
      } else if (kind === "largest normal force") {
        inputs[bounds + points.length + row - perPoint * points.length] = UNBOUNDED;
      } else floats[torqueLimits + row - (perPoint + 1) * points.length] = UNBOUNDED;
    },
  }));
}

// The smallest conflict of a step without an answer: constraints that cannot hold together, while
// without any one of them the others can. Each is left out in turn, and stays out if the rest is
// still in conflict. Returns [kind, owner, number] of each.
export function smallestConflict(tick, robot) {
  const {views, problem} = tick, {nv, d} = robot;
  return tick.probe(() => {
    const isInfeasible = () => tick.run() === NO_ANSWER.infeasible;
    const kept = [];
    for (const each of constraints(tick, robot)) {
      const isNeeded = tick.probe(() => {
        each.remove();
        return !isInfeasible();
      });
      if (isNeeded) kept.push(each);
      else each.remove();
    }
    // a torque without its limits passes the one that is in conflict
    return kept.map(({row, remove}) => {
      const [kind, owner, number] = problem.rows[row];
      if (!kind.endsWith("torque limit")) return [kind, owner, number];
      const joint = robot.jointNames.indexOf(owner);
      const isLower = tick.probe(() => {
        remove();
        tick.run();
        return views.result[nv + joint] < 0;
      });
      return problem.rows[isLower ? row + d : row];
    });
  });
}

// What 1 N more friction at a contact point would bring: {now, then}, how far the acceleration of
// the base is from the one that it would have without limits, m/s², and `cost`, by which the cost
// would fall, to first order. null if no facet of the point is active. active: as of the engine.
export function frictionValue(tick, robot, name, active) {
  const {views, problem} = tick, {nv, d} = robot, {parameters, flags} = problem;
  const point = problem.points.indexOf(name), facets = active.filter(
    ([kind, owner, , multiplier]) => kind === "friction" && owner === name && multiplier > 0,
  );
  if (point < 0 || !facets.length) return null;
  const perPoint = problem.rows.filter(([, owner]) => owner === name).length - 1;
  const {floats, result} = views, first = parameters.cones + 5 * perPoint * point;
  const normal = result[nv + d + 3 * point + 2];
  const across = (facet) => Math.hypot(floats[first + 5 * facet], floats[first + 5 * facet + 1]);
  const accelerationOf = (change) => tick.probe(() => {
    change();
    return tick.run() >= 0 ? [...result.subarray(0, 3)] : null;
  });
  const free = accelerationOf(() => {
    views.sizes[flags.cones] = 0n;
    for (const {remove} of constraints(tick, robot)) remove();
  });
  const moved = accelerationOf(() => { // all facets of the point, by 1 N
    for (let i = 0; i < perPoint - 1; i++) floats[first + 5 * i + 2] -= across(i) / normal;
  });
  if (free === null || moved === null) return null;
  const far = (acceleration) => Math.hypot(...acceleration.map((x, i) => x - free[i]));
  return {
    now: far([...result.subarray(0, 3)]), then: far(moved),
    cost: facets.reduce((sum, [, , facet, multiplier]) => sum + multiplier * across(facet), 0),
  };
}
