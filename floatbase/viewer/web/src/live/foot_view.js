// The force at one contact point from above: inside the polygon that the controller plans with, and
// what more friction would bring. Forwards is up, left is left.

import {element, make} from "../dom.js";
import {pointName} from "./words.js";

const NEAR = 40; // pixels between the pointer and a foot that it points at
const MARGIN = 1.1; // times the largest force in the picture
const SVG = "http://www.w3.org/2000/svg";

// The corners of the facets' polygon at a normal force, [x, y] in N, world frame. facets: rows.
export function polygon(facets, normal) {
  const edges = [...facets].sort((a, b) => Math.atan2(a[1], a[0]) - Math.atan2(b[1], b[0]));
  return edges.map(([a, b, c], i) => {
    const [d, e, f] = edges[(i + 1) % edges.length], determinant = a * e - b * d;
    return [(-c * e + f * b) * normal / determinant, (-a * f + d * c) * normal / determinant];
  });
}

// How far a force is inside the nearest facet, N, and which one: {distance, facet}.
export function nearestFacet(facets, [x, y, z]) {
  const distances = facets.map(([a, b, c]) => -(a * x + b * y + c * z) / Math.hypot(a, b));
  const distance = Math.min(...distances);
  return {distance, facet: distances.indexOf(distance)};
}

// What the picture means. planned: force, N. worth: see `frictionValue` in engine/what_if.js.
export function footText(facets, planned, worth, least) {
  if (planned[2] < least) return "The controller plans no force here: no edge to reach.";
  const {distance, facet} = nearestFacet(facets, planned);
  if (worth === null) {
    return `Planned: ${distance.toFixed(1)} N inside the nearest edge (facet ${facet + 1}). ` +
      "Beyond the edge, the controller expects the foot to slip. More friction here would change " +
      "nothing.";
  }
  const gain = worth.now - worth.then;
  const motion = gain > 0.005
    ? `would bring the body's acceleration ${gain.toFixed(2)} m/s² closer to what the controller ` +
      `wants. Now it is off by ${worth.now.toFixed(1)} m/s².`
    : "would hardly change the body's acceleration.";
  return `At the edge (facet ${facet + 1}). 1 N more friction here ${motion} It would lower the ` +
    `controller's cost, the sum of all missed goals, by ${Number(worth.cost.toPrecision(2))}.`;
}

// choose(name): called with the contact point that is watched, or null.
export function createFootView(viewer, robot, drawing, choose) {
  const shape = (tag, className) => {
    const made = document.createElementNS(SVG, tag);
    made.setAttribute("class", className);
    return made;
  };
  const [edge, lit, planned, measured] = [["polygon", "edge"], ["line", "lit"],
    ["line", "planned"], ["line", "measured"]].map((names) => shape(...names));
  const picture = shape("svg", "");
  picture.append(edge, lit, planned, measured);
  picture.setAttribute("role", "img");
  const title = make("b"), text = make("p"), scale = make("small");
  const close = make("button", {type: "button", textContent: "×", title: "close"});
  close.setAttribute("aria-label", "close");
  const box = make("div", {className: "foot", hidden: true}, title, close, picture, scale, text);
  element("page").append(box);
  close.onclick = () => watch(null);
  let watched = null, frame = null;
  function watch(name) {
    if (name === watched) return;
    watched = name;
    box.hidden = name === null;
    if (name !== null) title.textContent = pointName(name);
    choose(name);
  }
  function pointed({clientX, clientY, type, buttons}) {
    if (frame === null || (type === "pointermove" && buttons)) return; // none yet, or a drag
    const {clientWidth: w, clientHeight: h} = viewer.renderer.domElement;
    const away = robot.points.map((_, i) => {
      const [x, y, z] = frame.contacts.slice(3 * i, 3 * i + 3);
      const at = viewer.camera.position.clone().set(x, z, -y).project(viewer.camera);
      return Math.hypot((at.x + 1) / 2 * w - clientX, (1 - at.y) / 2 * h - clientY);
    });
    const nearest = Math.min(...away);
    if (nearest < NEAR) watch(robot.points[away.indexOf(nearest)]);
  }
  for (const kind of ["pointermove", "pointerdown"]) {
    viewer.renderer.domElement.addEventListener(kind, pointed);
  }
  const screen = ([x, y]) => [-y, -x];
  const line = (one, [x1, y1], [x2, y2]) => {
    for (const [key, value] of Object.entries({x1, y1, x2, y2})) one.setAttribute(key, value);
  };
  return {
    watch,
    draw(next) {
      frame = next;
      if (watched === null) return;
      const i = robot.points.indexOf(watched), three = (all) => [...all.slice(3 * i, 3 * i + 3)];
      const [plan, force] = [three(frame.planned), three(frame.measured)];
      const corners = polygon(frame.facets, Math.max(plan[2], drawing.leastForce));
      const largest = MARGIN * Math.max(...corners.map((at) => Math.hypot(...at)),
        Math.hypot(force[0], force[1]));
      picture.setAttribute("viewBox", `${-largest} ${-largest} ${2 * largest} ${2 * largest}`);
      edge.setAttribute("points", corners.map(screen).join(" "));
      line(planned, [0, 0], screen(plan));
      line(measured, [0, 0], screen(force));
      const worth = frame.foot?.name === watched && "now" in frame.foot ? frame.foot : null;
      const {facet} = nearestFacet(frame.facets, plan), [a, b] = frame.facets[facet];
      const ends = corners.filter(([x, y]) => ( // of the facet that is reached
        nearestFacet([frame.facets[facet]], [x, y, Math.max(plan[2], drawing.leastForce)])
          .distance < 1e-6 * largest));
      lit.style.display = worth && ends.length === 2 && (a || b) ? "" : "none";
      if (ends.length === 2) line(lit, ...ends.map(screen));
      const reach = nearestFacet(frame.facets, [0, 0, plan[2]]).distance;
      scale.textContent = `From above, forwards is up. Normal force ${plan[2].toFixed(0)} N, ` +
        `edges at ${reach.toFixed(1)} N.`;
      const said = footText(frame.facets, plan, worth, drawing.leastForce);
      if (text.textContent !== said) text.textContent = said;
      picture.setAttribute("aria-label", said);
    },
  };
}
