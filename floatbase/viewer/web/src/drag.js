// Push the robot by dragging it: the way over the ground gives a push, and letting go pushes.

import {element} from "./dom.js";
import {findNode, three} from "./meshcat.js";

const FULL_WAY = 0.3; // times the camera's distance: a way that gives the largest force

// The push that a way {x, z} means, y up; full: length of the largest push, of `most` N.
export function pushOf({x, z}, full, most) {
  const force = most * Math.min(1, Math.hypot(x, z) / full);
  return {force, towards: Math.atan2(0 - z, x) * 180 / Math.PI};
}

// isWanted(event): whether a pointer that goes down on the robot drags it. most(): the largest
// force, N. show(push): called while it is dragged. release(push): called when it is let go; push:
// {force, towards, at, node}, with the point that was grabbed, y up, and the meshcat node it is in.
export function createDrag(viewer, {isWanted, most, show, release}) {
  const canvas = viewer.renderer.domElement;
  let begun = null; // {at, plane, line, node, push} while the robot is dragged

  function rayTo({clientX, clientY}) {
    const {Raycaster, Vector2} = three(), ray = new Raycaster();
    const {left, top, width, height} = canvas.getBoundingClientRect();
    const at = new Vector2(2 * (clientX - left) / width - 1, 1 - 2 * (clientY - top) / height);
    ray.setFromCamera(at, viewer.camera);
    return ray;
  }
  function hit(event) {
    const robot = findNode(viewer, ["meshcat", "robot"])?.object;
    return robot ? rayTo(event).intersectObject(robot, true)[0] : undefined;
  }
  function begin(event) {
    const found = isWanted(event) ? hit(event) : undefined;
    if (!found) return;
    event.stopPropagation(); // the view does not turn
    event.preventDefault();
    const {BufferGeometry, Line, LineBasicMaterial, Plane, Vector3} = three(), at = found.point;
    const material = new LineBasicMaterial({color: 0xd55e00, depthTest: false});
    const line = new Line(new BufferGeometry(), material);
    line.renderOrder = 1;
    viewer.scene.add(line);
    begun = {
      at, line, plane: new Plane(new Vector3(0, 1, 0), -at.y), push: null, node: found.object,
      pointer: event.pointerId,
    };
  }
  function move(event) {
    if (begun === null || event.pointerId !== begun.pointer) return;
    event.stopPropagation();
    const {Vector3} = three(), end = rayTo(event).ray.intersectPlane(begun.plane, new Vector3());
    if (end === null) return; // above the horizon
    const full = FULL_WAY * viewer.camera.position.distanceTo(begun.at);
    const {at, node} = begun;
    begun.push = {...pushOf(end.clone().sub(at), full, most()), at, node};
    show(begun.push);
    const ends = [at, end].map((point) => viewer.scene.worldToLocal(point.clone()));
    begun.line.geometry.setFromPoints(ends);
    viewer.set_dirty();
  }
  function finish(push) {
    if (begun === null) return;
    viewer.scene.remove(begun.line);
    viewer.set_dirty();
    begun = null;
    release(push);
  }
  element("meshcat-pane").addEventListener("pointerdown", begin, {capture: true});
  addEventListener("pointermove", move, {capture: true});
  addEventListener("pointerup", () => finish(begun && begun.push), {capture: true});
  addEventListener("pointercancel", () => finish(null), {capture: true});
  return {hit};
}

const FORCE = "push [N]", DIRECTION = "towards [°]";

// With the Shift key held, dragging sets the sliders "push [N]" and "towards [°]", visible or
// hidden, where a page has them. controls: those of the panel.
export const sliderDrag = (controls) => ({
  isWanted: ({shiftKey, button}) =>
    shiftKey && button === 0 && Boolean(controls[FORCE] && controls[DIRECTION]),
  most: () => controls[FORCE].getMax(),
  show({force, towards}) {
    controls[FORCE].show(force);
    controls[DIRECTION].show(towards);
  },
  release(push) {
    if (push === null) return;
    controls[DIRECTION].setValue(push.towards);
    controls[FORCE].setValue(push.force);
  },
});
