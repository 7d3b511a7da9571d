// A walk in the page. At each change of stance it plans footholds and the motion of the centre of
// mass, as `Walk` in floatbase/behaviours does for a robot on four point feet. Between two changes,
// the compiled `write_targets` gives the targets of all tasks. Vectors in the world frame, m.

import {liftsLater, phasesOf, stanceAt, swingAt} from "./gait.js";

const UNBOUNDED = 1e6; // N: a force that no foot reaches

const rotated = ([x, y], yaw, {sin, cos}) => [
  cos(yaw) * x - sin(yaw) * y, sin(yaw) * x + cos(yaw) * y,
];
const add = ([a, b], [x, y], factor = 1) => [a + factor * x, b + factor * y];
const mean = (points) => [0, 1].map(
  (i) => points.reduce((sum, point) => sum + point[i], 0) / points.length,
);

// The path of the body at a later time: {time, position, yaw, velocity}; velocity: forwards and to
// the left, m/s, and yaw rate, rad/s. math: sin and cos, as for all functions here; those of
// JavaScript differ between browsers.
export function moved(path, {first, later, firstUntil, begin}, acceleration, t, math) {
  const goal = t < firstUntil ? first : later;
  const duration = Math.max(0, t - Math.max(path.time, begin));
  const velocity = [], way = [];
  for (let i = 0; i < 3; i++) {
    const change = goal[i] - path.velocity[i];
    const ramp = Math.min(duration, Math.abs(change) / acceleration[i]);
    velocity[i] = path.velocity[i] + Math.sign(change) * acceleration[i] * ramp;
    way[i] = (path.velocity[i] + velocity[i]) / 2 * ramp + velocity[i] * (duration - ramp);
  }
  const position = add(path.position, rotated(way, path.yaw + way[2] / 2, math));
  return {time: t, position, yaw: path.yaw + way[2], velocity};
}

// The plane through points: z = slope · (x, y) + level.
export function planeThrough(points) {
  const n = points.length, [mx, my, mz] = [0, 1, 2].map(
    (i) => points.reduce((sum, point) => sum + point[i], 0) / n,
  );
  let xx = 0, xy = 0, yy = 0, xz = 0, yz = 0;
  for (const point of points) {
    const x = point[0] - mx, y = point[1] - my, z = point[2] - mz;
    xx += x * x; xy += x * y; yy += y * y; xz += x * z; yz += y * z;
  }
  const determinant = xx * yy - xy * xy;
  const slope = [(yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant];
  return {slope, level: mz - slope[0] * mx - slope[1] * my};
}
const heightOn = ({slope, level}, [x, y]) => slope[0] * x + slope[1] * y + level;

// Rows (begin, p, its slope, a, b) of the closed form of the linear inverted pendulum, as
// `LIPM.pieces`. segments: {begin, end, from, to} of the zero-moment point p.
export function pendulum(segments, com, omega, {exp}) {
  const growing = [];
  let ahead = segments.at(-1).to; // the divergent component of motion
  for (const {begin, end, from, to} of [...segments].reverse()) {
    const decay = exp(-omega * (end - begin)), duration = end - begin;
    const slope = [0, 1].map((i) => (to[i] - from[i]) / duration);
    const part = [0, 1].map((i) => (ahead[i] - to[i] - slope[i] / omega) * decay);
    growing.unshift(part.map((x) => x / 2));
    ahead = [0, 1].map((i) => from[i] + slope[i] / omega + part[i]);
  }
  const rows = [];
  let at = com;
  segments.forEach(({begin, end, from, to}, k) => {
    const a = growing[k], growth = exp(omega * (end - begin));
    const slope = [0, 1].map((i) => (to[i] - from[i]) / (end - begin));
    const b = [0, 1].map((i) => at[i] - from[i] - a[i]);
    rows.push([begin, ...from, ...slope, ...a, ...b]);
    at = [0, 1].map((i) => to[i] + a[i] * growth + b[i] / growth);
  });
  const {end, to} = segments.at(-1);
  return [...rows, [end, ...to, 0, 0, 0, 0, at[0] - to[0], at[1] - to[1]]];
}

function zmpAt(pieces, t) {
  const time = Math.max(t, pieces[0][0]);
  const [begin, x, y, slopeX, slopeY] = pieces.findLast((piece) => piece[0] <= time);
  return [x + slopeX * (time - begin), y + slopeY * (time - begin)];
}

// robot: its data. tick: as `createTick` makes it. gravity: m/s², as the controller assumes it.
export function createWalk(robot, tick, gravity) {
  const {constants, layout, feet: nominal, ...given} = robot.walking, names = Object.keys(nominal);
  const {math} = tick;
  const {body, pieces: pieceRows, swings: swingRows} = tick.views;
  const omega = Math.sqrt(gravity / (given.comHeight - given.groundHeight));
  let requested = null, inUse = null, gait = null; // inUse is null while feet come down
  let motion = [0, 0, 0], fractions = [1, 1], height = 0, desired = null, plan = null;
  let nextChange = -Infinity;

  const stanceNow = (t) => names.filter((name) => stanceAt(gait, t).includes(name));
  const swingRow = (k) => swingRows.subarray(layout.SWING_SIZE * k, layout.SWING_SIZE * (k + 1));
  const endOf = (k) => [...swingRow(k).subarray(layout.END, layout.END + 3)];
  const pathNow = () => ({
    time: body[layout.TIME], yaw: body[layout.YAW],
    position: [...body.subarray(layout.POSITION, layout.POSITION + 2)],
    velocity: [...body.subarray(layout.VELOCITY, layout.VELOCITY + 3)],
  });

  // Begin to follow a requested gait once all feet stand.
  function updateGait(isSwinging, t) {
    if (inUse === requested) return false;
    if (!isSwinging) {
      inUse = requested;
      gait = {...requested, start: Math.max(requested.start, t)}; // no foot lifts off earlier
      return true;
    }
    inUse = null;
    gait = {...gait, stop: Math.min(gait.stop, t)};
    return false;
  }
  // The motion that the path approaches from t on.
  function desiredMotion(isSwinging, t) {
    const goal = isSwinging || liftsLater(gait, t) ? motion : [0, 0, 0];
    const [first, later] = fractions.map((fraction) => goal.map((x) => fraction * x));
    return {first, later, firstUntil: gait.start + gait.period, begin: gait.start};
  }
  function refresh() {
    if (plan === null) return;
    desired = desiredMotion(plan.swings.length > 0, body[layout.TIME]);
    writeDesired();
  }
  function writeDesired() {
    body.set([...desired.first, ...desired.later, desired.firstUntil, desired.begin], layout.FIRST);
    body[layout.COM_HEIGHT] = given.comHeight + height;
  }

  // measured: {feet: {foot: position}, com, rotation of the base, row by row}.
  function change(t, measured) {
    let path, footing, inAir = new Map(), stance; // inAir: foot -> swing with its present end
    if (plan === null) {
      gait = inUse = requested;
      stance = stanceNow(t);
      const yaw = math.atan2(measured.rotation[3], measured.rotation[0]);
      const middles = names.map(
        (foot) => add(measured.feet[foot], rotated(nominal[foot], yaw, math), -1),
      );
      path = {time: t, position: mean(middles), yaw, velocity: [0, 0, 0]};
      footing = {feet: measured.feet, touchdowns: {}, stepOffset: [0, 0]};
    } else {
      const isNew = updateGait(plan.swings.length > 0, t);
      refresh();
      stance = stanceNow(t);
      if (!isNew && stance.join() === plan.stance.join() && t < plan.replanTime) {
        return scheduleChange(t);
      }
      const swings = plan.swings.map((swing, k) => ({...swing, end: endOf(k)}));
      let shift;
      [footing, shift] = nextFooting(swings, measured, stance, t);
      path = moved(pathNow(), desired, given.acceleration, t, math);
      path.position = add(path.position, shift);
      inAir = new Map(swings.filter(({foot}) => !stance.includes(foot))
        .map((swing) => [swing.foot, swing]));
    }
    desired = desiredMotion(inAir.size > 0, t);
    plan = makePlan(path, footing, stance, inAir, measured);
    pack(path);
    scheduleChange(t);
  }
  function scheduleChange(t) {
    const [{end}] = phasesOf(gait, t, 1, constants.horizon);
    nextChange = Math.min(end, plan.replanTime) - constants.timeTolerance;
  }

  // The feet on the ground at a change of stance, and by how much to shift the path.
  function nextFooting(swings, measured, stance, t) {
    const feet = {...plan.footing.feet}, touchdowns = {...plan.footing.touchdowns}, offsets = [];
    for (const foot of plan.stance) {
      if (t > (touchdowns[foot] ?? -Infinity) + constants.settlingTime) {
        feet[foot] = measured.feet[foot];
      }
    }
    for (const {foot, end, plannedEnd} of swings) {
      if (!stance.includes(foot)) continue;
      feet[foot] = [measured.feet[foot][0], measured.feet[foot][1], end[2]];
      offsets.push(add(feet[foot], plannedEnd, -1));
      touchdowns[foot] = t;
    }
    const before = plan.footing.stepOffset;
    if (!offsets.length) return [{feet, touchdowns, stepOffset: before}, [0, 0]];
    const stepOffset = mean(offsets), both = mean([before, stepOffset]);
    const isFar = math.hypot(...both) > constants.pathShift;
    return [{feet, touchdowns, stepOffset}, isFar ? both : [0, 0]];
  }

  // Raibert's foothold of a foot that lands at a time, (2).
  function foothold(path, foot, touchdown) {
    const {position, yaw, velocity: [forwards, left, rate]} = moved(
      path, desired, given.acceleration, touchdown, math,
    );
    const velocity = rotated([forwards, left], yaw, math), arm = rotated(nominal[foot], yaw, math);
    const half = (requested.period - requested.swing) / 2;
    const turning = [-rate * arm[1], rate * arm[0]];
    const centripetal = [-rate * velocity[1], rate * velocity[0]];
    return [0, 1].map((i) => position[i] + arm[i] + (velocity[i] + turning[i]) * half
      - centripetal[i] / omega ** 2);
  }

  function makePlan(path, footing, stance, inAir, measured) {
    const t = path.time, phases = phasesOf(gait, t, constants.nPhases, constants.horizon);
    const isSame = plan !== null && plan.stance.join() === stance.join();
    const begin = isSame ? plan.begin : t, [{end: until}] = phases, isEndless = phases.length === 1;
    const end = isEndless ? Infinity : until;
    const ground = planeThrough(names.map((foot) => {
      const [x, y, z] = footing.feet[foot];
      return [x, y, z - nominal[foot][2]];
    }));
    const place = (foot, touchdown) => {
      const xy = foothold(path, foot, touchdown);
      return [...xy, nominal[foot][2] + heightOn(ground, xy)];
    };
    const centres = [], footholds = {}, feet = {...footing.feet};
    for (const phase of phases) {
      centres.push(mean(names.filter((foot) => phase.stance.includes(foot))
        .map((foot) => feet[foot])));
      for (const foot of names) {
        const times = swingAt(gait, foot, phase.begin);
        if (!times) continue;
        const planned = place(foot, times[1]);
        footholds[foot] ??= planned;
        if (Math.abs(times[1] - phase.end) < 2 * constants.timeTolerance) feet[foot] = planned;
      }
    }
    // where the planned ZMP jumps, its value before the jump
    const zmp = plan === null ? centres[0] : zmpAt(plan.pieces, t - constants.timeTolerance);
    const pieces = pendulum(zmpSegments(phases, centres, zmp), measured.com, omega, math);
    const swings = names.flatMap((foot) => {
      if (inAir.has(foot)) return [inAir.get(foot)];
      const times = swingAt(gait, foot, t);
      const plannedEnd = footholds[foot];
      return times ? [{foot, start: measured.feet[foot], plannedEnd, end: plannedEnd, times,
        ground}] : [];
    });
    const ramps = Object.fromEntries(names.map((foot) => [foot, {
      landed: (footing.touchdowns[foot] ?? -Infinity) >= begin - constants.timeTolerance,
      lifts: end < Infinity && swingAt(gait, foot, end + constants.timeTolerance) !== null,
    }]));
    return {stance, footing, pieces, swings, ground, begin, end, ramps,
      replanTime: isEndless ? until - constants.shiftTime : Infinity};
  }

  // The zero-moment point of the next phases: in the middle of the standing feet. It shifts while
  // all feet stand.
  function zmpSegments(phases, centres, first) {
    const {shiftTime} = constants, segments = [];
    let from = first;
    phases.forEach(({begin, end, stance}, i) => {
      const allStand = stance.length === names.length, isLast = i + 1 === phases.length;
      const to = isLast || !allStand ? centres[i] : centres[i + 1];
      const add = (b, e, p0, p1) => segments.push({begin: b, end: e, from: p0, to: p1});
      if (!allStand) add(begin, end, to, to);
      else if (end - begin <= shiftTime) add(begin, end, from, to);
      else if (isLast) {
        add(begin, begin + shiftTime, from, to);
        add(begin + shiftTime, end, to, to);
      } else {
        add(begin, end - shiftTime, from, from);
        add(end - shiftTime, end, from, to);
      }
      from = to;
    });
    return segments;
  }

  // Write the plan into the arrays of `write_targets`.
  function pack(path) {
    const {stance, pieces, swings, ground} = plan, {entries} = problem();
    const put = (at, values) => body.set(values, at);
    put(layout.TIME, [path.time, ...path.position, path.yaw, ...path.velocity]);
    put(layout.ACCELERATION, given.acceleration);
    body[layout.OMEGA] = omega;
    put(layout.GROUND, [...ground.slope, ground.level]);
    put(layout.DEAD_ZONE, [stance.length > 2 ? constants.deadZone : 0, given.reach,
      constants.sideFraction]);
    put(layout.COM_ENTRY, [entries.com, entries.base]);
    put(layout.BASE_ROTATION, given.baseRotation);
    writeDesired();
    pieces.forEach((row, k) => pieceRows.set(row, layout.PIECE_SIZE * k));
    swings.forEach(({foot, start, plannedEnd, end, times, ground: landing}, k) => {
      const row = swingRow(k).fill(0);
      row.set([...start, plannedEnd[0], plannedEnd[1], ...end, ...times, given.clearance,
        ...nominal[foot], ...landing.slope, landing.level], layout.START);
      row.set([entries.feet[foot], -1], layout.POSITION_ENTRY); // a ball foot has no rotation
    });
  }
  const name = () => `walk/${plan.stance.join("+")}`;
  const problem = () => robot.problems[`${name()}/${robot.facets[0]}`];

  // The largest normal force of each foot while all feet stand: it falls to zero before a foot
  // lifts off, and rises after it lands.
  function boundForces(t) {
    const {stance, begin, end, ramps} = plan;
    if (stance.length < names.length) return;
    const ramp = Math.min(given.ramp, (end - begin) / 2), at = tick.problem.entries.largestForce;
    stance.forEach((foot, i) => {
      const {landed, lifts} = ramps[foot];
      const fraction = Math.min(lifts ? (end - t) / ramp : Infinity,
        landed ? (t - begin) / ramp : Infinity);
      tick.views.inputs[at + i] = fraction < 1 ? given.fullLoad[foot] * Math.max(fraction, 0)
        : UNBOUNDED;
    });
  }

  return {
    // Walk with a gait from `start` on; null: stand once all feet are on the ground.
    request(key, t) {
      requested = key === null ? {...requested, stop: t}
        : {...given.gaits[key], start: t + constants.shiftTime, stop: Infinity};
      if (key !== null) fractions = [given.gaits[key].firstFraction, 1];
    },
    // Velocity forwards and to the left, m/s, and yaw rate, rad/s; height of the centre of mass, m.
    set(changes) {
      ({motion = motion, height = height} = changes);
      refresh();
    },
    get name() { return name(); },
    get isStanding() { return plan === null || plan.swings.length === 0; },
    get plan() { return plan; },
    // Plan, if it is time to do so. Returns whether the stance may have changed.
    update(t, measured) {
      if (inUse === requested && t < nextChange) return false;
      const before = plan;
      change(t, measured());
      return plan !== before;
    },
    // Write the targets of the control step at t; the views `com` and `comVelocity` are up to date.
    write(t) {
      tick.writeTargets(t, plan.pieces.length, plan.swings.length);
      boundForces(t);
    },
    feetInAir: () => plan?.swings.map(({foot}) => foot) ?? [],
    path: pathNow,
  };
}
