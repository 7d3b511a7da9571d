// The line in the picture that says what to do: drag the robot, and after the first push what else
// to try.

import {element} from "../dom.js";

const PERIOD = 12000; // ms for which a line stays
const FIRST = "Drag the robot";

// What to try with a robot. The words in quotation marks are those of the panel.
export const triesOf = (robot) => [
  "Pull farther: at which force does it fall?",
  "Push it from the front. Is it as strong as from the side?",
  "Lower the “friction” of “reality” only.",
  ...(Object.keys(robot.gaits).length ? ["Choose the “gait” trot, and push the robot as it walks."]
    : []),
  ...(robot.lifted.length ? ["“lift” a foot: the robot moves its mass over the others first."]
    : []),
  "Switch off “model” below “+ g” at the top: the robot sags.",
  "Lower the “torque limits” until a motor is named above.",
  "Set “gravity” to 1.6 m/s², as on the Moon, and push again.",
];

// tries: lines after the first push, each once; then the line goes. Returns a function that a push
// calls.
export function createHint(tries) {
  const line = element("hint");
  let next = 0, hasPushed = false;
  function show() {
    line.textContent = tries[next++] ?? "";
    if (next <= tries.length) setTimeout(show, PERIOD);
  }
  line.textContent = FIRST;
  return () => {
    if (hasPushed) return;
    hasPushed = true;
    show();
  };
}
