// meshcat's renderer, as far as the machine can follow. Without a graphics card, smooth edges and
// the full resolution each double the time of a picture.

import {three} from "./meshcat.js";

const MOST_PIXELS = 2; // per pixel of the page: more are not seen, and phones have 3
const CHEAP = 0.5; // pixels per pixel of the page, of a picture that moves
const TRIED = 5; // pictures, the fastest of which tells how fast the machine draws
const SLOW = 100; // ms
const STILL = 400; // ms without a change, after which a cheap picture is drawn sharply

// Whether a renderer of this name draws without a graphics card.
export const isSoftware = (name) =>
  /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);

function rendererName() {
  const gl = document.createElement("canvas").getContext("webgl");
  if (gl === null) return "";
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return String(name);
}

// A renderer in an element. Throws an error if the browser has no WebGL. A film is drawn sharply,
// however long it takes.
export function createRenderer(pane) {
  const antialias = Boolean(window.isFilmed) || !isSoftware(rendererName());
  const renderer = new (three().WebGLRenderer)({antialias, alpha: true});
  pane.append(renderer.domElement);
  return {renderer, isCheap: !antialias};
}

// Choose the pixels of each picture: few while the picture moves, if the machine is slow, and all
// of them otherwise. Its first pictures tell whether a machine is slow whose renderer has a good
// name.
export function adaptPixels(viewer, isCheap) {
  const {renderer} = viewer, gl = renderer.getContext(), pixel = new Uint8Array(4), times = [];
  const render = viewer.render.bind(viewer), isKnown = isCheap || Boolean(window.isFilmed);
  let timer = 0;
  function draw(most) {
    const ratio = Math.min(devicePixelRatio, most);
    if (renderer.getPixelRatio() !== ratio) renderer.setPixelRatio(ratio);
    render();
  }
  viewer.render = () => {
    clearTimeout(timer);
    if (isCheap) {
      draw(CHEAP);
      // a change comes with a picture of its own, before which the camera moves
      timer = setTimeout(() => viewer.needs_render || draw(1), STILL);
      return;
    }
    const begun = performance.now();
    draw(MOST_PIXELS);
    if (isKnown || times.length === TRIED) return;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits for the picture
    times.push(performance.now() - begun);
    isCheap = times.length === TRIED && Math.min(...times) > SLOW;
  };
  viewer.capture_image = () => {
    const isChanged = viewer.needs_render;
    draw(MOST_PIXELS);
    viewer.needs_render = isChanged;
    return renderer.domElement.toDataURL();
  };
}
