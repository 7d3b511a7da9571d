// A plot of a quantity over the last seconds, in the panel.

import {make} from "./dom.js";

const HISTORY = 8; // s
const MARGIN = 4; // pixels above and below the line

// The points [t, value] with another one added. If time goes back, the plot starts again.
export function withPoint(points, t, value) {
  const before = points.length && t < points.at(-1)[0] ? [] : points;
  return [...before, [t, value]].filter(([when]) => when > t - HISTORY);
}

const rounded = (x) => x < 0.05 ? "0" : x < 10 ? x.toFixed(1) : x.toFixed(0);
const peakOf = (points) => Math.max(...points.map(([, value]) => value));

export function plotText({name, value, unit}, points) {
  const peak = rounded(peakOf(points));
  return `${name}: ${rounded(value)} ${unit} (at most ${peak} in the last ${HISTORY} s)`;
}

// The line through points in a picture of w × h pixels: the last point at its right edge.
export function polyline(points, w, h) {
  const now = points.at(-1)[0], most = Math.max(1, peakOf(points)) * 1.1;
  return points.map(([t, value]) => [
    w * (1 - (now - t) / HISTORY), h - MARGIN - (h - 2 * MARGIN) * value / most,
  ]);
}

// prepend(...elements): puts them at the top of the panel.
export function createPlot(prepend) {
  let points = [], canvas = null, label = null;
  return (command) => {
    if (canvas === null) {
      canvas = make("canvas", {width: 560, height: 110, className: "plot"});
      label = make("p", {className: "plot"});
      prepend(label, canvas);
    }
    points = withPoint(points, command.t, command.value);
    const {width, height} = canvas, pen = canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    pen.strokeStyle = getComputedStyle(canvas).color;
    pen.lineWidth = 3;
    pen.beginPath();
    for (const [x, y] of polyline(points, width, height)) pen.lineTo(x, y);
    pen.stroke();
    label.textContent = plotText(command, points);
    canvas.setAttribute("aria-label", label.textContent);
  };
}
