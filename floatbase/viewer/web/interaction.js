// How the picture behaves among other things: it leaves the wheel and the finger to the page around it, has a way back to its
// first view, answers to keys, and shows or hides its parts.

const PARTS = {cones: ["cone"], forces: ["measured", "planned", "push", "wrench"], robot: ["robot"], ghost: ["ghost"]};
const STEP = Math.PI / 18;  // by which a key turns the view, rad
const NEARER = 0.85;  // by which a key changes the distance

function startInteraction(viewer, camera) {
  const pane = part("meshcat-pane"), canvas = viewer.renderer.domElement, framed = window.top !== window;
  leaveScrollingToThePage(pane, canvas, framed);
  const tools = part("tools"), shown = new Map(Object.keys(PARTS).map((name) => [name, true]));
  let views = {};
  const set = (name, is) => {
    const scene = viewer.scene_tree.children.meshcat?.children ?? {};
    for (const node of PARTS[name]) if (scene[node]) scene[node].object.visible = is;
  };
  const look = (name) => { if (views[name]) camera.look(views[name]); viewer.set_dirty(); };

  const home = tools.querySelector("button"), menu = tools.querySelector("div");
  home.onclick = () => look("default");
  tools.onkeydown = ({key}) => { if (key == "Escape") tools.querySelector("details").open = false; };
  for (const name of ["feet", "left", "front", "top"]) {
    const made = Object.assign(document.createElement("button"), {type: "button", textContent: name == "left" ? "side" : name});
    made.onclick = () => look(name);
    menu.append(made);
  }
  for (const name of shown.keys()) {
    const label = document.createElement("label"), box = Object.assign(document.createElement("input"), {type: "checkbox", checked: true});
    box.onchange = () => { shown.set(name, box.checked); set(name, box.checked); viewer.set_dirty(); };
    label.append(box, name);
    menu.append(label);
  }
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    for (const [name, is] of shown) if (!is) set(name, false);  // what is ticked may come and go in a recording
    render();
  };

  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.onkeydown = (event) => {
    const turn = {ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP]}[event.key];
    const nearer = {"+": NEARER, "=": NEARER, "-": 1 / NEARER}[event.key];
    if (turn) orbit(...turn, 1);
    else if (nearer) orbit(0, 0, nearer);
    else if (event.key == "h" || event.key == "Home") look("default");
    else if (event.key == " " && part("player").offsetHeight) part("player").querySelector("button").click();
    else return;
    event.preventDefault();
  };
  function orbit(aside, down, distance) {
    const {Spherical, Vector3} = MeshCat.THREE, target = viewer.controls.target;
    const at = new Spherical().setFromVector3(new Vector3().subVectors(viewer.camera.position, target));
    at.theta += aside;
    at.phi += down;
    at.radius *= distance;
    at.makeSafe();
    viewer.camera.position.setFromSpherical(at).add(target);
    viewer.set_dirty();
  }
  return {
    views: (command) => { views = command.views; },
    describe: (text) => canvas.setAttribute("aria-label", text || "3-D picture of the robot"),
  };
}

// In a page of its own the picture may have the wheel and the finger. In a frame the page around scrolls, until the reader
// clicks into the picture or presses Ctrl; Escape, or leaving the picture, gives the wheel back.
function leaveScrollingToThePage(pane, canvas, framed) {
  if (!framed) return;
  let entered = false;
  pane.style.touchAction = "pan-y";  // meshcat's controls listen there, and had set "none"
  window.addEventListener("wheel", (event) => { if (!entered && !event.ctrlKey) event.stopPropagation(); }, {capture: true});
  canvas.addEventListener("pointerdown", ({pointerType}) => { entered = pointerType == "mouse"; });
  document.documentElement.addEventListener("pointerleave", () => { entered = false; });
  window.addEventListener("keydown", ({key}) => { if (key == "Escape") entered = false; });
}

const prefersReducedMotion = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
