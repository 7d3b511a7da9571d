// A push-recovery map for the present settings: the largest push that the robot survives in each
// direction, computed by a few workers and drawn on the ground as it grows, with rings that have
// numbers. The map before it stays visible in grey. The legend says what each of them is.

import {three} from "../meshcat.js";

const DIRECTIONS = 16, DURATION = 0.1, RESOLUTION = 5; // -, s, N: those of `fb.push_recovery`
const FEWEST_WORKERS = 2, MOST_WORKERS = 4;
const HEIGHT = 0.004; // m above the ground
const NOW = 0x0072b2, BEFORE = 0x888888, RING = 0xaaaaaa;
const MOST_RINGS = 4, CORNERS = 64; // of a circle
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

// The forces of the rings: multiples of 1, 2 or 5 times a power of ten, the last one at least
// `most`, N.
export function ringsFor(most) {
  const power = 10 ** Math.floor(Math.log10(most / MOST_RINGS));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power * MOST_RINGS >= most);
  return Array.from({length: Math.ceil(most / step)}, (_, i) => (i + 1) * step);
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
  return `Largest push of ${DURATION} s that the robot survives (${what}): from ${weak} to ` +
    `${strong}, ${state}.`;
}

// viewer: meshcat's. size: of the robot, m. say(text): writes a text into the panel. explain(maps):
// shows [[colour, text], …] in the legend. name: of the robot.
export function createRecoveryMap(viewer, {size, name, say, explain}) {
  let workers = [], rings = [];
  const maps = []; // the present one first
  function line(colour, points = []) {
    const {BufferGeometry, Line, LineBasicMaterial, Vector3} = three();
    const vectors = points.map((point) => new Vector3(...point));
    const made = new Line(new BufferGeometry().setFromPoints(vectors),
      new LineBasicMaterial({color: colour}));
    made.frustumCulled = false;
    return made;
  }
  // A number that faces the viewer.
  function label(text, at) {
    const {CanvasTexture, Sprite, SpriteMaterial} = three();
    const canvas = Object.assign(document.createElement("canvas"), {width: 128, height: 48});
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#ffffffd0";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = "#222";
    pen.font = "32px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(text, canvas.width / 2, 36);
    const made = new Sprite(new SpriteMaterial({map: new CanvasTexture(canvas)}));
    made.position.set(...at);
    made.scale.set(0.16 * size, 0.06 * size, 1);
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
    const forces = ringsFor(most), scale = RADIUS * size / forces.at(-1), {centre} = maps[0];
    for (const one of [...rings, ...maps.map((map) => map.line)]) if (one) remove(one);
    rings = forces.flatMap((force) => {
      const points = Array.from({length: CORNERS + 1}, (_, i) => (
        {direction: 2 * Math.PI * i / CORNERS, push: force}));
      const at = [centre[0], centre[1] - scale * force, HEIGHT + 0.03 * size];
      return [line(RING, outline(points, centre, scale, false)), label(`${force} N`, at)];
    });
    maps.forEach((map, i) => {
      map.line = line(i ? BEFORE : NOW,
        outline(map.found, centre, scale, map.found.length === DIRECTIONS));
    });
    for (const one of [...rings, ...maps.map((map) => map.line)]) viewer.scene.add(one);
    viewer.set_dirty();
    explain(maps.map(({what}, i) => [i ? BEFORE : NOW, `largest push survived: ${what}`]));
  }
  function end() {
    for (const worker of workers) worker.terminate();
    workers = [];
  }
  // settings: those of the page. what: what is special about them. centre: below the robot, [x, y].
  return function start(settings, what, centre) {
    end();
    const mine = {found: [], what, centre, line: null}, begun = performance.now();
    for (const old of maps.splice(1)) if (old.line) remove(old.line);
    maps.unshift(mine);
    const free = (navigator.hardwareConcurrency || 2) - 1; // one core draws
    const count = Math.max(FEWEST_WORKERS, Math.min(MOST_WORKERS, free));
    say(mapText(mine.found, what, 0));
    draw();
    workers = deal(DIRECTIONS, count).map((directions) => {
      const worker = new Worker("engine.js", {type: "module"});
      worker.onmessage = ({data}) => {
        if (data.error) return say(data.error);
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
  };
}
