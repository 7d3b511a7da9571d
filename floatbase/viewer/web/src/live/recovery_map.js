// A push-recovery map for the present settings: the largest push that the robot survives in each
// direction, computed by a few workers and drawn on the ground as it grows, with rings that have
// numbers. The map before it stays visible in grey. Labels say what each of them is.

import {toCode} from "../colours.js";
import {three} from "../meshcat.js";

const DIRECTIONS = 16, DURATION = 0.1, RESOLUTION = 5; // -, s, N: those of `fb.push_recovery`
const FEWEST_WORKERS = 2, MOST_WORKERS = 4;
const HEIGHT = 0.004; // m above the ground
const NOW = 0x0072b2, BEFORE = 0x777777, RING = 0xbbbbbb;
const MOST_PARTS = 3; // of the settings on a label
const MOST_RINGS = 4, CORNERS = 64; // of a circle
const LETTERS = 0.08; // height of a label, times the robot's size
const RADIUS = 0.75; // of the largest push, times the robot's size: it fits the picture

// Angles of the directions, rad, an arc for each worker, which begins each search at the result of
// its neighbour: [[direction, …], …].
export function deal(count, workers) {
  const hands = Array.from({length: workers}, () => []);
  for (let i = 0; i < count; i++) {
    hands[Math.floor(i * workers / count)].push(2 * Math.PI * i / count);
  }
  return hands;
}

// Points of a map around a centre, [x, y, z] each, m. found: {direction, push}, rad and N; scale:
// m/N. The map is closed once it is complete.
export function outline(found, centre, scale, isComplete) {
  const sorted = [...found].sort((a, b) => a.direction - b.direction);
  const points = sorted.map(({direction, push}) => [
    centre[0] + scale * push * Math.cos(direction),
    centre[1] + scale * push * Math.sin(direction), HEIGHT,
  ]);
  return isComplete ? [...points, points[0]] : points;
}

const WAYS = ["forwards", "forwards left", "left", "backwards left", "backwards", "backwards right",
  "right", "forwards right"];

// "forwards left": the direction of an angle, rad.
export const wayOf = (angle) => WAYS[Math.round(angle * 4 / Math.PI) % 8];

// The forces of the rings up to `most`, N: multiples of 1, 2 or 5 times a power of ten.
export function ringsFor(most) {
  const power = 10 ** Math.floor(Math.log10(most / MOST_RINGS));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power * MOST_RINGS >= most);
  return Array.from({length: Math.floor(most / step)}, (_, i) => (i + 1) * step);
}

// "trot, 0.30 m/s, facets 8 and 3 more": settings on a label, which must fit the picture.
export function briefly(what) {
  const parts = what.split(", "), more = parts.length - MOST_PARTS;
  return more > 0 ? `${parts.slice(0, MOST_PARTS).join(", ")} and ${more} more` : what;
}

// The extremes of a map in words. what: such as "trot, 0.30 m/s".
export function mapText(found, what, seconds) {
  if (!found.length) return `Computing the push-recovery map: ${what}.`;
  const sorted = [...found].sort((a, b) => a.push - b.push);
  const state = found.length < DIRECTIONS ? `${found.length} of ${DIRECTIONS} directions`
    : `${DIRECTIONS} directions in ${seconds.toFixed(1)} s`;
  const [weak, strong] = [sorted[0], sorted.at(-1)].map(
    ({push, direction}) => `${push} N (${wayOf(direction)})`,
  );
  const range = sorted[0].push === sorted.at(-1).push ? `${sorted[0].push} N in each direction`
    : `from ${weak} to ${strong}`;
  return `Largest push of ${DURATION} s that the robot survives (${what}): ${range}, ${state}.`;
}

// viewer: meshcat's. size: of the robot, m. say(text): writes a text into the panel. name: of the
// robot.
export function createRecoveryMap(viewer, {size, name, say}) {
  let workers = [], drawn = [];
  const maps = []; // the present one first
  function line(colour, points = []) {
    const {BufferGeometry, Line, LineBasicMaterial, Vector3} = three();
    const vectors = points.map((point) => new Vector3(...point));
    const made = new Line(new BufferGeometry().setFromPoints(vectors),
      new LineBasicMaterial({color: colour}));
    made.frustumCulled = false;
    return made;
  }
  // The inside of a map.
  function area(colour, points, centre) {
    const {DoubleSide, Mesh, MeshBasicMaterial, Shape, ShapeGeometry, Vector2} = three();
    const corners = points.map(([x, y]) => new Vector2(x - centre[0], y - centre[1]));
    const made = new Mesh(new ShapeGeometry(new Shape(corners)), new MeshBasicMaterial(
      {color: colour, transparent: true, opacity: 0.25, side: DoubleSide, depthWrite: false},
    ));
    made.position.set(centre[0], centre[1], HEIGHT);
    return made;
  }
  // Text that faces the viewer.
  function label(text, at, colour = "#222") {
    const {CanvasTexture, Sprite, SpriteMaterial} = three();
    const canvas = document.createElement("canvas"), font = "32px system-ui, sans-serif";
    let pen = canvas.getContext("2d");
    pen.font = font;
    Object.assign(canvas, {width: pen.measureText(text).width + 20, height: 48});
    pen = canvas.getContext("2d");
    pen.fillStyle = "#ffffffe0";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = colour;
    pen.font = font;
    pen.textAlign = "center";
    pen.fillText(text, canvas.width / 2, 36);
    const made = new Sprite(new SpriteMaterial(
      {map: new CanvasTexture(canvas), depthTest: false},
    ));
    made.position.set(...at);
    made.scale.set(LETTERS * size * canvas.width / canvas.height, LETTERS * size, 1);
    return made;
  }
  function remove(one) {
    viewer.scene.remove(one);
    one.material.map?.dispose();
    one.geometry.dispose();
    one.material.dispose();
  }
  // Draw all maps and their rings with one scale, which fits the largest push.
  function draw() {
    const most = Math.max(1, ...maps.flatMap(({found}) => found.map(({push}) => push)));
    const forces = ringsFor(most), scale = RADIUS * size / most, {centre} = maps[0];
    drawn.forEach(remove);
    drawn = forces.flatMap((force) => {
      const points = Array.from({length: CORNERS + 1}, (_, i) => (
        {direction: 2 * Math.PI * i / CORNERS, push: force}));
      const at = [centre[0], centre[1] + scale * force, HEIGHT + 0.03 * size];
      return [line(RING, outline(points, centre, scale, false)), label(`${force} N`, at)];
    });
    maps.forEach(({found, what}, i) => {
      const colour = i ? BEFORE : NOW, points = outline(found, centre, scale,
        found.length === DIRECTIONS), away = centre[1] + (1.15 + 0.45 * i) * RADIUS * size;
      if (found.length > 2) drawn.push(line(colour, points), area(colour, points, centre));
      drawn.push(label(`largest push survived: ${briefly(what)}`, [centre[0], away, HEIGHT],
        toCode(colour)));
    });
    for (const one of drawn) viewer.scene.add(one);
    viewer.set_dirty();
  }
  function end() {
    for (const worker of workers) worker.terminate();
    workers = [];
  }
  function fail(reason) {
    end();
    say(`The push-recovery map stopped: ${reason}. Press the button to start it again.`);
  }
  // Remove the maps.
  function clear() {
    end();
    drawn.forEach(remove);
    maps.length = drawn.length = 0;
    say("");
    viewer.set_dirty();
  }
  // settings: those of the page. what: what is special about them. centre: below the robot, [x, y].
  function start(settings, what, centre) {
    end();
    const mine = {found: [], what, centre}, begun = performance.now();
    maps.splice(1);
    if (maps[0]?.what === what) maps.shift(); // the same again
    maps.unshift(mine);
    const free = (navigator.hardwareConcurrency || 2) - 1; // one core draws
    const count = Math.max(FEWEST_WORKERS, Math.min(MOST_WORKERS, free));
    say(mapText(mine.found, what, 0));
    draw();
    workers = deal(DIRECTIONS, count).map((directions) => {
      const worker = new Worker("engine.js", {type: "module"});
      worker.onerror = () => fail("its program cannot be loaded");
      worker.onmessage = ({data}) => {
        if (data.error) return fail(data.error);
        mine.found.push(data.recovery);
        draw();
        say(mapText(mine.found, what, (performance.now() - begun) / 1000));
        if (mine.found.length === DIRECTIONS) end();
      };
      worker.postMessage({recovery: {
        name, settings, directions, duration: DURATION, resolution: RESOLUTION,
      }});
      return worker;
    });
  }
  return {start, clear};
}
