// The camera: it follows a node above the ground and fits the picture into the free part of the
// window. meshcat's own camera node cannot move the point around which the mouse turns.

import {element} from "./dom.js";
import {beforeRender, findNode, pathNames, three} from "./meshcat.js";

const LAG = 0.3; // s, delay behind what it follows, so that it does not shake with each step
const SLOWEST = 1000; // ms, longest time between pictures that counts: at low rates it must keep up
const WIDE = 1.3; // width / height of a picture that fits a robot; a narrower picture is zoomed out
const TITLE = 40; // pixels of its first line
const MIN_ZOOM = 0.2; // in the smallest window
const MAX_LABEL_SCALE = 1.5; // how much larger labels become when the picture is zoomed out
const LOW_JUMP = 0.2; // m: the camera stays down if the robot rises by less, however low it stands
const GRID = 0.5; // m, between the points where the ground of a camera is measured
const REST = 1e-3; // m: closer than this, it has arrived
const COMPANIONS = [
  ["meshcat", "scale"], ["Lights", "PointLightNegativeX"], ["Lights", "PointLightPositiveX"],
]; // nodes that move with it

// m: height of the ground under or over a point {x, z}, y up. planes: normal and offset, n·p = d;
// boxes: x0, x1, y0, y1 and top in our coordinates, in which y is -z.
export function groundHeight({planes, boxes}, {x, z}) {
  const tops = boxes.filter(([x0, x1, y0, y1]) => x0 <= x && x <= x1 && y0 <= -z && -z <= y1);
  return Math.max(
    ...planes.map(({normal, offset}) => (offset - normal[0] * x - normal[2] * z) / normal[1]),
    ...tops.map((box) => box[4]),
  );
}

// m: height of the ground, interpolated between the points of a grid where there are boxes, so that
// the camera does not jump at a step.
export function smoothHeight(ground, {x, z}) {
  if (!ground.boxes.length) return groundHeight(ground, {x, z});
  const [i, j] = [x, z].map((at) => Math.floor(at / GRID));
  let height = 0;
  for (const [a, b] of [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]]) {
    const weight = (1 - Math.abs(x / GRID - a)) * (1 - Math.abs(z / GRID - b));
    height += weight * groundHeight(ground, {x: a * GRID, z: b * GRID});
  }
  return height;
}

// m: how far the camera rises with an object that was at `before` above the ground and is at `now`.
// It ignores steps and jumps up to twice the first height, and then catches up.
export function liftOf(before, now) {
  const rise = now - before, ignored = Math.max(before, LOW_JUMP);
  return Math.max(0, Math.min(rise, 2 * (rise - ignored)));
}

// The fraction of the remaining distance that the camera moves in `elapsed` ms.
export function followFraction(elapsed) {
  return 1 - Math.exp(-Math.min(elapsed, SLOWEST) / 1000 / LAG);
}

// The zoom of a picture of width × height pixels, of which the uppermost `hidden` ones are covered.
export const zoomFor = (width, height, hidden = 0) =>
  Math.max(MIN_ZOOM, Math.min(1 - hidden / Math.max(1, height), width / height / WIDE));

export const labelScale = (zoom) => Math.min(1 / zoom, MAX_LABEL_SCALE);

export function createCamera(viewer) {
  const {Vector3} = three();
  // how far the camera has moved with what it follows; initial position of the scale and the lights
  const gone = new Vector3(), begin = new Vector3(), from = new Vector3();
  let path = [], ground = {planes: [{normal: [0, 1, 0], offset: 0}], boxes: []}, clock = 0;
  let isSmooth = false, isFirst = true;
  // pixels at the top of a picture of this width in which the terms of an equation would hide the
  // head of a robot
  const hiddenOf = (width) => {
    const {offsetLeft, offsetWidth, offsetHeight} = element("board");
    return offsetHeight && offsetLeft + offsetWidth > width / 2 ? TITLE + offsetHeight : 0;
  };

  // Follow at a constant height above the ground, and rise with an object that flies away. Returns
  // whether the camera is still moving.
  function follow() {
    const now = performance.now();
    const fraction = isSmooth && !isFirst ? followFraction(now - clock) : 1;
    clock = now;
    // searched each time, because another picture may have another object there, or none
    const found = findNode(viewer, path);
    if (!found) return false;
    const at = found.object.getWorldPosition(new Vector3());
    const [below, first] = [at, from].map((place) => smoothHeight(ground, place));
    const rise = below - first + liftOf(from.y - first, at.y - below);
    const way = at.clone().sub(from).setY(rise).sub(gone);
    const step = way.clone().multiplyScalar(way.length() < REST ? 1 : fraction);
    gone.add(step);
    viewer.camera.position.add(step);
    viewer.controls.target.add(step);
    for (const names of COMPANIONS) { // in our coordinates, z up
      const {x, y, z} = begin.clone().add(gone);
      findNode(viewer, names)?.object.position.set(x, -z, y);
    }
    isFirst = false;
    return way.sub(step).length() > 0;
  }
  // Labels keep their size where the window is small.
  function scaleLabels(object) {
    object.traverse((one) => {
      if (!one.isSprite) return;
      one.userData.own ??= one.scale.clone();
      one.scale.copy(one.userData.own).multiplyScalar(labelScale(viewer.camera.zoom));
    });
  }
  beforeRender(viewer, () => {
    const isMoving = path.length > 0 && follow();
    const {clientWidth: w, clientHeight: h} = viewer.renderer.domElement;
    // the player would hide the feet
    const hidden = hiddenOf(w), above = (element("player").offsetHeight - hidden) / 2;
    const zoom = zoomFor(w, h, hidden);
    if (zoom !== viewer.camera.zoom) {
      viewer.camera.zoom = zoom;
      viewer.camera.updateProjectionMatrix();
      scaleLabels(viewer.scene);
    }
    if (above) viewer.camera.setViewOffset(w, h, 0, above, w, h);
    else viewer.camera.clearViewOffset();
    return isMoving;
  });
  return {
    scaleLabels,
    look({fov, position, target}) {
      viewer.camera.fov = fov;
      viewer.camera.position.fromArray(position);
      viewer.controls.target.fromArray(target);
      gone.set(0, 0, 0);
      isFirst = true;
    },
    // where it is and what it looks at, before it followed anything: six numbers
    view: () => [viewer.camera.position, viewer.controls.target]
      .flatMap((at) => at.clone().sub(gone).toArray()),
    setGround({planes, boxes}) { ground = {planes, boxes}; },
    setFollow(command) {
      path = pathNames(command.node);
      from.fromArray(command.from);
      begin.fromArray(command.begin);
      isSmooth = command.smooth;
    },
  };
}
