// The page with a live robot: `floatbaseRobot.open(config)`. The physics and the controller run in
// a worker, see engine/worker.js; this page draws them with the viewer's scene, player and legend.
//
// config: as for the viewer, with `robots`, the names to choose from. The address may have
// ?name=…&mu=…&push=…&gait=…&panel=0, and after # the settings, the view and a push, see address.js
// and docs/embed.md. Values that make no sense are refused in words, and count as not given.

import {numberOf} from "./controls.js";
import {element, make, showNotice} from "./dom.js";
import {createDrag} from "./drag.js";
import {choiceRule, numberRule, rangeOf, rows} from "./engine/settings.js";
import {readAddress} from "./live/attributes.js";
import {controlsOf, labelOf, settingsText} from "./live/controls.js";
import {createFootView} from "./live/foot_view.js";
import {createHint, triesOf} from "./live/hints.js";
import {createJoystick} from "./live/joystick.js";
import {createPainter} from "./live/painter.js";
import {createRecoveryMap} from "./live/recovery_map.js";
import {conflictLines, createVoice, multiplierText, watchLimits} from "./live/words.js";
import {unpack} from "./loader.js";
import {detachGifWorker, findNode} from "./meshcat.js";
import {startWhenSeen, watchSight} from "./visibility.js";

const PLOT_PERIOD = 0.05; // s
const TEXT_PERIOD = 250; // ms
const REFUSAL_TIME = 6000; // ms for which the page shows why something was refused
const STOOD_UP = {rank: -1, text: "The robot is on its feet again. Push it."};
const EXPLAINED = { // texts of the panel's sections
  "model and reality": "model: what the controller assumes. reality: what the robot has.",
};
const STANDS_ONLY = "Here this robot only stands. Humanoids walk in the playground, " +
  "`floatbase view talos`.";
const ROOMY = 1000; // pixels: in a narrower page, the panel is folded until it is wanted
const PUSHED_AFTER = 1; // s: when the push in an address acts
const SETTLED = 1000; // ms after a change in which the texts of a paused robot become up to date
const SLOW = 0.95; // of the wanted speed: with less, the page says how slow it is

export function open(config) {
  detachGifWorker();
  const given = readAddress(location.search);
  const name = given.read("name", choiceRule(config.robots)) ?? config.robots[0];
  document.body.style.setProperty("--first", `url("${name}.png")`);
  if (typeof WebAssembly === "undefined" || location.protocol === "file:") {
    return showNotice("A live robot needs WebAssembly, and a page that comes from a server. " +
      "`python -m http.server` in this folder starts one.");
  }
  const worker = new Worker("engine.js", {type: "module"});
  let isSeen = true;
  startWhenSeen(config, (scene) => start(scene, worker, {config, given, name, sight: () => isSeen}),
    (changed) => watchSight((now) => {
      isSeen = now;
      changed(now);
    }));
}

async function start(scene, worker, {config, given, name, sight}) {
  const send = (message) => worker.postMessage(message);
  const {low, high} = rows.friction, mu = given.read("mu", numberRule(low, high), numberOf);
  send({start: {name, settings: mu === undefined ? {} : {mu, actualMu: mu}}});
  const ready = new Promise((resolve, reject) => {
    worker.onmessage = ({data}) => data.error ? reject(new Error(data.error))
      : data.ready && resolve(data.ready);
    worker.onerror = () => reject(new Error("The controller could not be started."));
  });
  try {
    const response = await fetch(`${name}.scene`);
    if (!response.ok) throw new Error(`The robot's picture cannot be loaded (${response.status}).`);
    scene.apply(await unpack(new Uint8Array(await response.arrayBuffer())));
    scene.fit();
    live(scene, worker, send, await ready, {config, given, name, sight});
  } catch (error) {
    showNotice(error.message);
    parent.postMessage({floatbase: "unavailable"}, "*");
  }
}

function live(scene, worker, post, {drawing, settings, robot}, {config, given, name, sight}) {
  let changed = 0; // ms, when the robot or its picture was changed by the reader
  let pushed = null; // the last push, as the worker gets it
  const send = (message) => {
    changed = performance.now();
    if (message.push) {
      pushed = message.push;
      parent.postMessage({floatbase: "push", force: pushed.force}, "*");
    }
    post(message);
  };
  const {low, high, first} = rangeOf("push", robot);
  const force = given.read("push", numberRule(low, high), numberOf) ?? first;
  const push = {force, towards: rows.towards.first, duration: rows.duration.first};
  const painter = createPainter(scene, drawing, robot);
  const recoveryMap = createRecoveryMap(scene.viewer, {
    size: drawing.size, name, say: (content) => text("map", content),
  });
  const footView = createFootView(scene.viewer, robot, drawing, (foot) => {
    send({foot});
    scene.handle({type: "set_control_value", path: "", name: labelOf(rows.foot),
      value: robot.points.indexOf(foot) + 1});
  });
  const hasPanel = given.read("panel", choiceRule(["0", "1"])) !== "0";
  let frame = null, isWaiting = false, dragged = null, plotted = -1, written = 0, isPaused = false;
  const limitAt = watchLimits(robot);

  let gait = null;
  const mostOf = (name) => robot.gaits[name]?.most ?? [0, 0];
  const joystick = createJoystick(() => mostOf(gait), (motion) => send({set: motion}));
  element("meshcat-pane").append(joystick.box);
  // Walk with a gait, forwards at first; null: stand. message: what the worker gets.
  function walk(chosen, message = "set") {
    const [x, y] = gait === null ? [0, 0.5] : joystick.at(), [fastest, sharpest] = mostOf(chosen);
    const motion = chosen === null ? {} : {speed: y * fastest, turn: -x * sharpest};
    const changes = {gait: chosen, lifted: null, ...motion};
    showGait({...frame?.settings ?? settings, ...changes});
    send({[message]: changes});
  }
  function showGait(now) {
    ({gait} = now);
    joystick.show(gait !== null);
    joystick.put(now);
  }
  // Show settings that the page did not set itself.
  function showSettings(now) {
    for (const {command: {name: key}, shown} of controls) {
      if (shown && hasPanel) {
        scene.handle({type: "set_control_value", path: "", name: key, value: shown(now)});
      }
    }
    showGait(now);
  }
  const firstGait = given.read("gait", choiceRule(Object.keys(robot.gaits))) ?? null;
  const shove = () => ({push: {force: vector(push), duration: push.duration}});
  const pause = (isNow) => {
    isPaused = isNow;
    return {pause: isNow};
  };
  const controls = controlsOf(robot, {...settings, gait: firstGait}, push, {
    names: config.robots, name, walk, draw: painter.show, watch: footView.watch,
    open(other) {
      given.texts.set("name", other);
      location.assign(`?${given.texts}${scene.address.settings()}`);
    },
  });
  const changes = new Map(controls.map(({command, change}) => [command.name, change]));
  const showHint = createHint(hasPanel ? triesOf(robot) : []);
  const buttons = {
    push_button: shove,
    run: () => pause(false),
    pause: () => pause(true),
    step: () => ({...pause(true), step: true}),
    reset: () => ({reset: true}),
    undo: () => ({undo: true}),
    reset_all() {
      for (const {command, change, shown} of controls) {
        if (shown || [rows.robot.name, rows.challenge.name].includes(command.name)) continue;
        change(command.value);
        scene.handle({...command, type: "set_control_value"});
      }
      pushed = null;
      recoveryMap.clear();
      return {...pause(false), resetAll: true};
    },
    map() {
      if (frame === null) return;
      const {settings: present, com} = frame;
      recoveryMap.start(present, settingsText(controls, present, settings), com);
    },
  };
  const presses = new Map(Object.entries(buttons).map(([key, press]) => [rows[key].name, press]));
  scene.onMessage(({name: key, value}) => { // also while the address sets the controls
    const message = (presses.get(key) ?? changes.get(key))?.(value);
    if (message) send(message);
  });
  if (firstGait) walk(firstGait, "begin");
  if (hasPanel) {
    for (const name of presses.keys()) scene.handle({type: "set_control", path: "", name});
    for (const {command} of controls) scene.handle(command);
    const explained = {...EXPLAINED};
    if (!Object.keys(robot.gaits).length) explained[rows.gait.section] = STANDS_ONLY;
    for (const [section, content] of Object.entries(explained)) {
      scene.handle({type: "set_text", path: "", name: "explained", text: content, section});
    }
  }
  else element("page").append(pushButton());
  if (hasPanel && innerWidth < ROOMY) scene.foldPanel(true);
  scene.handle({type: "set_legend", path: "", items: drawing.legend});

  // Without the panel, a button pushes, also for those who use no mouse.
  function pushButton() {
    return make("button", {
      type: "button", className: "push", textContent: `push ${push.force} N`,
      onclick: () => send(shove()),
    });
  }
  const tell = createVoice((text) => {
    scene.handle({type: "set_title", path: "", text});
    element("title").title = frame?.conflict.length ? conflictLines(frame.conflict) : "";
    parent.postMessage({floatbase: "limit", text}, "*");
  });
  createDrag(scene.viewer, {
    isWanted: () => frame !== null && frame.outcome === "",
    most: () => 2.5 * robot.weight,
    show(now) {
      dragged = grabbed(now);
      changed = performance.now();
    },
    release(now) {
      dragged = null;
      if (now === null) return;
      const {body, at, force: newtons} = grabbed(now);
      send({push: {body, at, force: newtons, duration: push.duration}});
    },
  });
  const joints = drawing.links.map(([joint, item]) => [joint, ["meshcat", ...item.split("/")]]);
  // What a drag means: body and point in its frame, point in the world, and force, z up.
  function grabbed({at: {x, y, z}, node, force: size, towards}) {
    const joint = joints.find(([, names]) => isBelow(node, findNode(scene.viewer, names)))?.[0]
      ?? 1;
    const world = [x, -z, y], R = frame.rotations.subarray(9 * joint, 9 * joint + 9);
    const away = world.map((c, i) => c - frame.positions[3 * joint + i]);
    const at = [0, 1, 2].map((c) => R[c] * away[0] + R[3 + c] * away[1] + R[6 + c] * away[2]);
    return {body: robot.bodies[joint], joint, at, world, force: vector({force: size, towards})};
  }

  function draw(next) {
    frame = next;
    painter.draw(frame);
    const acting = frame.pushes.find(({start: begin}) => begin <= frame.time);
    if (dragged) painter.drawPush(dragged.world, dragged.force);
    else if (acting) painter.drawPush(placeOf(acting), acting.force);
    else painter.drawPush(null, null);
    tell(limitAt(frame), performance.now());
    showHint(frame);
    if (frame.time < plotted) plotted = -1;
    if (hasPanel) report();
  }
  function placeOf({body, at}) {
    const joint = robot.bodies.indexOf(body), {rotations: R, positions: p} = frame;
    return [0, 1, 2].map((r) => p[3 * joint + r] + at.reduce(
      (sum, c, i) => sum + R[9 * joint + 3 * r + i] * c, 0,
    ));
  }
  function report() {
    footView.draw(frame);
    // at the first picture there are no measured forces yet
    if (frame.time >= plotted + PLOT_PERIOD && frame.time > 0) {
      plotted = frame.time;
      const away = frame.planned.map((x, i) => x - frame.measured[i]), {name: quantity, unit} =
        rows.force_error;
      const value = robot.points.reduce(
        (sum, _, i) => sum + Math.hypot(...away.subarray(3 * i, 3 * i + 3)), 0);
      scene.handle({type: "add_plot_point", path: "", name: quantity, unit, t: frame.time, value});
    }
    const now = performance.now();
    if (now < written + TEXT_PERIOD) return;
    written = now;
    const {challenge} = frame;
    text("challenge", challenge ? `${challenge.text}\n${challenge.message}` : "");
    text("active", frame.conflict.length ? conflictLines(frame.conflict)
      : multiplierText(frame.active));
    if (isPaused) return text("speed", `Paused at ${frame.time.toFixed(3)} s.`);
    const wanted = scene.controls[labelOf(rows.speed)].getValue();
    text("speed", frame.factor < SLOW * wanted
      ? `${frame.time.toFixed(1)} s, ${frame.factor.toFixed(2)} × real time: a slow computer`
      : `${frame.time.toFixed(1)} s, ${frame.factor.toFixed(2)} × real time`);
  }
  function text(key, content) {
    scene.handle({type: "set_text", path: "", name: key, text: content,
      section: key === "active" ? rows.torque_limits.section : ""});
  }

  worker.onmessage = ({data}) => {
    if (data.frame) {
      isWaiting = false;
      if (data.hasNews) showSettings(data.frame.settings);
      draw(data.frame);
      if (!isLive) announce();
    }
    if (data.stoodUp) tell(STOOD_UP, performance.now());
    if (data.isRefusal) refuse(data.error);
    else if (data.error) showNotice(data.error);
  };
  // Say why something was refused, in the page and to the page around it.
  function refuse(content) {
    tell({rank: -2, text: content, stays: REFUSAL_TIME}, performance.now());
    parent.postMessage({floatbase: "refused", text: content}, "*");
  }
  // What the address has beside the controls: how the robot walks, and a push after a second. A
  // push is the number of a joint, or -1 for the middle of the base, a point, a force, a duration.
  scene.lookAsAddressed();
  const motion = scene.address.numbers("motion", 2), again = scene.address.numbers("pushed", 8);
  if (motion && gait !== null) joystick.move(...motion);
  if (again) {
    const [joint, x, y, z, ...rest] = again, acts = {force: rest.slice(0, 3), duration: rest[3]};
    const at = joint < 0 ? {} : {body: robot.bodies[joint], at: [x, y, z]};
    send({push: {...acts, ...at, start: PUSHED_AFTER}});
  }
  scene.onLink(() => ({
    motion: gait === null ? undefined : joystick.at(),
    pushed: pushed && [robot.bodies.indexOf(pushed.body), ...pushed.at ?? [0, 0, 0],
      ...pushed.force, pushed.duration],
  }));
  let isLive = false;
  function announce() {
    isLive = true;
    document.body.classList.add("live");
    parent.postMessage({floatbase: "live"}, "*");
    if (given.refused.length) refuse(given.refused.join(" "));
  }
  addEventListener("message", ({data, source}) => {
    if (source !== parent || data?.floatbaseSet === undefined) return;
    send({set: data.floatbaseSet, show: true});
  });
  window.floatbaseLive = {send, frame: () => frame}; // for programs that control the page
  (function loop() {
    requestAnimationFrame(loop);
    const hasSettled = isPaused && performance.now() > changed + SETTLED;
    if (isWaiting || !sight() || hasSettled) return;
    isWaiting = true;
    post({frame: true});
  })();
}

// The force of a push over the ground, z up.
function vector({force, towards}) {
  const angle = towards * Math.PI / 180;
  return [force * Math.cos(angle), force * Math.sin(angle), 0];
}

function isBelow(object, node) {
  for (let at = object; at && node; at = at.parent) if (at === node.object) return true;
  return false;
}
