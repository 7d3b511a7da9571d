// Push the robot by dragging it with the Shift key held: the way over the ground sets the sliders
// "push [N]" and "towards [°]", visible or hidden, where a page has them, and letting go pushes.

import {element} from "./dom.js";
import {findNode, three} from "./meshcat.js";

const FORCE = "push [N]", DIRECTION = "towards [°]";
const FULL_WAY = 0.3; // times the camera's distance: a way that gives the largest force

// The push that a way {x, z} means, y up; full: length of the largest push, of `most` N.
export function pushOf({x, z}, full, most) {
  const force = most * Math.min(1, Math.hypot(x, z) / full);
  return {force, towards: Math.atan2(0 - z, x) * 180 / Math.PI};
}

// controls: those of the panel.
export function createDrag(viewer, controls) {
  const canvas = viewer.renderer.domElement;
  let begun = null; // {at, plane, line} while the robot is dragged

  function rayTo({clientX, clientY}) {
    const {Raycaster, Vector2} = three(), ray = new Raycaster();
    const {left, top, width, height} = canvas.getBoundingClientRect();
    const at = new Vector2(2 * (clientX - left) / width - 1, 1 - 2 * (clientY - top) / height);
    ray.setFromCamera(at, viewer.camera);
    return ray;
  }
  function begin(event) {
    const robot = findNode(viewer, ["meshcat", "robot"])?.object;
    const isWanted = event.shiftKey && event.button === 0 && controls[FORCE] && controls[DIRECTION];
    const hit = isWanted && robot ? rayTo(event).intersectObject(robot, true)[0] : undefined;
    if (!hit) return;
    event.stopPropagation(); // the view does not turn
    event.preventDefault();
    const {BufferGeometry, Line, LineBasicMaterial, Plane, Vector3} = three(), at = hit.point;
    const material = new LineBasicMaterial({color: 0xd55e00, depthTest: false});
    const line = new Line(new BufferGeometry(), material);
    line.renderOrder = 1;
    viewer.scene.add(line);
    begun = {at, line, plane: new Plane(new Vector3(0, 1, 0), -at.y), push: null};
  }
  function move(event) {
    if (begun === null) return;
    event.stopPropagation();
    const {Vector3} = three(), end = rayTo(event).ray.intersectPlane(begun.plane, new Vector3());
    if (end === null) return; // above the horizon
    const full = FULL_WAY * viewer.camera.position.distanceTo(begun.at);
    begun.push = pushOf(end.clone().sub(begun.at), full, controls[FORCE].getMax());
    controls[FORCE].show(begun.push.force);
    controls[DIRECTION].show(begun.push.towards);
    const ends = [begun.at, end].map((point) => viewer.scene.worldToLocal(point.clone()));
    begun.line.geometry.setFromPoints(ends);
    viewer.set_dirty();
  }
  function finish(push) {
    if (begun === null) return;
    viewer.scene.remove(begun.line);
    viewer.set_dirty();
    begun = null;
    if (push === null) return;
    controls[DIRECTION].setValue(push.towards);
    controls[FORCE].setValue(push.force);
  }
  element("meshcat-pane").addEventListener("pointerdown", begin, {capture: true});
  addEventListener("pointermove", move, {capture: true});
  addEventListener("pointerup", () => finish(begun && begun.push), {capture: true});
  addEventListener("pointercancel", () => finish(null), {capture: true});
}
