// When a page draws. A browser has 16 WebGL contexts for all its pages, so a page in a frame starts
// when it is first visible. While it is out of sight, it releases its context and shows an image.

import {element, showNotice} from "./dom.js";
import {NO_WEBGL} from "./messages.js";
import {createScene} from "./scene.js";

const REST_AFTER = 1000; // ms out of sight
const UNSEEN = 500; // ms; a picture that is never scrolled to is not drawn at all

// changed(isSeen) is called initially and whenever the page enters or leaves the visible area.
export function watchSight(changed) {
  if (window.top === window) return changed(true);
  const observer = new IntersectionObserver((entries) => changed(entries.at(-1).isIntersecting));
  observer.observe(document.documentElement);
}

// Call start(scene) once, when the page is first visible, and manage its context from then on.
// watch: function that reports whether the page is visible, as `watchSight` does.
export function startWhenSeen(config, start, watch = watchSight) {
  let rest = null, isBlind = false;
  watch((isSeen) => {
    if (rest === null && isSeen && !isBlind) {
      const scene = sceneOrNotice(config);
      isBlind = scene === null;
      if (isBlind) return;
      window.viewer = scene.viewer; // for programs that control the page, such as for a film
      rest = createRest(scene);
      start(scene);
    }
    rest?.setSight(isSeen);
  });
}

// The scene; if the browser cannot draw, null and a message in the page.
function sceneOrNotice(config) {
  try {
    return createScene(config);
  } catch (error) {
    if (!String(error).includes("WebGL")) throw error;
    showNotice(NO_WEBGL);
    return null;
  }
}

function createRest({viewer, capture}) {
  const canvas = viewer.renderer.domElement, pane = element("meshcat-pane");
  let isSeen = true, isResting = false, timer = 0;
  const restLater = () => {
    clearTimeout(timer);
    if (!isSeen) timer = setTimeout(rest, REST_AFTER);
  };
  function rest() {
    pane.style.backgroundImage = `url(${capture()})`;
    canvas.style.visibility = "hidden";
    isResting = true;
    viewer.renderer.forceContextLoss();
  }
  function wake() {
    if (isResting) setTimeout(() => viewer.renderer.forceContextRestore());
    isResting = false;
  }
  canvas.addEventListener("webglcontextrestored", () => {
    viewer.render();
    canvas.style.visibility = "";
    pane.style.backgroundImage = "";
  });
  viewer.resting = () => isResting;
  return {
    setSight(now) {
      isSeen = now;
      if (isSeen) wake();
      restLater();
    },
  };
}

// Call a function once the next picture is drawn, or after half a second, so that the work of the
// window or the notebook does not delay the picture.
export function afterDrawing(call) {
  if (document.hidden) return call();
  let timer = 0, next = 0;
  const go = () => {
    clearTimeout(timer);
    cancelAnimationFrame(next);
    call();
  };
  timer = setTimeout(go, UNSEEN);
  next = requestAnimationFrame(go); // after the viewer's own, which was requested before
}
