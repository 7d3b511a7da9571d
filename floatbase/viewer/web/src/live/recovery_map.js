// A push-recovery map for the present settings: the largest push that the robot survives in each
// direction, computed by a few workers and drawn on the ground as it grows. The map before it stays
// visible in grey.

import {three} from "../meshcat.js";

const DIRECTIONS = 16, DURATION = 0.1, RESOLUTION = 5; // -, s, N: those of `fb.push_recovery`
const FEWEST_WORKERS = 2, MOST_WORKERS = 4;
const HEIGHT = 0.004; // m above the ground
const NOW = 0x0072b2, BEFORE = 0x888888;

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

// "45° (forwards left)": an angle between -180 and 180°, as the slider has it, and its direction.
export function directionText(angle) {
  const degrees = Math.round(angle * 180 / Math.PI), way = WAYS[Math.round(degrees / 45) % 8];
  return `${degrees > 180 ? degrees - 360 : degrees}° (${way})`;
}

export function mapText(found, seconds) {
  if (!found.length) return "Computing the push-recovery map of the standing robot.";
  const sorted = [...found].sort((a, b) => a.push - b.push), [least, most] = [sorted[0],
    sorted.at(-1)];
  const state = found.length < DIRECTIONS ? `${found.length} of ${DIRECTIONS} directions`
    : `${DIRECTIONS} directions in ${seconds.toFixed(1)} s`;
  const [weak, strong] = [least, most].map(
    ({push, direction}) => `${push} N towards ${directionText(direction)}`,
  );
  return `Largest push of ${DURATION} s that the standing robot survives: at least ${weak}, ` +
    `at most ${strong} (${state}).`;
}

// viewer: meshcat's. say(text): writes a text into the panel. name: of the robot.
export function createRecoveryMap(viewer, {scale, name, say}) {
  let workers = [], shown = null, before = null;
  function line(colour) {
    const {BufferGeometry, Line, LineBasicMaterial} = three();
    const made = new Line(new BufferGeometry(), new LineBasicMaterial({color: colour}));
    made.frustumCulled = false;
    viewer.scene.add(made);
    return made;
  }
  function remove(one) {
    if (one === null) return;
    viewer.scene.remove(one);
    one.geometry.dispose();
    one.material.dispose();
  }
  function end() {
    for (const worker of workers) worker.terminate();
    workers = [];
  }
  // settings: those of the page. centre: below the robot, [x, y].
  return function start(settings, centre) {
    end();
    remove(before);
    before = shown;
    before?.material.color.setHex(BEFORE);
    shown = line(NOW);
    const {Vector3} = three(), found = [], begun = performance.now(), mine = shown;
    const free = (navigator.hardwareConcurrency || 2) - 1; // one core draws
    const count = Math.max(FEWEST_WORKERS, Math.min(MOST_WORKERS, free));
    say(mapText(found, 0));
    workers = deal(DIRECTIONS, count).map((directions) => {
      const worker = new Worker("engine.js", {type: "module"});
      worker.onmessage = ({data}) => {
        if (data.error) return say(data.error);
        found.push(data.recovery);
        const isComplete = found.length === DIRECTIONS;
        const points = outline(found, centre, scale, isComplete);
        mine.geometry.setFromPoints(points.map((point) => new Vector3(...point)));
        viewer.set_dirty();
        say(mapText(found, (performance.now() - begun) / 1000));
        if (isComplete) end();
      };
      worker.postMessage({recovery: {
        name, settings, directions, duration: DURATION, resolution: RESOLUTION,
      }});
      return worker;
    });
  };
}
