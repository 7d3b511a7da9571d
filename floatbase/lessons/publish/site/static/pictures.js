"use strict";
// The 3-D pictures of a site. Each is drawn by the viewer in a frame, which is made when the picture is about to be seen and
// returns its WebGL context while it is out of sight: browsers have about 16. What a slider shows was computed before: a stop is a
// list of what differs from the first, as numbers of keys and commands.

const floatbasePictures = (() => {
  const BASE = new URL("pictures/", document.currentScript.src), GONE = -1, NEAR = "900px 0px", SEEN = "150px 0px";
  const OLD = "The 3-D pictures of this page are packed in a way that this browser is too old to open. Open it in a current one: " +
    "Chrome or Edge from 80, Firefox from 113, Safari from 16.4.";
  const files = new Map(); // name -> {parts, take}

  // The parts of a file, loaded once for all pictures.
  function load(name) {
    if (!files.has(name)) {
      const file = {};
      file.parts = new Promise((take, fail) => {
        file.take = take;
        const script = Object.assign(document.createElement("script"), {src: new URL(`${name}.js`, BASE).href});
        script.onerror = () => fail(new Error(`The file ${name} of this picture cannot be loaded.`));
        document.head.append(script);
      });
      files.set(name, file);
    }
    return files.get(name).parts;
  }

  async function unpack(text) {
    if (!window.DecompressionStream) throw new Error(OLD);
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const frame = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
    const view = new DataView(frame), parts = []; // each with its length before it
    for (let at = 0; at < frame.byteLength;) {
      const end = at + 4 + view.getUint32(at, true);
      parts.push(new Uint8Array(frame, at, end - at));
      at = end;
    }
    return parts;
  }

  async function contents(name) {
    const [packedHead, ...own] = await load(name);
    const head = JSON.parse(new TextDecoder().decode(packedHead.subarray(4)));
    const all = [...(await Promise.all(head.shared.map(load))).flat(), ...own];
    return {...head, commands: head.at.map((number) => all[number])};
  }

  // [key, command, key, command, …] put over a scene, which is a map from number of key to number of command.
  function over(scene, changes) {
    const made = new Map(scene);
    for (let i = 0; i < changes.length; i += 2) {
      if (changes[i + 1] === GONE) made.delete(changes[i]);
      else made.set(changes[i], changes[i + 1]);
    }
    return made;
  }

  const ORDER = {set_object: 1, set_transform: 2, set_property: 3, set_animation: 5}; // others, such as the camera, between

  // What leads from one scene to another: whether an animation ends, what is deleted, which commands follow, in order.
  // An item whose colour no command can take back, or whose shape is another, is drawn anew.
  function difference(now, goal, keys) {
    const inPicture = (key) => keys[key][0].startsWith("/meshcat/");
    const moving = (scene) => [...scene].find(([key]) => keys[key][1] === "set_animation")?.[1];
    const ended = moving(now) !== undefined && moving(now) !== moving(goal);
    const gone = new Set([...now.keys()].filter((key) => inPicture(key) && !goal.has(key)).map((key) => keys[key][0]));
    const below = (path) => {
      for (const one of gone) if (path === one || path.startsWith(`${one}/`)) return true;
      return false;
    };
    const anew = new Set();
    for (const [key, command] of goal) if (keys[key][1] === "set_object" && now.get(key) !== command) anew.add(keys[key][0]);
    const changed = [...goal].filter(([key, command]) => {
      const [path, type] = keys[key];
      if (now.get(key) !== command || (inPicture(key) && below(path))) return true;
      return type === "set_property" && anew.has(path);
    });
    const order = ([key]) => ORDER[keys[key][1]] ?? 4;
    const sorted = changed.sort((a, b) => order(a) - order(b)).map(([, command]) => command);
    return {ended, gone: [...gone], commands: sorted};
  }

  // One picture in its frame. show(scene) may be called at any time; what was not drawn yet is left out.
  function startScene(place, {keys, commands}) {
    const frame = Object.assign(document.createElement("iframe"), {title: place.querySelector("img").alt});
    let ready = false, now = new Map(), goal = null, seen = true;
    const send = async () => {
      const {ended, gone, commands: numbers} = difference(now, goal, keys);
      const pieces = numbers.map((number) => commands[number]), size = pieces.reduce((sum, piece) => sum + piece.length, 0);
      const whole = new Uint8Array(size);
      pieces.reduce((at, piece) => { whole.set(piece, at); return at + piece.length; }, 0);
      now = goal;
      frame.contentWindow.postMessage({ended, gone, frame: whole.buffer}, "*", [whole.buffer]);
    };
    window.addEventListener("message", ({source, data}) => {
      if (source !== frame.contentWindow || !data.ready) return;
      [ready, now] = [true, new Map()];
      frame.contentWindow.postMessage({seen}, "*");
      if (goal) send();
    });
    frame.src = new URL("viewer.html", BASE).href;
    place.append(frame);
    return {
      show(scene) {
        goal = scene;
        if (ready) send();
      },
      sight(is) {
        seen = is;
        if (ready) frame.contentWindow.postMessage({seen}, "*");
      },
    };
  }

  // The controls of a figure, as numbers of stops. They call changed(stops).
  function startControls(figure, together, changed) {
    const all = [...figure.querySelectorAll(".floatbase-controls :is(input, select)")];
    const get = (one) => one.type === "checkbox" ? Number(one.checked) : one.type === "range" ? Number(one.value) : one.selectedIndex;
    const tell = (one) => {
      if (one.type !== "range") return;
      const text = JSON.parse(one.dataset.values)[Number(one.value)];
      one.nextElementSibling.textContent = text;
      one.setAttribute("aria-valuetext", `${text} ${one.dataset.unit}`);
    };
    for (const one of all) {
      const first = one.defaultValue;
      one.disabled = false;
      one.addEventListener(one.tagName === "SELECT" || one.type === "checkbox" ? "change" : "input", () => {
        if (!together) for (const other of all) if (other !== one) { other.value = other.defaultValue; tell(other); }
        tell(one);
        changed(all.map(get));
      });
      if (one.type === "range") { one.value = first; tell(one); } // a browser may have kept another value over a reload
    }
    return () => all.map(get);
  }

  async function start(figure) {
    const about = await contents(figure.dataset.picture);
    const first = about.first.map((changes) => over(new Map(), changes)), note = figure.querySelector(".floatbase-note");
    const scenes = [...figure.querySelectorAll(".floatbase-scene > div")].map((place) => startScene(place, about));
    const show = (stops) => {
      const [number, ...changes] = about.stops[stops.join(",")] ?? [null, ...first.map(() => [])];
      note.style.minHeight = `${note.offsetHeight}px`; // so that a shorter note does not move the sliders
      if (number !== null) note.innerHTML = about.notes[number];
      scenes.forEach((scene, i) => scene.show(over(first[i], changes[i])));
    };
    show(startControls(figure, about.together, show)());
    return scenes;
  }

  const started = new Map(); // figure -> its scenes, promised
  function watch(figure) {
    near.observe(figure);
    sight.observe(figure);
  }
  const near = new IntersectionObserver((entries) => {
    for (const {target, isIntersecting} of entries) if (isIntersecting) contents(target.dataset.picture).catch(() => {}); // told below
  }, {rootMargin: NEAR});
  const sight = new IntersectionObserver((entries) => {
    for (const {target, isIntersecting} of entries) {
      if (isIntersecting && !started.has(target)) started.set(target, start(target).catch((error) => fail(target, error)));
      started.get(target)?.then((scenes) => { for (const scene of scenes) scene.sight(isIntersecting); });
    }
  }, {rootMargin: SEEN});

  function fail(figure, error) {
    figure.append(Object.assign(document.createElement("p"), {className: "floatbase-words", textContent: error.message}));
    return [];
  }

  const begin = () => { for (const figure of document.querySelectorAll(".floatbase-picture")) watch(figure); };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
  else begin();
  return {
    take: (name, text) => files.get(name).take(unpack(text)),
    difference,
  };
})();
