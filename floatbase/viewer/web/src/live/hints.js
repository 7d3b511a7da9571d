// The line in the picture that says what to do: drag the robot, and after the first push what else
// to try. A line stays until it was done, or until the reader asks for the next one.

import {element, make} from "../dom.js";
import {rows} from "../engine/settings.js";
import {WEAK} from "./words.js";

const WATCHED = 4000; // ms in which the effect of what was done is watched
const FIRST = "Drag the robot";
const MOON = 2; // m/s²: less gravity counts as the Moon's

const at = (key) => `Open “controls”, then “${rows[key].section}”`;

// What to try with a robot: [line, isDone(frame)]. The words in quotation marks are those of the
// page. frame: what the worker sends.
export const triesOf = (robot) => [
  ["Pull farther: at which force does it fall?", ({outcome}) => outcome !== ""],
  ["Point at a foot, or tap it. How far is its force from slipping?", ({foot}) => foot !== null],
  ["Push it from the front or from behind. Is it as strong as when its side is pushed?",
    ({pushes}) => pushes.some(({force: [x, y]}) => Math.abs(x) > Math.abs(y))],
  [`${at("friction")}: lower the friction of reality only, and push.`,
    ({settings: {mu, actualMu}, pushes}) => actualMu < mu && pushes.length > 0],
  ...(Object.keys(robot.gaits).length ? [[
    `${at("gait")}: choose the gait trot, and push the robot as it walks.`,
    ({settings, pushes}) => settings.gait !== null && pushes.length > 0]] : []),
  ...(robot.lifted.length ? [[
    `${at("lift")}: lift a foot. The robot moves its mass over the others first.`,
    ({settings}) => settings.lifted !== null]] : []),
  ["Press “model” below “+ g” at the top: the controller ignores the weight, and the robot sags.",
    ({settings}) => settings.assumedOff.includes("gravity")],
  [`${at("torque_limits")}: lower the torque limits until a motor is named above.`,
    ({seen}) => seen.some(([kind, , , multiplier]) => (
      kind.endsWith("torque limit") && multiplier > WEAK))],
  [`${at("gravity")}: set gravity to 1.6 m/s², as on the Moon, and push again.`,
    ({settings, pushes}) => settings.gravity < MOON && pushes.length > 0],
];

// tries: lines after the first push. Returns a function that each picture calls with its frame.
export function createHint(tries) {
  const box = element("hint"), line = make("span", {role: "status", textContent: FIRST});
  const skip = make("button", {
    type: "button", textContent: "›", title: "another idea", ariaLabel: "another idea",
  });
  box.append(line);
  let next = -1, timer = 0;
  function show() {
    clearTimeout(timer); // the reader may ask for the next line first
    timer = 0;
    line.textContent = tries[++next]?.[0] ?? "";
    if (next === 0) box.append(skip);
    if (next >= tries.length) box.replaceChildren();
  }
  skip.onclick = show;
  return (frame) => {
    const isDone = next < 0 ? frame.pushes.length > 0 : tries[next]?.[1](frame);
    if (isDone && !timer) timer = setTimeout(show, next < 0 ? 0 : WATCHED);
  };
}
