// Compare the page's engine with the Python library.

import {challenges, createJudge} from "./src/engine/challenges.js";
import {createEngine} from "./src/engine/engine.js";
import {pushRecovery} from "./src/engine/recovery.js";
import {Refusal, defaults} from "./src/engine/settings.js";
import {NO_ANSWER} from "./src/engine/tick.js";
import {smallestConflict} from "./src/engine/what_if.js";

const NO_FORCE = 1e-6; // N
export const FILES = ["states.json", "runs.json", "walks.json", "recovery.json", "challenges.json",
  "go2.json", "solo12.json", "talos.json"];
export const NUMBERS = ["states.bin", "walks.bin"]; // of float64
let mj = null, module = null, files = null;
const robots = {}, engines = {};

// The largest differences between the page and the library. given: MuJoCo, the control step's
// module, and the contents of FILES and NUMBERS by name.
export async function compare(given) {
  ({mj, module, files} = given);
  for (const name of ["go2", "solo12", "talos"]) {
    robots[name] = files[`${name}.json`];
    engines[name] = createEngine(mj, module, robots[name]);
  }
  return {states: compareStates(), runs: compareRuns(), walks: compareWalks(),
    recovery: compareRecovery(), refusals: compareRefusals(), challenges: compareChallenges()};
}

const largest = (a, b) => a.reduce((most, x, i) => Math.max(most, Math.abs(x - b[i])), 0);
const size = (a) => a.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

const pushOf = ({force, start, duration}) => ({force, start, duration});

// The outcome of a run in the words of `Rollout.outcome`.
const outcomeOf = ({outcome}) => outcome === "infeasible" ? "controller failed"
  : outcome || "completed";

// Answers to the same inputs, and these inputs from MuJoCo.
function compareStates() {
  const numbers = files["states.bin"];
  const found = {states: 0, otherActive: 0, otherCode: 0, infeasible: 0, active: 0, torque: 0,
    inputs: {q: 0, v: 0}, conflicts: []};
  let at = 0;
  for (const {robot: name, settings, count, lengths} of files["states.json"]) {
    const [q, v, tau, rows] = lengths.map((length) => {
      at += length;
      return numbers.subarray(at - length, at);
    });
    const engine = engines[name], robot = robots[name], {views} = engine.tick;
    engine.set({...defaults(robot), ...settings});
    compareInputs(engine, robot, {q, v}, found.inputs);
    for (const [key, values] of Object.entries({q, v})) views[key].set(values);
    const answer = engine.tick.run();
    const {nv, d} = robot, first = nv + d + engine.tick.problem.k;
    const active = [...views.result.subarray(first + nv + engine.tick.problem.k)]
      .slice(0, Math.max(0, answer)).sort((a, b) => a - b);
    found.states++;
    if (answer === NO_ANSWER.infeasible) {
      const rows = smallestConflict(engine.tick, robot);
      const unchanged = engine.tick.run() === answer;
      found.conflicts.push({state: found.states - 1, rows, unchanged});
    }
    if (count < 0) found.infeasible++;
    else found.active += count;
    if (answer !== count) found.otherCode++;
    else if (count >= 0) {
      const [ours, theirs] = [active, [...rows]].map((some) => namesOf(some, engine, robot));
      if (ours.join() !== theirs.join()) found.otherActive++;
      const differences = Array.from(tau, (x, i) =>
        Math.abs(x - views.result[nv + i]) / robot.torqueLimits[i]);
      found.torque = Math.max(found.torque, size(differences));
    }
  }
  return found;
}

// Names of active rows. A force of zero lies at the tip of its cone, where any facets determine it:
// such a point counts as a whole.
function namesOf(rows, {tick}, {nv, d}) {
  const names = rows.map((row) => {
    const [kind, owner] = tick.problem.rows[row], point = tick.problem.points.indexOf(owner);
    const force = tick.views.result.subarray(nv + d + 3 * point, nv + d + 3 * point + 3);
    return point >= 0 && size(force) < NO_FORCE ? owner : `${kind} ${row}`;
  });
  return [...new Set(names)].sort();
}

// q and v in MuJoCo's model, and from there back.
function compareInputs(engine, robot, given, found) {
  setState(engine.assumed.data, robot, given);
  engine.readAssumed();
  const {views} = engine.tick;
  for (const [key, values] of Object.entries(given)) {
    const difference = largest(values, views[key]) / Math.max(1, size(values));
    found[key] = Math.max(found[key], difference);
  }
}

function setState(data, {qposOfQ, qvelOfV}, {q, v}) {
  const [x, y, z, w] = q.subarray(3, 7);
  const R = [
    1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
  ];
  q.forEach((value, i) => { data.qpos[qposOfQ[i]] = value; });
  v.forEach((value, i) => { data.qvel[qvelOfV[i]] = value; });
  for (let i = 0; i < 3; i++) {
    data.qvel[i] = R[3 * i] * v[0] + R[3 * i + 1] * v[1] + R[3 * i + 2] * v[2];
  }
}

function compareRuns() {
  return files["runs.json"].map((run) => {
    const robot = robots[run.robot], engine = engines[run.robot];
    engine.set({...defaults(robot), ...run.settings});
    engine.reset();
    if (size(run.force) > 0) engine.push(pushOf(run));
    let distance = 0, firstSecond = 0, moved = 0, end = 0;
    const first = run.com[0];
    for (let step = 0; step < Math.round(run.time / 1e-3); step++) {
      const outcome = engine.step();
      if (step < run.com.length) {
        const com = engine.com();
        const far = Math.hypot(...com.map((value, i) => value - run.com[step][i]));
        moved = Math.max(moved, Math.hypot(...com.map((value, i) => value - first[i])));
        distance = Math.max(distance, far);
        if (step < 1000) firstSecond = distance;
      }
      end = step + 1;
      if (outcome) break;
    }
    return {robot: run.robot, settings: run.settings, force: run.force, python: run.outcome,
      outcome: outcomeOf(engine), firstSecond, distance, moved, end,
      pythonEnd: run.com.length};
  });
}

// Walks: the inputs of the control step for the same states, and runs of the page by itself.
function compareWalks() {
  const numbers = files["walks.bin"];
  let at = 0;
  return files["walks.json"].map((walk) => {
    const {nq, nv} = robots[walk.robot], rows = walk.lengths.map((length) => {
      at += length;
      const row = numbers.subarray(at - length, at);
      const [q, v, com, inputs] = [[0, nq], [nq, nq + nv], [nq + nv, nq + nv + 3],
        [nq + nv + 3]].map(([from, to]) => row.subarray(from, to));
      return {q, v, com, inputs};
    });
    return {robot: walk.robot, python: walk.outcome, ...followStates(walk, rows),
      ...walkAlone(walk, rows)};
  });
}
function start(walk) {
  const engine = engines[walk.robot], robot = robots[walk.robot];
  engine.set({...defaults(robot), mu: walk.mu, actualMu: walk.mu});
  engine.reset();
  return engine;
}
function change(engine, {schedule}, step) {
  const now = schedule.find(({time}) => Math.round(time * 1000) === step);
  if (now) engine.set(now.settings);
}
function followStates(walk, rows) {
  const engine = start(walk), robot = robots[walk.robot];
  let inputs = 0, where = null;
  rows.forEach((row, step) => {
    change(engine, walk, step);
    setState(engine.actual.data, robot, row);
    engine.step();
    if (engine.outcome) throw new Error(`${walk.robot}: ${engine.outcome} at step ${step}`);
    const difference = largest(row.inputs, engine.tick.views.inputs);
    if (difference > inputs) [inputs, where] = [difference, step];
  });
  return {inputs, where};
}
function walkAlone(walk, rows) {
  const engine = start(walk);
  engine.push(pushOf(walk));
  let distance = 0, moved = 0;
  const first = rows[0].com;
  for (let step = 0; step < rows.length; step++) {
    change(engine, walk, step);
    const com = engine.com();
    distance = Math.max(distance, Math.hypot(...com.map((x, i) => x - rows[step].com[i])));
    moved = Math.hypot(com[0] - first[0], com[1] - first[1]);
    if (engine.step()) break;
  }
  return {outcome: outcomeOf(engine), distance, moved};
}

function compareRecovery() {
  const given = files["recovery.json"], robot = robots[given.robot], pushes = [];
  for (const {push} of pushRecovery({...given, mj, module, robot, settings: {}})) {
    pushes.push(push);
  }
  return {pushes, python: given.pushes, resolution: given.resolution};
}

// What the judges say about the slices of the library's runs: the first difference of each run.
function compareChallenges() {
  return files["challenges.json"].map(({title, samples, pushes, end}) => {
    const settings = defaults(robots.go2);
    const challenge = challenges.find((each) => each.title === title);
    const judge = createJudge(challenge, settings), differences = [];
    const look = ({won, message}) => {
      const found = judge.status;
      if (found.isWon !== won || found.message !== message) {
        differences.push([message, found.message]);
      }
    };
    const waiting = [...pushes];
    for (const {sample, verdict} of samples) {
      while (waiting.length && waiting[0].start < sample.time) judge.push(waiting.shift());
      judge.observe(sample, settings);
      look(verdict);
    }
    if (end) {
      judge.ended(end.outcome, settings);
      look(end.verdict);
    }
    return {title, won: judge.status.isWon, slices: samples.length, difference: differences[0]};
  });
}

const NO_SETTINGS = [
  null, undefined, 5, "mu", [0.5], new Map(), {hop: 1}, {constructor: 1}, {toString: "x"},
  JSON.parse('{"__proto__": {"mu": 1}}'), {mu: Infinity}, {mu: 1e308}, {mu: -0.5}, {mu: 0},
  {mu: NaN}, {mu: "0.5"}, {mu: null}, {mu: [0.5]}, {mu: undefined}, {mu: 1n}, {actualMu: 1e308},
  {payload: -1}, {payload: 1e9}, {gravity: 0}, {gravity: -9.81}, {height: 10}, {forward: NaN},
  {facets: 5}, {facets: "4"}, {facets: "length"}, {torque: 0}, {torque: 2}, {lifted: "paw"},
  {lifted: "__proto__"}, {lifted: 0}, {gait: "hop"}, {gait: "constructor"}, {gait: "__proto__"},
  {gait: "toString"}, {gait: 1}, {gait: ""}, {gait: ["trot"]}, {speed: 50}, {turn: -Infinity},
  {assumedOff: "no"}, {assumedOff: 0}, {actualOff: null}, {actualOff: "gravity"},
  {assumedOff: [null]}, {assumedOff: ["inertia"]}, {actualOff: ["drift"]}, {leg: null},
  {leg: "paw"}, {mu: 0.3, gait: "hop"}, {mu: {valueOf: 5, toString: 5}},
  {mu: Object.create(null)},
];
const NO_PUSHES = [
  null, 5, {}, {force: [1, 0, 0]}, {duration: 0.1}, ...[
    null, 5, "left", [1, 0], [1, 0, 0, 0], ["1", 0, 0], [NaN, 0, 0], [Infinity, 0, 0],
    [1e308, 1e308, 0], [1e6, 0, 0],
  ].map((force) => ({force, duration: 0.1})), ...[
    {duration: 0}, {duration: -1}, {duration: Infinity}, {duration: "long"}, {body: -1},
    {body: 1e9}, {body: "base"}, {at: [NaN, 0, 0]}, {at: [1e308, 0, 0]}, {at: null}, {start: NaN},
    {start: -1}, {start: "now"}, {hop: 1},
  ].map((change) => ({force: [1, 0, 0], duration: 0.1, ...change})),
];

// A run among settings and pushes that make no sense, beside one without them.
function compareRefusals() {
  const robot = robots.go2, engine = engines.go2, end = [], accepted = [];
  const tryTo = (call, given) => {
    try {
      call();
      accepted.push(given);
    } catch (error) {
      if (!(error instanceof Refusal)) accepted.push(`${given}: ${error}`);
    }
  };
  for (const isDisturbed of [false, true]) {
    engine.set({...defaults(robot), gait: "trot", speed: 0.3});
    engine.reset();
    for (let step = 0; step < 1000; step++) {
      if (isDisturbed && step % 500 === 0) {
        NO_SETTINGS.forEach((each, i) => tryTo(() => engine.set(each), `setting ${i}`));
        NO_PUSHES.forEach((each, i) => tryTo(() => engine.push(each), `push ${i}`));
      }
      engine.step();
    }
    end.push([...engine.com(), JSON.stringify(engine.settings), engine.outcome]);
  }
  return {accepted, end, tried: NO_SETTINGS.length + NO_PUSHES.length};
}
