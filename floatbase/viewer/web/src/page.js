// floatbase's page, `floatbase.open(config)`. Its modes differ in where frames come from:
// "live" follows a window, "notebook" follows a kernel through the page around it, "file" contains
// one scene, and "frame" shows the scenes that the page around it sends.

import {element, showNotice} from "./dom.js";
import {canUnpack, unpack, unpackText} from "./loader.js";
import {CLOSED, TOO_OLD} from "./messages.js";
import {detachGifWorker, runMeshcat} from "./meshcat.js";
import {afterDrawing, startWhenSeen} from "./visibility.js";

const RETRY = 500; // ms
const MODES = {live, notebook, file, frame};

// config: {mode, backgrounds, shades}; see theme.js.
export function open(config) {
  detachGifWorker();
  MODES[config.mode](config);
}

// The live page. When the window closes, it waits for one at the same address.
function live(config) {
  if (!window.MeshCat) return comeBack(); // the window was closed while the page was loading
  element("notice").textContent =
    `${CLOSED} This page reconnects when a viewer opens at the same address.`;
  startWhenSeen(config, (scene) => {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    const receive = receiver(scene, (text) => socket.send(text));
    let isFirst = true;
    socket.onmessage = ({data}) => {
      receive(data);
      if (!isFirst) return;
      isFirst = false;
      scene.lookAsAddressed();
      scene.pushAsAddressed();
    };
    socket.onclose = () => {
      element("notice").style.display = "block";
      comeBack();
    };
  });
}

async function comeBack() {
  try {
    if ((await fetch("/", {cache: "no-store"})).ok) return location.reload();
  } catch { /* still closed */ }
  setTimeout(comeBack, RETRY);
}

// What a page that follows a window does with a frame. send(text) sends a message to the window.
function receiver(scene, send) {
  const say = (message) => send(JSON.stringify(message));
  scene.onMessage(say);
  return (frame) => {
    scene.apply(frame);
    afterDrawing(() => say({type: "done"}));
  };
}

// The page in a notebook: it says that it is ready, and receives meshcat's code and a port.
function notebook(config) {
  window.addEventListener("message", function connect({data, ports: [port], source}) {
    if (source !== parent || !port) return;
    window.removeEventListener("message", connect);
    runMeshcat(data.code);
    let receive = () => {};
    port.onmessage = ({data: message}) => {
      if (message.notice) showNotice(message.notice);
      else receive(message);
    };
    startWhenSeen(config, (scene) => {
      receive = receiver(scene, (text) => port.postMessage(text));
      window.receiveMessage = receive; // the widget calls it if it may; see widget.js
      port.postMessage("hello");
    });
  });
  parent.postMessage({ready: true}, "*");
}

// The file page: it contains meshcat's code and the scene, packed.
async function file(config) {
  if (!canUnpack()) return showNotice(TOO_OLD);
  runMeshcat(await unpackText(element("viewer-code").textContent));
  const frame = await unpack(element("scene").textContent);
  startWhenSeen(config, (scene) => show(scene, frame));
}

// The page in a frame of the site: it reports that it is ready. The page around it reports whether
// the frame is near the visible area, {seen}, and what to change in the picture, see `change`.
function frame(config) {
  let setNear = null, scene = null;
  const waiting = [];
  window.addEventListener("message", ({data, origin}) => {
    // a page of another site contains this page in a frame
    if (location.protocol !== "file:" && origin !== self.origin) return;
    if (!(data instanceof Object && ("seen" in data || "frame" in data))) return; // of another
    if ("seen" in data) setNear(data.seen);
    else if (scene === null) waiting.push(data);
    else change(scene, data);
  });
  startWhenSeen(config, (started) => {
    scene = started;
    waiting.forEach((data) => change(scene, data));
  }, (changed) => { setNear = changed; });
  parent.postMessage({ready: true}, "*");
}

// ended: whether an animation has ended. gone: paths of removed items. frame: commands.
function change(scene, {ended, gone, frame: commands}) {
  if (ended) {
    scene.handle({type: "set_animation", path: "", animations: [], options: {play: false}});
  }
  for (const path of gone) scene.handle({type: "delete", path});
  show(scene, commands);
}

function show(scene, commands) {
  scene.apply(commands);
  scene.fit();
}
