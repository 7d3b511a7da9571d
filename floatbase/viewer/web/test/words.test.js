import assert from "node:assert/strict";
import test, {mock} from "node:test";
import {slippingPoints} from "../src/engine/contacts.js";
import {createHint} from "../src/live/hints.js";
import {conflictLines, createVoice, footName, jointName, watchLimits} from "../src/live/words.js";

const robot = {points: ["FL_foot", "FR_foot"], weight: 100, resting: ["gripper_joint"]};
const frameWith = (more) => ({
  outcome: "", conflict: [], seen: [], slipping: [], settings: {actualMu: 0.7}, time: 1,
  measured: new Float64Array([0, 0, 50, 0, 0, 50]),
  planned: new Float64Array([0, 0, 50, 0, 0, 50]), ...more,
});

test("the sentence names what limits the robot, the most important first", () => {
  const text = (more) => watchLimits(robot)(frameWith(more)).text;
  assert.match(text({}), /^The robot stands/);
  assert.match(text({settings: {actualMu: 0.7, gait: "trot"}}), /^The robot walks/);
  assert.match(text({measured: new Float64Array(6)}), /in the air/);
  const range = (joint) => ["joint limit", joint, 0, 1];
  assert.match(text({seen: [range("gripper_joint")]}), /^The robot stands/);
  const calves = ["FL", "FR", "RL", "RR"].map((leg) => range(`${leg}_calf_joint`));
  assert.match(text({seen: calves}), /front right calf joint and 2 more are near .* ranges/);
  const friction = ["friction", "FL_foot", 2, 0.3];
  assert.match(text({seen: [friction]}), /front left foot is at its friction limit/);
  const torque = ["upper torque limit", "FL_calf_joint", 0, 0.1];
  assert.match(text({seen: [friction, torque]}), /front left calf joint is at its torque limit/);
  const both = [friction, ["friction", "FR_foot", 0, 0.3]];
  assert.match(text({seen: both}), /left foot and the front right foot are at their friction/);
  const measured = new Float64Array([0, 0, 50, 0, 34.9, 50]);
  const planned = new Float64Array([0, 0, 50, 0, 40, 50]);
  const points = (more) => slippingPoints(frameWith(more), robot);
  assert.deepEqual(points({measured, planned}), ["FR_foot"]);
  assert.deepEqual(points({measured}), []); // the planned force is inside
  assert.match(text({seen: both, slipping: ["FR_foot"]}), /front right foot is slipping/);
  assert.match(text({outcome: "fell"}), /^The robot fell/);
  assert.doesNotMatch(text({height: 0.6}), /stands/); // it lies on its legs
  assert.match(text({outcome: "fell", hasSlipped: true}), /^The feet slipped. The robot fell/);
  const conflict = [["friction", "FL_foot", 0], ["friction", "FL_foot", 3],
    ["upper torque limit", "RL_calf_joint", 0], ["lower torque limit", "RL_hip_joint", 0]];
  assert.match(text({outcome: "infeasible", conflict}),
    /friction of the front left foot, torque limit of the rear left calf joint and 1 more /);
  assert.match(conflictLines(conflict), /2 × friction: front left foot \(facet 1\), .*facet 4/);
});

test("a limit is the reason of a fall less than a second later, but of no later one", () => {
  const limited = frameWith({seen: [["friction", "FL_foot", 2, 0.3]], time: 20});
  const reasonAfter = (...frames) => {
    const limitAt = watchLimits(robot);
    for (const frame of [limited, ...frames]) limitAt(frame);
    return limitAt(frameWith({outcome: "fell", time: frames.at(-1)?.time ?? 20})).text;
  };
  assert.match(reasonAfter(), /fell.* Just before: The front left foot is at its friction limit/);
  assert.match(reasonAfter(frameWith({time: 20.9})), /Just before/);
  assert.doesNotMatch(reasonAfter(frameWith({time: 21.1})), /Just before/);
  assert.doesNotMatch(reasonAfter(frameWith({time: 0.5})), /Just before/); // a new run
});

test("the reader who asks for the next idea after a push sees each one", async () => {
  const box = made();
  function made() {
    return {children: [], append(...all) { this.children.push(...all); },
      replaceChildren() { this.children = []; }};
  }
  globalThis.document = {getElementById: () => box, createElement: made};
  mock.timers.enable({apis: ["setTimeout"]});
  const see = createHint([["one", () => true], ["two", () => false], ["three", () => false]]);
  const [line] = box.children;
  see({pushes: [1]});
  mock.timers.tick(1);
  const [, next] = box.children;
  assert.equal(line.textContent, "one");
  see({pushes: []}); // it is done
  next.onclick();
  mock.timers.tick(10000);
  assert.equal(line.textContent, "two");
  next.onclick();
  next.onclick();
  mock.timers.reset();
  delete globalThis.document;
  assert.deepEqual(box.children, []);
});

test("parts have names that a reader knows", () => {
  assert.equal(footName("HR_FOOT"), "rear right foot");
  assert.equal(footName("left_sole_link corner 1"), "left foot");
  assert.equal(jointName("RL_thigh_joint"), "rear left thigh joint");
});

test("a sentence stays long enough to be read, unless a more important one follows", () => {
  const said = [], tell = createVoice((text) => said.push(text), 600);
  tell({rank: 6, text: "nothing"}, 0);
  tell({rank: 3, text: "friction"}, 100);
  tell({rank: 6, text: "nothing"}, 500);
  assert.deepEqual(said, ["nothing", "friction"]);
  tell({rank: 5, text: "unloaded"}, 600);
  tell({rank: 6, text: "nothing"}, 700);
  assert.deepEqual(said.splice(2), ["unloaded"]); // the most important one of those that waited
  tell({rank: -2, text: "refused", stays: 5000}, 1400);
  tell({rank: 0, text: "fell"}, 6300);
  tell({rank: 6, text: "nothing"}, 6500);
  assert.deepEqual(said.slice(2), ["refused", "fell"]);
});
