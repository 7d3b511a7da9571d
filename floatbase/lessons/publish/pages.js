"use strict";
// The 3-D pictures of a page. Each lives in a frame while it is near the window, so few are drawn at a time: browsers allow
// about 16. What is left of one that has gone is a still of its first moment, which is also what is printed.

const MOST = 3;
const places = [...document.querySelectorAll("figure.scene")];
const alive = new Map(); // place -> frame
let unpacked = null;

async function unpack(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

async function contents() {
  if (!window.DecompressionStream) throw new Error("The 3-D pictures of this page are packed in a way that this browser is too " +
    "old to open. Open it in a current one: Chrome or Edge from 80, Firefox from 113, Safari from 16.4.");
  const text = async (id) => new TextDecoder().decode(await unpack(id));
  const [code, inner, commands] = await Promise.all([text("viewer-code"), text("inner-page"), unpack("commands")]);
  return {code, inner, commands: parts(commands)};
}

// A frame of commands in its parts, each with its length before it.
function parts(frame) {
  const view = new DataView(frame), found = [];
  for (let at = 0; at < frame.byteLength;) {
    const end = at + 4 + view.getUint32(at, true);
    found.push(new Uint8Array(frame, at, end - at));
    at = end;
  }
  return found;
}

async function show(place) {
  if (alive.has(place)) return;
  const frame = document.createElement("iframe");
  alive.set(place, frame);
  frame.title = place.dataset.title;
  const {code, inner, commands} = await (unpacked ??= contents());
  if (alive.get(place) !== frame) return; // it went out of sight meanwhile
  const drawn = new Promise((resolve) => {
    frame.answer = (message) => {
      if (message.ready) {
        const scene = new Blob(JSON.parse(place.dataset.commands).map((number) => commands[number]));
        scene.arrayBuffer().then((data) => frame.contentWindow.postMessage({code, scene: data}, "*"));
      } else {
        if (message.picture) keepStill(place, message.picture);
        else say(place, `This 3-D picture needs a browser with WebGL (${message.failed}).`);
        resolve();
      }
    };
  });
  frame.srcdoc = inner;
  place.append(frame);
  makeRoom();
  await drawn;
}

function keepStill(place, picture) {
  const still = place.querySelector("img") || document.createElement("img");
  still.src = picture;
  still.alt = place.dataset.title;
  place.querySelector("p")?.remove();
  place.prepend(still);
}

function hide(place) {
  alive.get(place).remove();
  alive.delete(place);
}

function say(place, text) {
  if (place.querySelector("p")) place.querySelector("p").textContent = text;
}

const distance = (place) => {
  const box = place.getBoundingClientRect();
  return Math.max(box.top - innerHeight, -box.bottom, 0);
};

function makeRoom() {
  const far = [...alive.keys()].sort((a, b) => distance(b) - distance(a));
  far.slice(0, Math.max(far.length - MOST, 0)).forEach(hide);
}

window.addEventListener("message", ({source, data}) => {
  for (const frame of alive.values()) if (frame.contentWindow === source) frame.answer(data);
});

const watch = new IntersectionObserver((entries) => {
  for (const {target, isIntersecting} of entries) if (isIntersecting) show(target).catch((error) => say(target, error.message));
}, {rootMargin: "300px 0px"});

for (const place of places) {
  say(place, "The 3-D picture is being drawn.");
  watch.observe(place);
}

// Printing needs a still of every picture.
const button = document.getElementById("print");
button.hidden = false;
button.onclick = async () => {
  for (const place of places) if (!place.querySelector("img")) await show(place);
  window.print();
};
