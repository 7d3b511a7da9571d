// The compiled control step: the WebAssembly module that `make live` builds from
// floatbase/control/tick. All tasks, constraints and the solver are in the module.

// names of the arguments of `tick` in floatbase/control/tick/tick.py
const ARGUMENTS = [
  "q", "v", "inputs", "sizes", "ints", "floats", "floatWork", "intWork", "result",
];
// those of `write_targets` in floatbase/behaviours/walk/compiled_targets.py, after the time
const TARGET_ARGUMENTS = ["com", "comVelocity", "body", "pieces", "swings", "inputs"];
const MOST_PIECES = 16, MOST_SWINGS = 4; // of a plan
const INTEGERS = new Set(["sizes", "ints", "intWork"]);
const PROBED = ["inputs", "sizes", "ints", "floats", "result"];
const N_STAGES = 5n;
const ITEM = 8; // bytes of a number
const PAGE = 65536; // bytes of a page of memory
export const NO_ANSWER = {invalid: -1, inaccurate: -2, infeasible: -3};

class Unavailable extends Error {}

// What the module imports. Code that allocates memory, such as a singular value decomposition for
// nearly redundant contacts, is not available: the tick then has no answer.
function imports(module, memory) {
  const env = {
    __multi3(result, aLow, aHigh, bLow, bHigh) { // 128-bit product
      const mask = (1n << 64n) - 1n;
      const product = ((aHigh << 64n) | (aLow & mask)) * ((bHigh << 64n) | (bLow & mask));
      const view = new BigInt64Array(memory().buffer, result, 2);
      view[0] = BigInt.asIntN(64, product);
      view[1] = BigInt.asIntN(64, product >> 64n);
    },
  };
  for (const {name} of WebAssembly.Module.imports(module)) {
    env[name] ??= () => { throw new Unavailable(name); };
  }
  return {env};
}

// The control step of a robot. module: the compiled WebAssembly module. robot: its data, see
// floatbase/live/robots.py. `views` are its inputs and outputs, to be filled and
// read in place.
export function createTick(module, robot) {
  let memory = null;
  const {exports} = new WebAssembly.Instance(module, imports(module, () => memory));
  memory = exports.memory;
  const problems = Object.values(robot.problems);
  const most = (get) => Math.max(...problems.map(get));
  const {nq, nv, walking} = robot, layout = walking?.layout;
  const lengths = {
    q: nq, v: nv,
    inputs: most((one) => one.inputs.length), sizes: most((one) => one.sizes.length),
    ints: most((one) => one.ints.length), floats: most((one) => one.floats.length),
    floatWork: most((one) => one.workspace[0]), intWork: most((one) => one.workspace[1]),
    result: most((one) => one.resultSize),
    com: 3, comVelocity: 3, body: layout?.BODY_SIZE ?? 0,
    pieces: MOST_PIECES * (layout?.PIECE_SIZE ?? 0),
    swings: MOST_SWINGS * (layout?.SWING_SIZE ?? 0),
  };
  let at = (exports.__heap_base.value + 63) & ~63;
  const place = (bytes) => {
    const begin = at;
    at += (bytes + 63) & ~63;
    return begin;
  };
  const returned = place(ITEM), exception = place(ITEM);
  const begins = Object.fromEntries(
    Object.entries(lengths).map(([name, length]) => [name, place(ITEM * length)]),
  );
  memory.grow(Math.max(0, Math.ceil((at - memory.buffer.byteLength) / PAGE)));
  const views = Object.fromEntries(Object.keys(lengths).map((name) => {
    const kind = INTEGERS.has(name) ? BigInt64Array : Float64Array;
    return [name, new kind(memory.buffer, begins[name], lengths[name])];
  }));
  const status = new BigInt64Array(memory.buffer, returned, 1);
  const stack = exports.__stack_pointer.value;
  let args = [], problem = null;

  // numba's form of an array: owner, parent, items, bytes of an item, address, shape, strides
  function array(name, shape) {
    const strides = shape.length === 2 ? [ITEM * shape[1], ITEM] : [ITEM];
    const count = shape.reduce((a, b) => a * b, 1);
    return [0, 0, BigInt(count), BigInt(ITEM), begins[name], ...shape.map(BigInt),
      ...strides.map(BigInt)];
  }
  function sizeOf(name) {
    if (name === "floatWork") return problem.workspace[0];
    if (name === "intWork") return problem.workspace[1];
    if (name === "result") return problem.resultSize;
    return problem[name]?.length ?? lengths[name];
  }
  let targetArgs = [], targetShape = "";
  return {
    views,
    math: exports, // exp, sin, cos, atan2 and hypot, the same in every browser
    // Write the targets of a walk at t, s, from the arrays `body`, `pieces` and `swings`, of which
    // the first rows are used.
    writeTargets(t, pieces, swings) {
      const shape = `${pieces} ${swings} ${problem.inputs.length}`;
      if (shape !== targetShape) {
        targetShape = shape;
        const rows = {pieces: [pieces, layout.PIECE_SIZE], swings: [swings, layout.SWING_SIZE]};
        targetArgs = TARGET_ARGUMENTS.flatMap((name) => array(name, rows[name] ?? [sizeOf(name)]));
      }
      exports.write_targets(returned, exception, t, ...targetArgs);
    },
    get problem() { return problem; },
    // Solve another of the robot's problems from now on.
    select(name) {
      problem = robot.problems[name];
      views.sizes.set(problem.sizes.map(BigInt));
      views.ints.set(problem.ints.map(BigInt));
      views.floats.set(problem.floats);
      views.inputs.set(problem.inputs);
      args = [returned, exception, ...ARGUMENTS.flatMap((name) => array(name, [sizeOf(name)])),
        N_STAGES];
    },
    // Call call(), which may change `views` and run the step. Afterwards they are as before.
    probe(call) {
      const kept = PROBED.map((name) => [name, views[name].slice()]);
      try {
        return call();
      } finally {
        for (const [name, values] of kept) views[name].set(values);
      }
    },
    // Compute the command for the present contents of `views`. Returns the number of active
    // constraints, or one of NO_ANSWER.
    run() {
      try {
        return exports.tick(...args) === 0 ? Number(status[0]) : NO_ANSWER.inaccurate;
      } catch (error) {
        if (!(error instanceof Unavailable)) throw error;
        exports.__stack_pointer.value = stack;
        return NO_ANSWER.inaccurate;
      }
    },
  };
}

// Set the numbers of a problem that depend on a value: base + slope × value, and the lengths of
// rows, √(base + slope × value²). parameter: as in a robot's data.
export function setParameter(numbers, parameter, value) {
  const {at, base, slope, lengthAt = [], lengthBase, lengthSlope} = parameter;
  for (let i = 0; i < at.length; i++) numbers[at[i]] = base[i] + slope[i] * value;
  for (let i = 0; i < lengthAt.length; i++) {
    numbers[lengthAt[i]] = Math.sqrt(lengthBase[i] + lengthSlope[i] * value * value);
  }
}
