// The 3-D pictures of the site. Each is drawn by floatbase's page in a frame, which is made when
// the picture is about to be seen and returns its WebGL context while it is out of sight: browsers
// have about 16.

import {difference, over} from "./difference.js";
import {make} from "./dom.js";
import {joinFrame, splitFrame, unpack} from "./loader.js";

const BASE = new URL("pictures/", document.currentScript.src);
const NEAR = "900px 0px", SEEN = "150px 0px"; // around the window: load, and draw

const files = new Map(); // name -> {parts, take}

// The parts of a file, loaded once for all pictures. Files are scripts that call
// `floatbasePictures.take`: a browser can load these without a server, too.
function load(name) {
  if (!files.has(name)) {
    const file = {};
    file.parts = new Promise((take, fail) => {
      file.take = take;
      const script = make("script", {src: new URL(`${name}.js`, BASE).href});
      script.onerror = () => fail(new Error(`The file ${name} of this picture cannot be loaded.`));
      document.head.append(script);
    });
    files.set(name, file);
  }
  return files.get(name).parts;
}

async function contents(name) {
  const [packedHead, ...own] = await load(name);
  const head = JSON.parse(new TextDecoder().decode(packedHead));
  const all = [...(await Promise.all(head.shared.map(load))).flat(), ...own];
  return {...head, commands: head.at.map((number) => all[number])};
}

// One picture in its frame. show(scene) may be called at any time; scenes that were not drawn yet
// are skipped.
function startScene(place, {keys, commands}) {
  const image = place.querySelector("img"), frame = make("iframe", {title: image.alt});
  let isReady = false, now = new Map(), goal = null, isSeen = true;
  const post = (message, ...more) => frame.contentWindow?.postMessage(message, "*", ...more);
  const send = () => {
    const {ended, gone, commands: numbers} = difference(now, goal, keys);
    const joined = joinFrame(numbers.map((number) => commands[number]));
    now = goal;
    post({ended, gone, frame: joined}, [joined]);
  };
  window.addEventListener("message", ({source, data}) => {
    if (source !== frame.contentWindow || !data.ready) return;
    isReady = true;
    now = new Map();
    post({seen: isSeen});
    if (goal) send();
  });
  frame.src = new URL("viewer.html", BASE).href;
  place.append(frame);
  image.alt = ""; // the frame over it says it
  return {
    show(scene) {
      goal = scene;
      if (isReady) send();
    },
    setSight(now) {
      isSeen = now;
      if (isReady) post({seen: isSeen});
    },
  };
}

// The controls of a figure, as numbers of samples. They call changed(numbers).
function startControls(figure, together, changed) {
  const all = [...figure.querySelectorAll(".floatbase-controls :is(input, select)")];
  const get = ({type, checked, value, selectedIndex}) => {
    if (type === "checkbox") return Number(checked);
    return type === "range" ? Number(value) : selectedIndex;
  };
  const tell = (one) => {
    if (one.type !== "range") return;
    const text = JSON.parse(one.dataset.values)[Number(one.value)];
    one.nextElementSibling.textContent = text;
    one.setAttribute("aria-valuetext", `${text} ${one.dataset.unit}`);
  };
  const reset = (one) => {
    if (one.type === "checkbox") one.checked = one.defaultChecked;
    else if (one.type === "range") one.value = one.defaultValue;
    else one.selectedIndex = [...one.options].findIndex(({defaultSelected}) => defaultSelected);
    tell(one);
  };
  for (const one of all) {
    one.disabled = false;
    one.addEventListener(one.type === "range" ? "input" : "change", () => {
      if (!together) all.filter((other) => other !== one).forEach(reset);
      tell(one);
      changed(all.map(get));
    });
    if (one.type === "range") reset(one); // a browser may have kept another value over a reload
  }
  return () => all.map(get);
}

async function start(figure) {
  const picture = await contents(figure.dataset.picture);
  const first = picture.first.map((changes) => over(new Map(), changes));
  const note = figure.querySelector(".floatbase-note");
  const places = [...figure.querySelectorAll(".floatbase-scene > div")];
  const scenes = places.map((place) => startScene(place, picture));
  const show = (numbers) => {
    const sample = picture.stops[numbers.join(",")];
    const [text, ...changes] = sample ?? [null, ...first.map(() => [])];
    note.style.minHeight = `${note.offsetHeight}px`; // so a shorter note does not move the sliders
    if (text !== null) note.innerHTML = picture.notes[text];
    scenes.forEach((scene, i) => scene.show(over(first[i], changes[i])));
  };
  show(startControls(figure, picture.together, show)());
  return scenes;
}

function fail(figure, error) {
  figure.append(make("p", {className: "floatbase-words", textContent: error.message}));
  return [];
}

const started = new Map(); // figure -> its scenes, promised
const near = new IntersectionObserver((entries) => {
  for (const {target, isIntersecting} of entries) {
    if (isIntersecting) contents(target.dataset.picture).catch(() => {}); // shown below
  }
}, {rootMargin: NEAR});
const sight = new IntersectionObserver((entries) => {
  for (const {target, isIntersecting} of entries) {
    if (isIntersecting && !started.has(target)) {
      started.set(target, start(target).catch((error) => fail(target, error)));
    }
    started.get(target)?.then((scenes) => {
      for (const scene of scenes) scene.setSight(isIntersecting);
    });
  }
}, {rootMargin: SEEN});

function watchFigures() {
  for (const figure of document.querySelectorAll(".floatbase-picture")) {
    const watch = () => {
      near.observe(figure);
      sight.observe(figure);
    };
    // the image of a recording is enough until its live robot replaces it
    const robot = figure.closest("floatbase-robot[waits]:defined");
    if (robot) robot.addEventListener("unavailable", watch, {once: true});
    else watch();
  }
}

globalThis.floatbasePictures = {
  take: (name, text) => files.get(name).take(unpack(text).then(splitFrame)),
};
if (document.readyState === "loading") {
  document.addEventListener("DOMContentLoaded", watchFigures);
} else watchFigures();
