// A robot with its controller in MuJoCo: one control step per millisecond. Deterministic: the same
// settings and pushes give the same run. It needs neither a page nor a clock.

import {cross, readState} from "./dynamics.js";
import {contactForces, makeModel, touchingPoints} from "./model.js";
import {checkPush, checkSettings, defaults} from "./settings.js";
import {NO_ANSWER, createTick, setParameter} from "./tick.js";
import {createWalk} from "./walk.js";
import {frictionValue, smallestConflict} from "./what_if.js";

export const STEP = 1e-3; // s
const REST = 1.5; // s that a fallen robot lies before it is put on its feet again
const TARGET_SPEED = 0.1; // m/s with which a target moves to where a control sets it
const SHIFT_TIME = 2; // s, at most, until the centre of mass is over three feet
const SHIFTED = 0.01; // m: near enough to its target to lift a foot
const LOWER_SPEED = 0.05; // m/s of a foot that is set down
const LOWER_TIME = 2; // s, at most
const AIRBORNE = 2; // times the height of the base at the beginning

// mj: MuJoCo. module: the control step's WebAssembly module. robot: its data.
export function createEngine(mj, module, robot) {
  const actual = makeModel(mj, robot), assumed = makeModel(mj, robot);
  const {d, nv, points, bodies} = robot, base = bodies[1];
  const tick = createTick(module, robot), {views} = tick;
  const buffer = new mj.DoubleBuffer(6);
  const readAssumed = () => readState(mj, assumed.model, assumed.data, robot, views);
  let settings = defaults(robot), pushes = [], outcome = "", active = 0, steps = 0, offAt = -1;
  let target = [0, 0, 0], shift = [0, 0, 0]; // m, of the centre of mass from its place at rest
  let stance = {lifted: null, since: 0, lower: 0}; // the foot that is in the air
  let walk = null, gait = null; // the plan of a walk, and the gait that it follows or null
  let conflict = []; // constraints that cannot hold together, after the controller has stopped
  let motors = null; // wrench of the base's motors, or none
  let startHeight = 0, startAxis = [0, 0, 1], qpos = null, qvel = null, ctrl = null;

  // MuJoCo's memory may move when it grows; views into it are then empty.
  function refresh() {
    ({qpos, qvel, ctrl} = actual.data);
  }
  function select() {
    tick.select(`${walk?.name ?? stance.lifted ?? "all"}/${settings.facets}`);
    const {parameters} = tick.problem;
    setParameter(views.floats, parameters.mu, settings.mu);
    setParameter(views.floats, parameters.torque, settings.torque);
    views.floats[parameters.baseMass] = assumed.baseMass + settings.payload;
    const {flags, legs} = tick.problem, has = (term) => !settings.assumedOff.includes(term);
    views.floats[parameters.gravity] = has("gravity") ? -settings.gravity : 0;
    views.floats[parameters.velocityForces] = Number(has("velocity"));
    views.floats[parameters.drift] = Number(has("drift"));
    views.sizes[flags.underactuated] = BigInt(has("zeros"));
    views.sizes[flags.cones] = BigInt(has("cones"));
    if (!has("forces") && settings.leg in legs) { // a foot in the air has no force
      views.sizes[flags.sameRows] = 0n;
      views.ints[legs[settings.leg]] = 1n;
    }
    if (walk === null) placeTargets();
  }
  function placeTargets() {
    const {parameters} = tick.problem;
    for (let i = 0; i < 3; i++) views.inputs[parameters.com[i]] = robot.home.com[i] + target[i];
    if (stance.lifted) {
      views.inputs[parameters.lift] = parameters.liftedHeight - stance.lower;
    }
  }
  function apply() {
    const {gravity, payload, actualPayload, assumedOff, actualOff} = settings;
    assumed.change({payload, gravity: assumedOff.includes("gravity") ? 0 : gravity});
    actual.change(
      {payload: actualPayload, gravity: actualOff.includes("gravity") ? 0 : gravity},
    );
    actual.setMissing(actualOff.includes("forces") ? robot.legs[settings.leg] : []);
    actual.setFriction(settings.actualMu);
    actual.setTorque(settings.torque);
    select();
    walk?.set({motion: [settings.speed, 0, settings.turn], height: settings.height});
  }
  function reset() {
    actual.setHulls(false);
    mj.mj_resetData(actual.model, actual.data);
    refresh();
    qpos.set(robot.home.qpos);
    mj.mj_forward(actual.model, actual.data);
    pushes = [];
    [outcome, active, steps, offAt, motors, conflict] = ["", 0, 0, -1, null, []];
    stance = {lifted: null, since: 0, lower: 0};
    [walk, gait] = [null, null];
    [target, shift] = [[0, 0, 0], [0, 0, 0]];
    startHeight = actual.data.xpos[3 * base + 2];
    startAxis = [2, 5, 8].map((i) => actual.data.xmat[9 * base + i]);
    apply();
  }

  // Move a number towards another by at most `most`.
  const towards = (from, to, most) => from + Math.max(-most, Math.min(most, to - from));
  function moveTargets() {
    const wanted = [settings.forward, settings.left, settings.height];
    const name = settings.lifted ?? stance.lifted;
    const isOver = settings.lifted && (!stance.lifted || stance.lifted === settings.lifted);
    const place = name && isOver ? robot.problems[`${name}/${settings.facets}`].comTarget : null;
    let hasMoved = false;
    for (let i = 0; i < 3; i++) {
      // the foot must be on the ground before the centre of mass leaves the other three
      if (!stance.lifted || isOver) shift[i] = place ? place[i] - robot.home.com[i] : 0;
      const next = towards(target[i], wanted[i] + shift[i], TARGET_SPEED * STEP);
      hasMoved ||= next !== target[i];
      target[i] = next;
    }
    return hasMoved;
  }
  // Lift a foot once the centre of mass is over the others; set it down before it carries again.
  function moveFeet() {
    const time = (steps - stance.since) * STEP;
    if (stance.lifted === settings.lifted) {
      stance.since = steps;
      if (stance.lower === 0) return false;
      stance.lower = Math.max(0, stance.lower - LOWER_SPEED * STEP);
      return true;
    }
    if (stance.lifted === null) {
      const com = actual.data.subtree_com.subarray(3 * base, 3 * base + 3);
      const place = robot.problems[`${settings.lifted}/${settings.facets}`].comTarget;
      const away = Math.hypot(com[0] - place[0] - settings.forward,
        com[1] - place[1] - settings.left);
      if (away > SHIFTED && time < SHIFT_TIME) return false;
      stance = {lifted: settings.lifted, since: steps, lower: 0};
    } else {
      stance.lower += LOWER_SPEED * STEP;
      const isDown = points.some(({name, geom, radius}) => name === stance.lifted
        && actual.data.geom_xpos[3 * geom + 2] < radius);
      if (!isDown && time < LOWER_TIME) return true;
      stance = {lifted: null, since: steps, lower: 0};
    }
    select();
    return false;
  }

  // What the plan of a walk needs to know of the present state.
  function measure() {
    const {geom_xpos: places, subtree_com: coms, xmat} = assumed.data;
    return {
      feet: Object.fromEntries(points.map(({name, geom}) => (
        [name, [...places.subarray(3 * geom, 3 * geom + 3)]]))),
      com: [...coms.subarray(3 * base, 3 * base + 2)],
      rotation: xmat.subarray(9 * base, 9 * base + 9),
    };
  }
  // A gait that was chosen begins once all feet stand.
  function followGait(time) {
    if (walk === null) {
      if (settings.gait === null || !robot.walking || stance.lifted || stance.lower) return;
      walk = createWalk(robot, tick, settings.gravity);
      walk.set({motion: [settings.speed, 0, settings.turn], height: settings.height});
    }
    if (gait === settings.gait) return;
    if (gait !== null) walk.request(null, time);
    else if (walk.isStanding) walk.request(settings.gait, time);
    else return;
    gait = gait === null ? settings.gait : null;
  }
  function moveWalk(time) {
    mj.mj_comVel(assumed.model, assumed.data);
    mj.mj_subtreeVel(assumed.model, assumed.data);
    const {subtree_com: coms, subtree_linvel: velocities} = assumed.data;
    views.com.set(coms.subarray(3 * base, 3 * base + 3));
    views.comVelocity.set(velocities.subarray(3 * base, 3 * base + 3));
    if (walk.update(time, measure)) select();
    walk.write(time);
  }

  function command() {
    motors = null;
    const {time} = actual.data; // the plans of `Walk` use the same sum of steps
    followGait(time);
    if (walk === null && (moveFeet() | moveTargets())) placeTargets();
    assumed.data.qpos.set(qpos);
    assumed.data.qvel.set(qvel);
    readAssumed();
    if (walk !== null) moveWalk(time);
    active = tick.run();
    if (active === NO_ANSWER.infeasible) conflict = smallestConflict(tick, robot);
    if (active < 0) return stop(active === NO_ANSWER.infeasible ? "infeasible" : "no answer");
    for (let i = 0; i < d; i++) ctrl[robot.motors[i]] = views.result[nv + i];
    if (settings.actualOff.includes("zeros")) motors = baseWrench();
  }
  // What the base's motors do: the rest of (7) in the base's rows, as the controller assumes it.
  function baseWrench() {
    const {assumedOff, leg} = settings, {points: names} = tick.problem, {result, v} = views;
    const ignored = assumedOff.includes("forces") ? robot.legs[leg] : [];
    const forces = points.filter(({name}) => names.includes(name) && !ignored.includes(name))
      .map(({name, geom, radius}) => {
        const [x, y, z] = assumed.data.geom_xpos.subarray(3 * geom, 3 * geom + 3);
        const first = nv + d + 3 * names.indexOf(name);
        return {at: [x, y, z - radius], force: result.subarray(first, first + 3)};
      });
    return assumed.baseWrench(result, v, forces, !assumedOff.includes("velocity"));
  }
  // The controller ends; the joints are damped, and the robot comes to lie on its links.
  function stop(why) {
    [outcome, motors] = [why, null];
    offAt = steps;
    actual.setHulls(true);
    damp();
  }
  function damp() {
    const {motors, damping, qvelOfV} = robot;
    for (let i = 0; i < d; i++) ctrl[motors[i]] = -damping[i] * qvel[qvelOfV[6 + i]];
  }
  // Add a force f on a body, at a point r from its centre of mass, both in the world frame.
  function addForce(body, r, f) {
    const forces = actual.data.xfrc_applied;
    [...f, ...cross(r, f)].forEach((x, i) => { forces[6 * body + i] += x; });
  }
  const adhesion = () => settings.actualOff.includes("cones") ? Math.round(robot.weight) : 0; // N
  function applyAdhesion() {
    const {geom_xpos: places, xipos} = actual.data, {geom_bodyid: bodyOf} = actual.model;
    for (const {geom} of touchingPoints(mj, actual, robot)) {
      const body = bodyOf[geom];
      const r = [0, 1, 2].map((i) => places[3 * geom + i] - xipos[3 * body + i]);
      addForce(body, r, [0, 0, -adhesion()]);
    }
  }
  function applyPushes() {
    const time = steps * STEP;
    for (const {body, at, force, start, duration} of pushes) {
      const share = (Math.min(start + duration, time + STEP) - Math.max(start, time)) / STEP;
      if (share < 1e-6) continue;
      const {xpos, xmat, xipos} = actual.data, f = force.map((x) => share * x);
      const r = [0, 1, 2].map((i) => xpos[3 * body + i] - xipos[3 * body + i]
        + [0, 1, 2].reduce((sum, c) => sum + xmat[9 * body + 3 * i + c] * at[c], 0));
      addForce(body, r, f);
    }
    pushes = pushes.filter(({start, duration}) => start + duration > time);
  }
  const baseHeight = () => actual.data.xpos[3 * base + 2];
  const isAirborne = () => baseHeight() > AIRBORNE * startHeight;
  function isFallen() {
    const {xmat} = actual.data;
    const axis = [2, 5, 8].reduce((sum, at, i) => sum + xmat[9 * base + at] * startAxis[i], 0);
    return baseHeight() < robot.fallenHeight * startHeight || axis < robot.fallenCosine;
  }

  reset();
  return {
    tick,
    readAssumed,
    actual,
    assumed,
    reset,
    get settings() { return settings; },
    get time() { return steps * STEP; },
    // "" while the controller runs, then why it stopped: "fell", "left the ground",
    // "infeasible", "no answer"
    get outcome() { return outcome; },
    get conflict() { return conflict; },
    get pushes() { return pushes; },
    get walk() { return walk; },
    // Names of the feet in the air.
    get lifted() {
      return walk?.feetInAir() ?? (stance.lifted ? [stance.lifted] : []);
    },
    // Change settings. Changes that make no sense are refused, and the settings stay as they are.
    set(changes) {
      checkSettings(changes, robot);
      settings = {...settings, ...changes};
      apply();
    },
    // Push with a force, world frame [N], at a point of a body, in the body's frame [m]. most: of
    // the force.
    push(given, most) {
      const push = {
        body: base, at: [0, 0, 0], force: null, start: steps * STEP, duration: null, ...given,
      };
      checkPush(push, robot, most);
      pushes.push(push);
    },
    step() {
      if (qpos.length === 0) refresh();
      if (outcome === "") command();
      else damp();
      const {xfrc_applied: forces, qfrc_applied: applied} = actual.data;
      forces.fill(0);
      applied.fill(0);
      applyPushes();
      if (adhesion() > 0) applyAdhesion();
      if (settings.actualOff.includes("velocity")) applied.set(actual.coriolisCompensation());
      motors?.forEach((x, i) => { applied[i] += x; });
      mj.mj_step(actual.model, actual.data);
      steps++;
      if (outcome === "" && isAirborne()) stop("left the ground");
      if (outcome === "" && isFallen()) stop("fell");
      return outcome;
    },
    // Whether a robot that fell has lain long enough.
    get isAtRest() { return offAt >= 0 && (steps - offAt) * STEP > REST; },
    comVelocity() {
      mj.mj_subtreeVel(actual.model, actual.data);
      return [...actual.data.subtree_linvel.subarray(3 * base, 3 * base + 3)];
    },
    // The height of the base as a fraction of the wanted one.
    height: () => baseHeight() / (startHeight + settings.height),
    com: () => [...actual.data.subtree_com.subarray(3 * base, 3 * base + 3)],
    measuredForces: () => contactForces(mj, actual, robot, buffer, adhesion()),
    // Planned forces of all contact points, zero for those of a lifted foot.
    plannedForces() {
      const forces = new Float64Array(3 * points.length);
      if (outcome !== "") return forces;
      tick.problem.points.forEach((name, i) => {
        const point = points.findIndex((one) => one.name === name);
        forces.set(views.result.subarray(nv + d + 3 * i, nv + d + 3 * i + 3), 3 * point);
      });
      return forces;
    },
    torques: () => [...views.result.subarray(nv, nv + d)],
    // The facets of each friction cone as the controller assumes them: a row times a force is at
    // most zero inside.
    facets() {
      const first = tick.problem.parameters.cones;
      return Array.from({length: settings.facets},
        (_, i) => [...views.floats.subarray(first + 5 * i, first + 5 * i + 3)]);
    },
    // What more friction at a contact point would bring, see what_if.js.
    frictionValue(name) {
      return outcome === "" ? frictionValue(tick, robot, name, this.activeConstraints()) : null;
    },
    // Active constraints: [kind, owner, number, multiplier].
    activeConstraints() {
      if (outcome !== "" || active <= 0) return [];
      const {k, rows} = tick.problem, first = nv + d + k, n = nv + k;
      return Array.from({length: active}, (_, i) => [
        ...(rows[views.result[first + n + i]] ?? ["other", "", 0]),
        Math.max(0, views.result[first + i]),
      ]);
    },
    free() {
      actual.free();
      assumed.free();
      buffer.delete();
    },
  };
}
