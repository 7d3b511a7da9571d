// Scrolling, keyboard and view controls: the wheel and touch gestures scroll the page around the
// picture, a button returns to the initial view, and parts can be shown or hidden.

import {element, make} from "./dom.js";
import {beforeRender, three} from "./meshcat.js";

// name of a part -> nodes of the scene
const PARTS = {
  cones: ["cone"], forces: ["measured", "planned", "push", "wrench"], robot: ["robot"],
  ghost: ["ghost"],
};
const VIEWS = {feet: "feet", side: "left", front: "front", top: "top"}; // button -> name of a view
const STEP = Math.PI / 18; // by which a key turns the view, rad
const NEARER = 0.85; // by which a key changes the distance

const KEYS = new Map(Object.entries({
  ArrowLeft: {orbit: {aside: -STEP}}, ArrowRight: {orbit: {aside: STEP}},
  ArrowUp: {orbit: {down: -STEP}}, ArrowDown: {orbit: {down: STEP}},
  "+": {orbit: {distance: NEARER}}, "=": {orbit: {distance: NEARER}},
  "-": {orbit: {distance: 1 / NEARER}},
  h: {view: "default"}, Home: {view: "default"}, " ": {play: true},
}));

const KEYS_TEXT = "Arrow keys turn the view. Plus and minus change the distance. " +
  "H returns to the initial view. Space plays or pauses a recording.";

// What a key does, undefined for nothing: turn or approach {orbit}, show a {view}, or {play}.
export const actionOf = (key) => KEYS.get(key);

// Whether the wheel acts on the picture: it scrolls the page around the frame until the reader
// clicks into the picture with a mouse. Escape, or leaving the picture, returns it to the page.
export function createWheelOwner() {
  let isEntered = false;
  return {
    pointerDown({pointerType}) { isEntered = pointerType === "mouse"; },
    pointerLeave() { isEntered = false; },
    keyDown({key}) { if (key === "Escape") isEntered = false; },
    isPictures: ({ctrlKey}) => isEntered || ctrlKey,
  };
}

export function createInteraction(viewer, camera) {
  const canvas = viewer.renderer.domElement, tools = element("tools");
  if (window.top !== window) leaveScrollingToThePage(element("meshcat-pane"), canvas);
  const isShown = new Map(Object.keys(PARTS).map((name) => [name, true]));
  let views = {};
  const setVisible = (name, visible) => {
    const scene = viewer.scene_tree.children.meshcat?.children ?? {};
    for (const node of PARTS[name]) if (scene[node]) scene[node].object.visible = visible;
  };
  const look = (name) => {
    if (views[name]) camera.look(views[name]);
    viewer.set_dirty();
  };

  const menu = tools.querySelector("div");
  tools.querySelector("button").onclick = () => look("default");
  tools.onkeydown = ({key}) => {
    if (key === "Escape") tools.querySelector("details").open = false;
  };
  for (const [text, name] of Object.entries(VIEWS)) {
    menu.append(make("button", {type: "button", textContent: text, onclick: () => look(name)}));
  }
  for (const name of isShown.keys()) {
    const box = make("input", {type: "checkbox", checked: true});
    box.onchange = () => {
      isShown.set(name, box.checked);
      setVisible(name, box.checked);
      viewer.set_dirty();
    };
    menu.append(make("label", {}, box, name));
  }
  beforeRender(viewer, () => { // a hidden part may appear and disappear in a recording
    for (const [name, shown] of isShown) if (!shown) setVisible(name, false);
  });

  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application"); // so that a screen reader passes the keys on
  canvas.setAttribute("aria-roledescription", "3-D picture");
  canvas.setAttribute("aria-description", KEYS_TEXT);
  canvas.onkeydown = (event) => {
    const action = actionOf(event.key), player = element("player");
    if (action?.orbit) orbit(action.orbit);
    else if (action?.view) look(action.view);
    else if (action?.play && player.offsetHeight) player.querySelector("button").click();
    else return;
    event.preventDefault();
  };
  // aside, down: rad. distance: a factor.
  function orbit({aside = 0, down = 0, distance = 1}) {
    const {Spherical, Vector3} = three(), {target} = viewer.controls;
    const at = new Spherical().setFromVector3(
      new Vector3().subVectors(viewer.camera.position, target),
    );
    at.theta += aside;
    at.phi += down;
    at.radius *= distance;
    at.makeSafe();
    viewer.camera.position.setFromSpherical(at).add(target);
    viewer.set_dirty();
  }
  return {
    setViews: (command) => { views = command.views; },
    describe: (text) => canvas.setAttribute("aria-label", text || "3-D picture of the robot"),
  };
}

function leaveScrollingToThePage(pane, canvas) {
  const owner = createWheelOwner();
  pane.style.touchAction = "pan-y"; // meshcat's controls listen there, and had set "none"
  window.addEventListener("wheel", (event) => {
    if (!owner.isPictures(event)) event.stopPropagation();
  }, {capture: true});
  canvas.addEventListener("pointerdown", owner.pointerDown);
  document.documentElement.addEventListener("pointerleave", owner.pointerLeave);
  window.addEventListener("keydown", owner.keyDown);
}
