"use strict";
// floatbase's page around meshcat's viewer: our own commands, the player, and messages of several commands.

const part = (id) => document.getElementById(id);
const names = (path) => path.split("/").filter((name) => name);

function startViewer() {
  const viewer = new MeshCat.Viewer(part("meshcat-pane"));
  viewer.gui.domElement.style.display = "none";  // meshcat's own list of all objects
  const player = startPlayer(viewer);
  const panel = startPanel(viewer);
  const camera = startCamera(viewer, panel);
  const legend = startLegend(camera, (colour) => theme.colour(colour)), theme = startTheme(viewer, legend);
  const interaction = startInteraction(viewer, camera);
  new ResizeObserver(([{target}]) => {
    part("board").style.top = `${target.offsetTop + target.offsetHeight + 6}px`;
  }).observe(part("title"));
  const commands = {
    set_camera: camera.look,
    set_follow: camera.follow,
    set_ground: camera.ground,
    set_views: interaction.views,
    set_title: (command) => {
      part("title").textContent = command.text;
      interaction.describe(command.text);
    },
    set_legend: (command) => { legend.show(command.items); },
    set_theme: theme.ask,
    set_disconnect_message: (command) => { part("notice").textContent = command.text; },
    set_animation: (command) => { meshcat(command); player.load(command); },
    set_control: panel.add,
    set_control_value: panel.move,
    set_text: panel.text,
    add_plot_point: panel.plot,
  };
  const meshcat = viewer.handle_command.bind(viewer);
  viewer.handle_command = (command) => {
    (commands[command.type] || meshcat)(command);
    const made = command.type == "set_object" && viewer.scene_tree.find([...names(command.path), "<object>"]).object;
    if (made) camera.letters(made);
    theme.after(command, made);
    viewer.set_dirty();
  };
  return viewer;
}

// Show a text in the middle of the page, where there is no picture.
function say(words) {
  part("notice").textContent = words;
  part("notice").style.display = "block";
}

const NO_WEBGL = "This 3-D picture needs WebGL, which this browser does not have or has switched off. Switch on hardware " +
  "acceleration in the browser's settings and restart it, or open the page in another browser.";
const NO_UNPACKING = "This page is packed in a way that this browser is too old to open. Open it in a current one: Chrome or " +
  "Edge from 80, Firefox from 113, Safari from 16.4.";

// The viewer; where the browser cannot draw, null and a text in the page.
function viewerOrText() {
  try {
    return startViewer();
  } catch (error) {
    if (!String(error).includes("WebGL")) throw error;
    say(NO_WEBGL);
    return null;
  }
}

// The legend, at the lower left. Where it would cover what the camera looks at, it is folded into a button: pointing at it
// or reaching it by the keyboard opens it, a click keeps it open, Escape closes it.
// shade: the colour that a colour has in the present theme.
function startLegend(camera, shade) {
  const legend = part("legend"), lines = part("lines"), button = legend.querySelector("button");
  let kept = false, shown = [];
  const open = (now) => {
    legend.classList.toggle("open", now);
    button.setAttribute("aria-expanded", now);
  };
  function fold() {
    legend.classList.remove("folded");  // to measure it as it stands open
    const {right, top} = lines.getBoundingClientRect(), player = part("player").getBoundingClientRect();
    const middle = {x: innerWidth / 2 - camera.aside(), y: innerHeight / 2};
    const away = Math.hypot(Math.max(middle.x - right, 0), Math.max(top - middle.y, 0));
    const crowded = away < middle.y  // the camera fits what it looks at into a ball as high as the picture
      || top < part("title").getBoundingClientRect().bottom || (player.width > 0 && right > player.left);
    legend.classList.toggle("folded", crowded && lines.childElementCount > 0);
    legend.classList.toggle("raised", player.width > 0 && button.getBoundingClientRect().right > player.left);
  }
  const keep = (now) => { open(kept = now); };
  legend.onpointerenter = ({pointerType}) => { if (pointerType == "mouse") open(true); };
  legend.onpointerleave = () => open(kept);
  legend.onkeydown = ({key}) => { if (key == "Escape") keep(false); };
  button.onfocus = () => open(true);
  button.onblur = () => open(kept);
  button.onclick = () => keep(!kept);
  const sizes = new ResizeObserver(fold);
  for (const one of [part("meshcat-pane"), part("player"), part("panel")]) sizes.observe(one);
  function show(items) {
    shown = items;
    const seen = items.map(([colour, ...rest]) => [shade(colour), ...rest]);
    lines.replaceChildren(...seen.map(([colour, text, symbol]) => {
      const line = document.createElement("div");
      line.append(spot(colour, symbol), text);
      return line;
    }));
    button.firstChild.replaceChildren(...Array.from(new Set(seen.map(([colour]) => colour)), (colour) => spot(colour)));
    fold();
  }
  return {show, again: () => show(shown)};
}

// A patch of a colour, or one of the style's symbols in it: a disc, a ring, a diamond, a line, a cone, a tile, a curl.
function spot(colour, symbol = "patch") {
  const made = document.createElement("i");
  made.className = symbol;
  made.style.color = colour;
  return made;
}

const LAG = 0.3;  // s by which the camera is behind what it follows, so that it does not shake with every step
const SLOWEST = 1000;  // ms between pictures that count: a browser that draws few must not fall behind
const WIDE = 1.2;  // width over height of a picture into which the robot fits; a narrower one shows it smaller
const LEAST = 0.2;  // zoom, in the smallest window
const LARGER = 1.5;  // times: labels of a picture that is zoomed out are drawn so much larger, at most
const REST = 1e-3;  // m: closer than this it is there

// The camera. meshcat's camera node cannot move the point that the mouse turns around.
function startCamera(viewer, panel) {
  const {Vector3} = MeshCat.THREE;
  // how far the camera has gone with what it follows, and how far that was from its place at home when the camera was set
  const gone = new Vector3(), begin = new Vector3();
  let path = [], from = new Vector3(), planes = [{normal: [0, 1, 0], offset: 0}], smooth = false, anew = true, clock = 0;
  // searched each time, because another picture has another object there, or none
  const node = (names) => names.reduce((at, name) => at && at.children[name], viewer.scene_tree);
  // while the panel is open, the middle of the picture is left of it by so many pixels
  const aside = () => panel.width() / 2;
  // and above it where the player would hide the feet; between the panel below and the terms of an equation
  const above = () => (part("player").offsetHeight + panel.height() - (panel.height() && part("board").offsetHeight)) / 2;

  // m: of the ground, below or above a place
  const height = ({x, z}) =>
    Math.max(...planes.map(({normal, offset}) => (offset - normal[0] * x - normal[2] * z) / normal[1]));

  // Go with what is followed, at one height over the ground; scale and lights go along. Returns whether it is still on its way.
  function go() {
    const now = performance.now(), part = smooth && !anew ? 1 - Math.exp(-Math.min(now - clock, SLOWEST) / 1000 / LAG) : 1;
    clock = now;
    const found = node(path);
    if (!found) return false;
    const at = found.object.getWorldPosition(new Vector3());
    const way = at.clone().sub(from).setY(height(at) - height(from)).sub(gone);
    const step = way.clone().multiplyScalar(way.length() < REST ? 1 : part);
    gone.add(step);
    viewer.camera.position.add(step);
    viewer.controls.target.add(step);
    for (const one of [["meshcat", "scale"], ["Lights", "PointLightNegativeX"], ["Lights", "PointLightPositiveX"]]) {
      node(one)?.object.position.set(begin.x + gone.x, -begin.z - gone.z, begin.y + gone.y);  // in our coordinates, z up
    }
    anew = false;
    return way.sub(step).length() > 0;
  }
  // Labels keep their size where the window is small.
  function letters(object) {
    object.traverse((one) => {
      if (!one.isSprite) return;
      one.userData.own ??= one.scale.clone();
      one.scale.copy(one.userData.own).multiplyScalar(Math.min(1 / viewer.camera.zoom, LARGER));
    });
  }
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    const moving = path.length > 0 && go();
    const {clientWidth: w, clientHeight: h} = viewer.renderer.domElement;
    const high = h - panel.height();  // of what is left of the picture
    const zoom = Math.max(LEAST, Math.min(1, (w - 2 * aside()) / h / WIDE, high / h));
    if (zoom != viewer.camera.zoom) {
      viewer.camera.zoom = zoom;
      viewer.camera.updateProjectionMatrix();
      letters(viewer.scene);
    }
    if (aside() || above()) viewer.camera.setViewOffset(w, h, aside(), above(), w, h);
    else viewer.camera.clearViewOffset();
    render();
    if (moving) viewer.set_dirty();
  };
  return {
    aside,
    letters,
    look(command) {
      viewer.camera.fov = command.fov;
      viewer.camera.position.fromArray(command.position);
      viewer.controls.target.fromArray(command.target);
      gone.set(0, 0, 0);
      anew = true;
    },
    ground(command) { planes = command.planes; },
    follow(command) {
      path = names(command.node);
      from.fromArray(command.from);
      begin.fromArray(command.begin);
      smooth = command.smooth;
    },
  };
}

// Play, pause, seek and slow motion for an animation.
function startPlayer(viewer) {
  const bar = part("player"), button = bar.querySelector("button"), slider = bar.querySelector("input");
  const clock = bar.querySelector("output"), speed = bar.querySelector("select");
  const animator = () => viewer.animator;
  let ticking = false;
  function tick() {
    ticking = bar.style.display != "none";
    if (!ticking) return;
    slider.value = animator().time;
    clock.textContent = `${animator().time.toFixed(2)} s`;
    button.textContent = animator().playing ? "❚❚" : "▶";
    requestAnimationFrame(tick);
  }
  button.onclick = () => animator().playing ? animator().pause() : animator().play();
  slider.oninput = () => {
    animator().pause();
    animator().seek(Number(slider.value));
    animator().display_progress(Number(slider.value));
  };
  speed.onchange = () => { animator().mixer.timeScale = Number(speed.value); };
  return {
    load(command) {
      bar.style.display = command.animations.length ? "flex" : "none";
      if (!command.animations.length) return;
      slider.max = animator().duration;
      const requested = String(command.options.speed);
      if (![...speed.options].some((option) => option.value == requested)) speed.add(new Option(`${requested}×`, requested));
      speed.value = requested;
      animator().mixer.timeScale = command.options.speed;
      if (command.options.paused || prefersReducedMotion()) {
        animator().pause();
        animator().seek(0);  // the first picture: before this, items that come later are seen, too
      }
      if (!ticking) tick();
    },
  };
}

// A frame is several commands that are drawn together, each after its length. One that fails is reported; the others go on.
function apply(frame) {
  const view = new DataView(frame);
  for (let at = 0; at < frame.byteLength;) {
    const length = view.getUint32(at, true);
    try {
      viewer.handle_command_bytearray(new Uint8Array(frame, at + 4, length));
    } catch (error) {
      console.error("floatbase: a drawing command failed", error);
    }
    at += 4 + length;
  }
}

// A browser has 16 WebGL contexts for all its pages. So a page in a frame starts when it is first seen. While it is out of
// sight it returns its context and shows a still image. changed(seen) is called whenever that changes.
function onSight(changed) {
  if (window.top === window) return changed(true);
  new IntersectionObserver((entries) => changed(entries.at(-1).isIntersecting)).observe(document.documentElement);
}

const REST_AFTER = 1000;  // ms out of sight

function startRest(viewer) {
  const canvas = viewer.renderer.domElement, pane = part("meshcat-pane");
  let seen = true, resting = false, timer = 0;
  const later = () => {
    clearTimeout(timer);
    if (!seen) timer = setTimeout(rest, REST_AFTER);
  };
  function rest() {
    pane.style.backgroundImage = `url(${viewer.capture_image()})`;
    canvas.style.visibility = "hidden";
    resting = true;
    viewer.renderer.forceContextLoss();
  }
  function wake() {
    if (resting) setTimeout(() => viewer.renderer.forceContextRestore());
    resting = false;
  }
  canvas.addEventListener("webglcontextrestored", () => {
    viewer.render();
    canvas.style.visibility = "";
    pane.style.backgroundImage = "";
  });
  viewer.resting = () => resting;
  return {
    sight(now) {
      seen = now;
      if (seen) wake();
      later();
    },
  };
}

// Call start() once, when the page is first seen, and manage its context from then on. sight: what tells of it, as `onSight`.
function startWhenSeen(start, sight = onSight) {
  let rest = null, blind = false;
  sight((seen) => {
    if (rest === null && seen && !blind) {
      window.viewer = viewerOrText();
      blind = viewer === null;
      if (blind) return;
      rest = startRest(viewer);
      start();
    }
    if (rest !== null) rest.sight(seen);
  });
}

const UNSEEN = 500;  // ms; a picture that nobody scrolls to is not drawn at all

// Call once the next picture is drawn, or after half a second: what the window or the notebook does then must not delay it.
function afterDrawing(call) {
  if (document.hidden) return call();
  let late = 0, next = 0;
  const go = () => {
    clearTimeout(late);
    cancelAnimationFrame(next);
    call();
  };
  late = setTimeout(go, UNSEEN);
  next = requestAnimationFrame(go);  // after the viewer's own, which it has asked for before
}

// What a page that follows a window does with a message of the window's. connection: its send says something to the window.
function listener(connection) {
  viewer.connection = connection;
  return (message) => {
    apply(message);
    viewer.num_messages_received++;
    afterDrawing(() => connection.send('{"type": "done"}'));
  };
}

// The live page: follow a window. When the window closes, wait for one at the same address.
function follow() {
  const socket = new WebSocket(`${location.protocol == "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  const hear = listener(socket);
  socket.onmessage = ({data}) => hear(data);
  socket.onclose = () => {
    part("notice").style.display = "block";
    comeBack();
  };
}

// The page in a notebook: it says that it is ready, receives {code} and a port, and follows the window by the port.
function waitForPort() {
  window.onmessage = ({data, ports: [port], source}) => {
    if (source !== parent || !port) return;
    window.onmessage = null;  // the viewer takes it
    load(data.code);
    let hear = () => {};
    port.onmessage = ({data: message}) => message.notice ? say(message.notice) : hear(message);
    startWhenSeen(() => {
      window.hear = hear = listener({send: (words) => port.postMessage(words)});
      port.postMessage("hello");
    });
  };
  parent.postMessage({ready: true}, "*");
}

async function comeBack() {
  try {
    if ((await fetch("/", {cache: "no-store"})).ok) return location.reload();
  } catch (error) { /* still closed */ }
  setTimeout(comeBack, 500);
}

// The file: it contains meshcat's viewer and the scene, packed.
async function unpack(id) {
  const packed = Uint8Array.from(atob(part(id).textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

async function open() {
  if (!window.DecompressionStream) return say(NO_UNPACKING);
  load(new TextDecoder().decode(await unpack("viewer-code")));
  const scene = await unpack("scene");
  startWhenSeen(() => draw(scene));
}

function load(code) {
  const script = document.createElement("script");
  script.textContent = code;
  document.body.appendChild(script);
}

function draw(scene) {
  apply(scene);
  viewer.num_messages_received++;
  viewer.set_3d_pane_size();
}

// The inner page: it says that it is ready. The page around it says whether it is near the window, {seen}, and what is to
// change in the picture, see `change`.
function waitForScenes() {
  let near = null, waiting = [];
  window.onmessage = ({data, origin}) => {
    if (location.protocol != "file:" && origin !== self.origin) return;  // somebody else's page has this one in a frame
    if ("seen" in data) near(data.seen);
    else if (waiting) waiting.push(data);
    else change(data);
  };
  startWhenSeen(() => {
    waiting.forEach(change);
    waiting = null;
  }, (changed) => { near = changed; });
  parent.postMessage({ready: true}, "*");
}

// ended: whether an animation is over. gone: paths of what is no more. frame: commands.
function change({ended, gone, frame}) {
  if (ended) viewer.handle_command({type: "set_animation", path: "", animations: [], options: {play: false}});
  for (const path of gone) viewer.handle_command({type: "delete", path});
  draw(frame);
}
