// Draws a live robot: it moves, colours, shows and hides the items of its scene.

import {cross} from "../engine/dynamics.js";
import {terms} from "../engine/settings.js";

// m: matrix of an arrow from `start` along `vector`, column by column. wide: factor of its width.
export function arrowMatrix(start, vector, {size, slenderness, arrowLength}, wide = 1) {
  const length = Math.max(Math.hypot(...vector), 1e-9), z = vector.map((x) => x / length);
  const helper = Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const x = unit(cross(helper, z)), y = cross(z, x);
  const width = Math.min(slenderness * Math.sqrt(length * arrowLength * size), 0.35 * length);
  const half = wide * width / 2;
  return [
    ...x.map((c) => c * half), 0, ...y.map((c) => c * half), 0, ...vector, 0, ...start, 1,
  ];
}
const unit = (a) => a.map((c) => c / Math.hypot(...a));
const scaled = ([x, y, z], [sx, sy, sz]) => [sx, 0, 0, 0, 0, sy, 0, 0, 0, 0, sz, 0, x, y, z, 1];

const GRID = 1; // m: steps in which the lines on the ground follow the robot

// How a force lies in the cone with friction coefficient mu, as the viewer colours it.
export function coneStatus([x, y, z], mu, least) {
  const across = Math.hypot(x, y);
  if (Math.hypot(across, z) < least) return "idle";
  return z > 0 && across <= mu * z * (1 + 0.02) ? "inside" : "outside";
}

// scene: of the page. drawing: sizes and paths, see floatbase/live/scenes.py.
export function createPainter(scene, drawing, robot) {
  const path = (item) => `/meshcat/${item}`;
  const place = (item, matrix) => scene.handle(
    {type: "set_transform", path: path(item), matrix},
  );
  const known = new Map(); // item and property -> text of its value; only changes are sent
  function set(item, property, value) {
    const key = `${item} ${property}`, text = String(value);
    if (known.get(key) === text) return;
    known.set(key, text);
    scene.handle({type: "set_property", path: path(item), property, value});
  }
  const {links, points, scale, coneHeight, patchRadius, leastForce} = drawing;
  const shown = new Set(terms.filter((term) => term.is_shown).map(({name}) => name)); // of eq. (7)

  function drawLinks({rotations: R, positions: p}) {
    for (const [joint, item] of links) {
      const r = 9 * joint, t = 3 * joint;
      place(item, [
        R[r], R[r + 3], R[r + 6], 0, R[r + 1], R[r + 4], R[r + 7], 0,
        R[r + 2], R[r + 5], R[r + 8], 0, p[t], p[t + 1], p[t + 2], 1,
      ]);
    }
  }
  function drawForce(kind, i, at, force, wide) {
    const item = `${kind}/${points[i]}`;
    const isShown = shown.has("forces") && Math.hypot(...force) > leastForce;
    set(item, "visible", isShown);
    if (!isShown) return;
    place(item, arrowMatrix(at, force.map((x) => scale * x), drawing, wide));
  }
  function drawContact(i, frame) {
    const three = (values) => [...values.slice(3 * i, 3 * i + 3)];
    const at = three(frame.contacts), {mu, actualMu, facets} = frame.settings;
    const measured = three(frame.measured), name = points[i];
    const isLifted = frame.lifted.includes(robot.points[i]);
    const ground = [at[0], at[1], 0];
    set(`patch/${name}`, "visible", !isLifted);
    place(`patch/${name}`, scaled(ground, [patchRadius, patchRadius, 0.12 * patchRadius]));
    drawForce("measured", i, at, measured, 1);
    drawForce("planned", i, at, three(frame.planned), 1.8);
    const lit = new Set(frame.active
      .filter(([kind, owner]) => kind === "friction" && owner === robot.points[i])
      .map(([, , facet]) => facet));
    const status = coneStatus(measured, actualMu, leastForce);
    const matrix = scaled(ground, [mu * coneHeight, mu * coneHeight, coneHeight]);
    for (const count of robot.facets) {
      const isShown = shown.has("cones") && count === facets && !isLifted;
      const sides = `cone/${name}/${count}/sides`;
      set(sides, "visible", isShown);
      for (let facet = 0; facet < count; facet++) {
        const item = `cone/${name}/${count}/facet ${facet}`;
        const isLit = isShown && lit.has(facet) && status !== "idle";
        set(item, "visible", isLit);
        if (isLit) place(item, matrix);
      }
      if (!isShown) continue;
      set(sides, "color", drawing.coneColours[status]);
      place(sides, matrix);
    }
  }
  // The arrow of a term of eq. (7) with its name at the tip.
  function drawTerm(term, {at, force, endsThere}) {
    const isShown = shown.has(term) && Math.hypot(...force) > leastForce;
    for (const kind of ["term", "word"]) set(`${kind}/${term}`, "visible", isShown);
    if (!isShown) return;
    const vector = force.map((x) => scale * x);
    const start = endsThere ? at.map((x, i) => x - vector[i]) : at;
    place(`term/${term}`, arrowMatrix(start, vector, drawing));
    const [x, y, z] = at.map((c, i) => c + (endsThere ? 0 : vector[i]));
    place(`word/${term}`, scaled([x, y + 0.2 * drawing.size, z + 0.2 * drawing.size], [1, 1, 1]));
  }
  let middle = [0, 0];
  function drawGround([x, y]) {
    const next = [x, y].map((c) => GRID * Math.round(c / GRID));
    if (next.join() === middle.join()) return;
    middle = next;
    place("ground", scaled([...middle, 0], [1, 1, 1]));
  }
  function drawCom([x, y, z]) {
    const r = drawing.comRadius;
    place("com/ball", scaled([x, y, z], [r, r, r]));
    place("com/line", scaled([x, y, 0], [0.1 * r, 0.1 * r, Math.max(z, 1e-4)]));
    place("com/projection", scaled([x, y, 0], [0.8 * r, 0.8 * r, 0.12 * r]));
  }
  return {
    // Draw a term of eq. (7), or not, from the next picture on.
    show(term, isShown) { shown[isShown ? "add" : "delete"](term); },
    draw(frame) {
      drawLinks(frame);
      points.forEach((_, i) => drawContact(i, frame));
      drawCom(frame.com);
      drawGround(frame.com);
      for (const [term, force] of Object.entries(frame.terms)) drawTerm(term, force);
    },
    // The push of `force`, N, as an arrow that begins where it acts, or none.
    drawPush(at, force) {
      set("push/arrow", "visible", force !== null);
      if (force === null) return;
      const vector = force.map((x) => scale * x);
      place("push/arrow", arrowMatrix(at, vector, drawing));
    },
  };
}
