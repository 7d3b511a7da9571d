// A pad for the velocity of a walk: up and down for the speed, left and right for turning. The knob
// stays where it is left. With the keyboard: arrow keys, and Escape to stop.

import {make} from "../dom.js";

const STEP = 0.1; // by which a key moves the knob, fraction of its range
const REST = 0.08; // fraction of the range around the middle that counts as the middle

const KEYS = {ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0]};
const within = (x) => Math.max(-1, Math.min(1, x));

// Where the knob is for a pointer at (x, y) px from the middle of a pad: right and up, -1 to 1.
export const knobAt = (x, y, radius) => [x, -y].map((value) => {
  const part = within(value / radius);
  return Math.abs(part) < REST ? 0 : part;
});

// What the pad says. speed: m/s. turn: rad/s, to the left.
export function motionText(speed, turn) {
  if (!speed && !turn) return "on the spot";
  const way = speed < 0 ? "backwards" : "forwards", side = turn < 0 ? "right" : "left";
  const parts = [];
  if (speed) parts.push(`${Math.abs(speed).toFixed(2)} m/s ${way}`);
  if (turn) parts.push(`${Math.abs(turn * 180 / Math.PI).toFixed(0)}°/s to the ${side}`);
  return parts.join(", ");
}

// most: (): [speed, turn], the largest. change({speed, turn}): called for each change.
export function createJoystick(most, change) {
  const knob = make("i"), text = make("output");
  const pad = make("div", {className: "pad", tabIndex: 0}, knob);
  pad.title = "Click the middle to stop.";
  pad.setAttribute("role", "application");
  pad.setAttribute("aria-label",
    "velocity: arrow keys up and down for the speed, left and right to turn, Escape to stop");
  const box = make("div", {className: "joystick", hidden: true}, pad, text);
  let at = [0, 0];
  // Show a velocity.
  function put({speed, turn}) {
    const [fastest, sharpest] = most();
    at = [within(-turn / (sharpest || 1)), within(speed / (fastest || 1))];
    knob.style.transform = `translate(${at[0] * 32}px, ${-at[1] * 32}px)`;
    text.textContent = motionText(speed, turn);
  }
  function move(x, y) {
    const [speed, turn] = most(), now = {speed: within(y) * speed, turn: -within(x) * turn};
    put(now);
    change(now);
  }
  function follow({clientX, clientY}) {
    const {left, top, width, height} = pad.getBoundingClientRect();
    move(...knobAt(clientX - left - width / 2, clientY - top - height / 2, width / 2 - 12));
  }
  pad.onpointerdown = (event) => {
    event.stopPropagation(); // the picture does not turn
    pad.setPointerCapture(event.pointerId);
    follow(event);
  };
  pad.onpointermove = (event) => { if (pad.hasPointerCapture(event.pointerId)) follow(event); };
  pad.onkeydown = (event) => {
    const step = KEYS[event.key];
    if (step) move(at[0] + STEP * step[0], at[1] + STEP * step[1]);
    else if (event.key === "Escape") move(0, 0);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return {
    box,
    show(isShown) { box.hidden = !isShown; },
    put,
    move,
    at: () => at,
  };
}
