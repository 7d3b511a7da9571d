// meshcat's viewer, and all our changes to it. MeshCat is the only global name: its script is
// loaded before a viewer is made, in a different way in each page.

/* global MeshCat */

export const three = () => MeshCat.THREE;

const UNSEEN = 5e-5; // m

// commands that change the page and not its picture
const UNDRAWN = new Set(["set_title", "set_text", "add_plot_point", "set_control_value"]);

export const pathNames = (path) => path.split("/").filter((name) => name);

// Run meshcat's script if the page does not load it itself.
export function runMeshcat(code) {
  const script = document.createElement("script");
  script.textContent = code;
  document.body.append(script);
  detachGifWorker();
}

// Why: the script contains a worker of gif.js. If it does not run as a worker, it replaces the
// page's own `onmessage` and answers every message to the page with another one to itself.
export function detachGifWorker() {
  window.onmessage = null;
}

// meshcat's viewer in an element, with a renderer that draws there.
export function createViewer(pane, renderer) {
  const viewer = new MeshCat.Viewer(pane, true, renderer);
  // Why: meshcat takes the height of the window, but a panel may be below the picture
  const resize = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => resize(pane.clientWidth, pane.clientHeight);
  // meshcat lists all objects there; the page has a panel and a menu of its own
  viewer.gui.domElement.style.display = "none";
  return viewer;
}

// Call hook() before each picture is drawn; if it returns true, another picture follows.
// Why: meshcat announces no picture, and a camera that follows must move before it is used.
export function beforeRender(viewer, hook) {
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    const goesOn = hook();
    render();
    if (goesOn) viewer.set_dirty();
  };
}

// Execute commands with our own handlers, type -> function(command, meshcat's function), and the
// others with meshcat. after(command, made) is called after each; made: the object it has made.
// Why: meshcat ignores types that it does not know, and a theme recolours what a command makes.
export function interceptCommands(viewer, handlers, after) {
  const meshcat = viewer.handle_command.bind(viewer);
  const isUnseen = createUnseen();
  viewer.handle_command = (command) => {
    if (isUnseen(command)) return;
    (handlers[command.type] ?? meshcat)(command, meshcat);
    after(command, command.type === "set_object" ? drawnObject(viewer, command.path) : undefined);
    if (!UNDRAWN.has(command.type)) viewer.set_dirty();
  };
}

// Whether a command moves an item by so little that nobody sees it, as of a robot that stands.
export function createUnseen() {
  const placed = new Map(); // path -> matrix
  return ({type, path, matrix}) => {
    if (type === "delete" || type === "set_animation") placed.clear(); // or moved by others
    if (type !== "set_transform") return false;
    const isSame = placed.get(path)?.every((x, i) => Math.abs(x - matrix[i]) < UNSEEN) ?? false;
    if (!isSame) placed.set(path, matrix);
    return isSame;
  };
}

// The three.js object of a path; meshcat keeps it in a node below the one that has the transform.
function drawnObject(viewer, path) {
  return viewer.scene_tree.find([...pathNames(path), "<object>"]).object;
}

// The node of a path, or undefined. Why: meshcat's own `find` makes what it does not find.
export function findNode(viewer, names) {
  return names.reduce((at, name) => at?.children[name], viewer.scene_tree);
}
