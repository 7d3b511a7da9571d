// Push the robot by dragging it: the way over the ground gives a push, and letting go pushes.

import {element, make} from "./dom.js";
import {findNode, three} from "./meshcat.js";

const FULL_WAY = 0.3; // times the camera's distance: a way that gives the largest force
const CLICK = 4; // pixels: a pointer that moves less has clicked

// The push that a way {x, z} means, y up, in whole newtons; full: length of the largest push, of
// `most` N.
export function pushOf({x, z}, full, most) {
  const force = Math.round(most * Math.min(1, Math.hypot(x, z) / full));
  return {force, towards: Math.atan2(0 - z, x) * 180 / Math.PI};
}

// isWanted(): whether a pointer that goes down on the robot drags it. most(): the largest
// force, N. show(push): called while it is dragged. release(push): called when it is let go; push:
// {force, towards, at, node}, with the point that was grabbed, y up, and the meshcat node it is in.
export function createDrag(viewer, {isWanted, most, show, release}) {
  const canvas = viewer.renderer.domElement, newtons = make("output", {className: "newtons"});
  element("page").append(newtons);
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
    if (begun !== null) return event.stopPropagation(); // a second finger does nothing
    const found = event.button === 0 && isWanted() ? hit(event) : undefined;
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
      pointer: event.pointerId, from: event,
    };
  }
  function move(event) {
    if (begun === null) {
      const canGrab = event.target === canvas && event.buttons === 0 && isWanted();
      canvas.style.cursor = canGrab && hit(event) ? "grab" : "";
      return;
    }
    if (event.pointerId !== begun.pointer) return;
    event.stopPropagation();
    const {clientX: x, clientY: y} = begun.from;
    if (!begun.push && Math.hypot(event.clientX - x, event.clientY - y) < CLICK) return;
    const {Vector3} = three(), end = rayTo(event).ray.intersectPlane(begun.plane, new Vector3());
    if (end === null) return; // above the horizon
    const full = FULL_WAY * viewer.camera.position.distanceTo(begun.at);
    const {at, node} = begun;
    begun.push = {...pushOf(end.clone().sub(at), full, most()), at, node};
    show(begun.push);
    newtons.textContent = `${begun.push.force} N: let go to push`;
    placeLabel(newtons, viewer, at);
    const ends = [at, end].map((point) => viewer.scene.worldToLocal(point.clone()));
    begun.line.geometry.setFromPoints(ends);
    viewer.set_dirty();
  }
  function finish({pointerId, type}) {
    if (begun?.pointer !== pointerId) return;
    const {line, push} = begun;
    viewer.scene.remove(line);
    line.geometry.dispose();
    line.material.dispose();
    viewer.set_dirty();
    begun = null;
    newtons.textContent = "";
    release(type === "pointerup" ? push : null);
  }
  element("meshcat-pane").addEventListener("pointerdown", begin, {capture: true});
  addEventListener("pointermove", move, {capture: true});
  for (const end of ["pointerup", "pointercancel"]) addEventListener(end, finish, {capture: true});
  canvas.addEventListener("touchstart", (event) => { // a finger on the robot scrolls no page
    if (begun !== null) event.preventDefault();
  }, {passive: false});
}

// A label beside a point of the scene, inside the picture.
function placeLabel(label, {renderer, camera}, point) {
  const {clientWidth: w, clientHeight: h} = renderer.domElement;
  const at = point.clone().project(camera);
  const right = Math.min((at.x + 1) / 2 * w + 12, w - label.offsetWidth - 4);
  label.style.left = `${right}px`;
  label.style.top = `${Math.max(4, (1 - at.y) / 2 * h - 28)}px`;
}

export const FORCE = "push [N]";
const SLIDERS = [FORCE, "towards [°]", "duration [s]"];

// Dragging the robot sets the first two sliders, visible or hidden, where a page has them.
// Elsewhere it turns the view. controls: those of the panel.
export function sliderDrag(controls) {
  const sliders = () => SLIDERS.map((name) => controls[name]).filter((one) => one);
  return {
    isWanted: () => SLIDERS.slice(0, 2).every((name) => controls[name]),
    // Whether a control pushes: the button, or without one the first slider.
    isPush: (name) => name === (controls.push ? "push" : FORCE),
    most: () => sliders()[0].getMax(),
    now: () => sliders().map((one) => one.getValue()),
    show({force, towards}) {
      [force, towards].forEach((value, i) => sliders()[i].show(value));
    },
    release(push) {
      if (push === null) return;
      sliders()[1].setValue(push.towards);
      sliders()[0].release(push.force);
    },
    // Push with these values. If a button pushes, the sliders keep their own.
    push(values) {
      const kept = sliders().map((one) => one.getValue());
      sliders().slice(1).forEach((one, i) => one.setValue(values[i + 1]));
      sliders()[0].release(values[0]);
      if (controls.push) sliders().forEach((one, i) => one.setValue(kept[i]));
    },
  };
}
