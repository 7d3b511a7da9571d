// The page with a live robot: `floatbaseRobot.open(config)`. The physics and the controller run in
// a worker, see engine/worker.js; this page draws them with the viewer's scene, player and legend.
//
// config: as for the viewer, with `robots`, the names to choose from. The address may have
// ?name=…&mu=…&push=…&gait=…&panel=0. Values that make no sense are refused in words, and count as
// not given.

import {numberOf} from "./controls.js";
import {element, make, showNotice} from "./dom.js";
import {createDrag} from "./drag.js";
import {choiceRule, numberRule, rangeOf, rows} from "./engine/settings.js";
import {readAddress} from "./live/attributes.js";
import {controlsOf, labelOf, settingsText} from "./live/controls.js";
import {createFootView} from "./live/foot_view.js";
import {createJoystick} from "./live/joystick.js";
import {createPainter} from "./live/painter.js";
import {createRecoveryMap} from "./live/recovery_map.js";
import {conflictLines, createVoice, limitOf, multiplierText} from "./live/words.js";
import {unpack} from "./loader.js";
import {detachGifWorker, findNode} from "./meshcat.js";
import {startWhenSeen, watchSight} from "./visibility.js";

const PLOT_PERIOD = 0.05; // s
const TEXT_PERIOD = 250; // ms
const DEFAULT_PUSH = 0.25; // times the weight
const STEPS_BY = 5; // N, of a push that is dragged
const REFUSAL_TIME = 6000; // ms for which the page shows why something was refused
const STOOD_UP = {rank: -1, text: "The robot is on its feet again. Push it."};
const EXPLAINED = { // texts of the panel's sections
  "model and reality": "model: what the controller assumes. reality: what the robot has.",
};
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
    scene.apply(await unpack(new Uint8Array(await response.arrayBuffer())));
    scene.fit();
    live(scene, worker, send, await ready, {config, given, name, sight});
  } catch (error) {
    showNotice(error.message);
    parent.postMessage({floatbase: "unavailable"}, "*");
  }
}

function live(scene, worker, send, {drawing, settings, robot}, {config, given, name, sight}) {
  const {low, high} = rangeOf("push", robot);
  const force = given.read("push", numberRule(low, high), numberOf)
    ?? 5 * Math.round(DEFAULT_PUSH * robot.weight / 5);
  const push = {force, towards: 90, duration: rows.duration.first};
  const painter = createPainter(scene, drawing, robot);
  const drawMap = createRecoveryMap(scene.viewer, {
    size: drawing.size, name, say: (content) => text("map", content),
  });
  const footView = createFootView(scene.viewer, robot, drawing, (foot) => {
    send({foot});
    scene.handle({type: "set_control_value", path: "", name: labelOf(rows.foot),
      value: robot.points.indexOf(foot) + 1});
  });
  const newtons = make("output", {className: "newtons"});
  document.body.append(newtons);
  const hasPanel = given.read("panel", choiceRule(["0", "1"])) !== "0";
  let frame = null, isWaiting = false, dragged = null, plotted = -1, written = 0, isPaused = false;

  let gait = null;
  const mostOf = (name) => robot.gaits[name]?.most ?? [0, 0];
  const joystick = createJoystick(() => mostOf(gait), (motion) => send({set: motion}));
  element("meshcat-pane").append(joystick.box);
  // Walk with a gait, forwards at first; null: stand.
  function walk(chosen) {
    const [x, y] = gait === null ? [0, 0.5] : joystick.at(), [fastest, sharpest] = mostOf(chosen);
    const motion = chosen === null ? {} : {speed: y * fastest, turn: -x * sharpest};
    const changes = {gait: chosen, lifted: null, ...motion};
    showGait({...frame?.settings ?? settings, ...changes});
    send({set: changes});
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
  const first = given.read("gait", choiceRule(Object.keys(robot.gaits))) ?? null;
  const controls = controlsOf(robot, {...settings, gait: first}, push, {
    names: config.robots, name, walk, draw: painter.show, watch: footView.watch,
    open(other) {
      given.texts.set("name", other);
      location.search = given.texts;
    },
  });
  const changes = new Map(controls.map(({command, change}) => [command.name, change]));
  const buttons = {
    push: () => ({push: {force: vector(push), duration: push.duration}}),
    "stand up": () => ({reset: true}),
    undo: () => ({undo: true}),
    "reset everything"() {
      for (const {command, change, shown} of controls) {
        if (shown || ["robot", "challenge"].includes(command.name)) continue;
        change(command.value);
        scene.handle({type: "set_control_value", path: "", name: command.name,
          value: command.value});
      }
      return {resetAll: true};
    },
    pause() {
      isPaused = !isPaused;
      return {pause: isPaused};
    },
    step() {
      isPaused = true;
      return {pause: true, step: true};
    },
    "push-recovery map"() {
      const {settings: present, com} = frame;
      drawMap(present, settingsText(controls, present, settings), com);
    },
  };
  if (hasPanel) {
    for (const key of Object.keys(buttons)) {
      scene.handle({type: "set_control", path: "", name: key});
    }
    for (const {command} of controls) scene.handle(command);
    for (const [section, content] of Object.entries(EXPLAINED)) {
      scene.handle({type: "set_text", path: "", name: "explained", text: content, section});
    }
  }
  else document.body.append(pushButton());
  scene.onMessage(({name: key, value}) => {
    if (frame === null) return;
    const message = buttons[key] ? buttons[key]() : changes.get(key)?.(value);
    if (message) send(message);
  });
  scene.handle({type: "set_legend", path: "", items: drawing.legend});

  // Without the panel, a button pushes, also for those who use no mouse.
  function pushButton() {
    return make("button", {
      type: "button", className: "push", textContent: `push ${push.force} N`,
      onclick: () => send(buttons.push()),
    });
  }
  const tell = createVoice((text) => {
    scene.handle({type: "set_title", path: "", text});
    parent.postMessage({floatbase: "limit", text}, "*");
  });
  const drag = createDrag(scene.viewer, {
    isWanted: ({button}) => button === 0 && frame !== null && frame.outcome === "",
    most: () => 2.5 * robot.weight,
    show(now) {
      dragged = grabbed(now);
      const [x, y, z] = [now.at.x, now.at.y, now.at.z];
      newtons.textContent = `${Math.hypot(...dragged.force).toFixed(0)} N`;
      placeLabel(newtons, scene.viewer, {x, y, z});
    },
    release(now) {
      newtons.textContent = "";
      dragged = null;
      if (now === null) return;
      const {body, at, force: pushed} = grabbed(now);
      send({push: {body, at, force: pushed, duration: push.duration}});
      parent.postMessage({floatbase: "push", force: pushed}, "*");
    },
  });
  scene.viewer.renderer.domElement.addEventListener("pointermove", (event) => {
    scene.viewer.renderer.domElement.style.cursor = drag.hit(event) ? "grab" : "";
  });
  const joints = drawing.links.map(([joint, item]) => [joint, ["meshcat", ...item.split("/")]]);
  // What a drag means: body and point in its frame, point in the world, and force, z up.
  function grabbed({at: {x, y, z}, node, force: size, towards}) {
    const joint = joints.find(([, names]) => isBelow(node, findNode(scene.viewer, names)))?.[0]
      ?? 1;
    const world = [x, -z, y], R = frame.rotations.subarray(9 * joint, 9 * joint + 9);
    const away = world.map((c, i) => c - frame.positions[3 * joint + i]);
    const at = [0, 1, 2].map((c) => R[c] * away[0] + R[3 + c] * away[1] + R[6 + c] * away[2]);
    const rounded = STEPS_BY * Math.round(size / STEPS_BY);
    return {body: robot.bodies[joint], joint, at, world, force: vector({force: rounded, towards})};
  }

  function draw(next) {
    frame = next;
    painter.draw(frame);
    footView.draw(frame);
    const acting = frame.pushes.find(({start: begin}) => begin <= frame.time);
    if (dragged) painter.drawPush(dragged.world, dragged.force);
    else if (acting) painter.drawPush(placeOf(acting), acting.force);
    else painter.drawPush(null, null);
    tell(limitOf(frame, robot), performance.now());
    if (frame.time < plotted) plotted = -1;
    if (hasPanel) report();
    scene.viewer.set_dirty();
  }
  function placeOf({body, at}) {
    const joint = robot.bodies.indexOf(body), {rotations: R, positions: p} = frame;
    return [0, 1, 2].map((r) => p[3 * joint + r] + at.reduce(
      (sum, c, i) => sum + R[9 * joint + 3 * r + i] * c, 0,
    ));
  }
  function report() {
    // at the first picture there are no measured forces yet
    if (frame.time >= plotted + PLOT_PERIOD && frame.time > 0) {
      plotted = frame.time;
      const away = frame.planned.map((x, i) => x - frame.measured[i]);
      scene.handle({type: "add_plot_point", path: "", name: "planned minus measured force",
        unit: "N", t: frame.time, value: Math.hypot(...away)});
    }
    const now = performance.now();
    if (now < written + TEXT_PERIOD) return;
    written = now;
    const {challenge} = frame;
    text("challenge", challenge ? `${challenge.text}\n${challenge.message}` : "");
    text("active", frame.conflict.length ? conflictLines(frame.conflict)
      : multiplierText(frame.active));
    if (isPaused) return text("speed", `Paused at ${frame.time.toFixed(3)} s.`);
    const wanted = scene.controls.speed?.getValue() ?? 0, slow = [1, 0.5, 0.25, 0.1][wanted];
    text("speed", frame.factor < SLOW * slow
      ? `This computer is too slow for real time: ${frame.factor.toFixed(2)} × real time.`
      : `${frame.time.toFixed(1)} s, ${frame.factor.toFixed(2)} × real time`);
  }
  function text(key, content) {
    scene.handle({type: "set_text", path: "", name: key, text: content,
      section: key === "active" ? rows.torque_limits.section : ""});
  }

  worker.onmessage = ({data}) => {
    if (data.frame) {
      isWaiting = false;
      draw(data.frame);
      if (!isLive) announce();
    }
    if (data.settings) showSettings(data.settings);
    if (data.stoodUp) tell(STOOD_UP, performance.now());
    if (data.isRefusal) refuse(data.error);
    else if (data.error) showNotice(data.error);
  };
  // Say why something was refused, in the page and to the page around it.
  function refuse(content) {
    tell({rank: -2, text: content, stays: REFUSAL_TIME}, performance.now());
    parent.postMessage({floatbase: "refused", text: content}, "*");
  }
  if (first) walk(first);
  let isLive = false;
  function announce() {
    isLive = true;
    document.body.classList.add("live");
    parent.postMessage({floatbase: "live"}, "*");
    if (given.refused.length) refuse(given.refused.join(" "));
  }
  addEventListener("message", ({data, source}) => {
    if (source !== parent || data?.floatbaseSet === undefined) return;
    send({set: data.floatbaseSet});
  });
  window.floatbaseLive = {send, frame: () => frame}; // for programs that control the page
  (function loop() {
    requestAnimationFrame(loop);
    if (isWaiting || !sight()) return;
    isWaiting = true;
    send({frame: true});
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

function placeLabel(label, viewer, {x, y, z}) {
  const {clientWidth: w, clientHeight: h} = viewer.renderer.domElement;
  const at = viewer.camera.position.clone().set(x, y, z).project(viewer.camera);
  label.style.left = `${(at.x + 1) / 2 * w + 12}px`;
  label.style.top = `${(1 - at.y) / 2 * h - 28}px`;
}

