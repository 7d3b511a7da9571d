// The worker of a page with a live robot: it holds the engine, and steps it when the page asks for
// a picture. A page that draws nothing lets the robot rest.
//
// From the page: {start}, {begin}, {set}, {show}, {undo}, {resetAll}, {challenge}, {foot}, {push},
// {reset}, {pause}, {step}, {timeScale}, {frame}, {recovery}; to the page: {ready}, {frame},
// {stoodUp}, {recovery}, {error}. A frame with `hasNews` has settings that the page's controls did
// not set. An error with `isRefusal` says why a message makes no sense; then nothing has changed.

import {challenges, createJudge, sampleOf, startOf} from "./challenges.js";
import {createClock} from "./clock.js";
import {slippingPoints} from "./contacts.js";
import {createEngine, STEP} from "./engine.js";
import {createHistory} from "./history.js";
import {pushRecovery} from "./recovery.js";
import {
  Refusal, SWITCH, check, checkNames, choiceRule, defaults, liftedFeet, numberRule,
} from "./settings.js";

const WARM_UP = 800; // steps, after which a browser has optimized the code
let mj = null, module = null, robot = null, engine = null;
let resting = []; // joints that are at the end of their range when the robot stands
let around = null; // names of the contact points, and the weight
const clock = createClock(STEP), history = createHistory();
let home = null; // the settings that the page began with
let first = null; // the settings of "reset everything": those, or those of a challenge
let challenge = null, judge = null; // what is to be solved, or null, and who watches
let hasNews = false; // of settings that the page's controls did not set
let foot = null; // the contact point whose force the page explains
let motion = null; // of the centre of mass at the last picture: {time, velocity, acceleration}
// constraints that were active, and contact points that slipped, in the steps of the last picture
// that had some
const seen = new Map(), slipping = new Set();
let slipTime = null; // s, when a point slipped for the last time before the controller stopped
const RECENT = 1; // s before a fall, in which a slip counts as its cause
const SAMPLE = 16; // steps between two checks of the clock and of slipping
const TIME_SCALES = numberRule(0.01, 1);

async function fetchOk(name) {
  const response = await fetch(name);
  if (!response.ok) throw new Error(`${name} cannot be loaded (${response.status}).`);
  return response;
}

async function load() {
  const [{default: loadMujoco}, compiled] = await Promise.all([
    import("./mujoco.js"),
    fetchOk("tick.wasm").then((response) => response.arrayBuffer())
      .then((bytes) => WebAssembly.compile(bytes)),
  ]);
  module = compiled;
  mj = await loadMujoco({locateFile: (name) => name});
}

async function start({name, settings}) {
  const data = fetchOk(`${name}.json`).then((response) => response.json());
  if (mj === null) await load();
  robot = await data;
  engine?.free();
  engine = createEngine(mj, module, robot);
  const standing = new Set();
  for (let i = 0; i < WARM_UP; i++) {
    engine.step();
    for (const [kind, owner] of engine.activeConstraints()) {
      if (kind.endsWith("joint limit")) standing.add(owner);
    }
  }
  resting = [...standing];
  home = first = {...defaults(robot), ...settings};
  restart(first);
  history.clear();
  clock.reset();
  const {drawing, weight} = robot;
  around = {weight, points: robot.points.map(({name}) => name)};
  postMessage({ready: {name, drawing, settings: engine.settings, robot: summary()}});
}

const summary = () => ({
  ...around, bodies: robot.bodies,
  facets: robot.facets, lifted: liftedFeet(robot),
  gaits: robot.walking?.gaits ?? {}, legs: Object.keys(robot.legs), resting,
});

function restart(settings = {}) {
  engine.set(settings);
  engine.reset();
  seen.clear();
  slipping.clear();
  slipTime = null;
  judge = challenge && createJudge(challenge, first);
}
function change(settings) {
  const before = engine.settings;
  engine.set(settings);
  history.remember(before, settings, performance.now());
}

function frame() {
  const isPushed = engine.pushes.some(({start: begins}) => begins <= engine.time);
  const count = clock.steps(performance.now(), isPushed);
  const begin = performance.now();
  let done = 0;
  if (count > 0) { // else the robot is paused, or very slow
    seen.clear();
    slipping.clear();
  }
  for (; done < count; done++) {
    if (engine.isAtRest) {
      const before = judge;
      restart();
      if (before?.status.isWon) judge = before; // it stays solved
      postMessage({stoodUp: true});
    }
    const wasRunning = engine.outcome === "";
    engine.step();
    if (wasRunning && engine.outcome !== "") judge?.ended(engine.outcome, engine.settings);
    for (const one of engine.activeConstraints()) seen.set(one.slice(0, 3).join(), one);
    if (done % SAMPLE < SAMPLE - 1) continue;
    watch(SAMPLE);
    if (performance.now() - begin > clock.budget) {
      done++;
      break;
    }
  }
  if (done % SAMPLE > 0) watch(done % SAMPLE); // a picture in slow motion has few steps
  clock.done(done, performance.now() - begin);
  postMessage({frame: picture(), hasNews});
  hasNews = false;
}

function watch(steps) {
  if (engine.outcome !== "") return;
  judge?.observe(sampleOf(engine, robot, steps * STEP), engine.settings);
  const forces = {measured: engine.measuredForces(), planned: engine.plannedForces()};
  for (const name of slippingPoints({...forces, settings: engine.settings}, around)) {
    slipping.add(name);
  }
  if (slipping.size) slipTime = engine.time;
  else if (engine.time - slipTime > RECENT) slipTime = null;
}

// The forces that are drawn for terms of eq. (7), N: {term: {at, force}}.
function termForces() {
  const {actualOff: off} = engine.settings, base = robot.bodies[1];
  const {data, model} = engine.actual, mass = model.body_subtreemass[base], com = engine.com();
  const {time} = engine, velocity = engine.comVelocity();
  if (motion === null || time < motion.time) motion = {time, velocity, acceleration: [0, 0, 0]};
  if (time > motion.time) { // else the robot is paused
    const elapsed = time - motion.time;
    const acceleration = velocity.map((x, i) => (x - motion.velocity[i]) / elapsed);
    motion = {time, velocity, acceleration};
  }
  const weight = [0, 0, off.includes("gravity") ? 0 : -mass * engine.settings.gravity];
  return {
    inertia: {at: com, force: motion.acceleration.map((x) => mass * x)},
    velocity: {
      at: [...data.xpos.subarray(3 * base, 3 * base + 3)],
      force: off.includes("velocity") ? [0, 0, 0]
        : [...engine.actual.coriolisCompensation().subarray(0, 3)],
    },
    gravity: {at: com, force: weight, endsThere: true}, // the ground is below it
  };
}

// What the page draws of the present state.
function picture() {
  const {data} = engine.actual, {bodies, points} = robot;
  const rotations = new Float64Array(9 * bodies.length);
  const positions = new Float64Array(3 * bodies.length);
  const {xmat, xpos, geom_xpos: places} = data;
  bodies.forEach((body, i) => {
    rotations.set(xmat.subarray(9 * body, 9 * body + 9), 9 * i);
    positions.set(xpos.subarray(3 * body, 3 * body + 3), 3 * i);
  });
  const contacts = points.flatMap(({geom, radius}) => [
    places[3 * geom], places[3 * geom + 1], places[3 * geom + 2] - radius,
  ]);
  return {
    rotations, positions, contacts, com: engine.com(), height: engine.height(),
    time: engine.time, terms: termForces(),
    facets: engine.facets(), conflict: engine.conflict,
    foot: foot && {name: foot, ...engine.frictionValue(foot)},
    measured: engine.measuredForces(), planned: engine.plannedForces(),
    active: engine.activeConstraints(), seen: [...seen.values()], slipping: [...slipping],
    hasSlipped: slipTime !== null,
    outcome: engine.outcome, pushes: engine.pushes,
    challenge: judge?.status ?? null,
    lifted: engine.lifted, settings: engine.settings, factor: clock.factor,
    stepTime: clock.stepTime,
  };
}

const handlers = {
  start: (given) => start(given),
  set: (changes) => engine && change(changes),
  // The page begins with more settings.
  begin(settings) {
    engine.set(settings);
    home = first = engine.settings;
  },
  undo() {
    const before = engine && history.undo(engine.settings);
    if (!before) return;
    engine.set(before);
    hasNews = true;
  },
  show(isWanted) { hasNews ||= isWanted; },
  resetAll() {
    if (!engine) return;
    change(first);
    restart();
    clock.setScale(1);
    hasNews = true;
  },
  push(push) {
    engine?.push(push);
    judge?.push(push);
  },
  // Watch the force at a contact point, or at none: null.
  foot(name) {
    check("foot", name, choiceRule([null, ...around.points]));
    foot = name;
  },
  // Start a challenge by its title, or return to free play: null.
  challenge(title) {
    check("challenge", title, choiceRule([null, ...challenges.map((each) => each.title)]));
    challenge = challenges.find((each) => each.title === title) ?? null;
    first = challenge ? {...defaults(robot), ...startOf(challenge)} : home;
    history.clear();
    restart(first);
    hasNews = true;
  },
  reset: () => engine && restart(),
  pause(isPaused) {
    check("pause", isPaused, SWITCH);
    clock.pause(isPaused);
  },
  step: () => clock.single(),
  timeScale(scale) {
    check("timeScale", scale, TIME_SCALES);
    clock.setScale(scale);
  },
  frame: () => { if (engine) frame(); },
  async recovery(given) {
    if (mj === null) await load();
    const data = await (await fetchOk(`${given.name}.json`)).json();
    for (const found of pushRecovery({mj, module, robot: data, ...given})) {
      postMessage({recovery: found});
    }
  },
};

onmessage = async ({data}) => {
  try {
    checkNames(data, Object.keys(handlers), "message");
    for (const [key, value] of Object.entries(data)) await handlers[key](value);
  } catch (error) {
    postMessage({
      error: String(error?.message ?? error), isRefusal: error instanceof Refusal,
    });
  }
};
