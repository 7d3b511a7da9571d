// Light or dark. A picture that was made for "white" or "light" is dark if the page around it or
// the browser is dark. The configuration has the backgrounds, and the shades for a dark one.

import {
  copyGreys, darkShades, hasDarkLetters, isLight, toChannels, toCode, toNumber,
} from "./colours.js";

const GLOW = 0x181b1f; // emitted by robots in the dark; black parts would be invisible otherwise
const WHITE = 0xffffff; // of materials that take their colours from elsewhere
const RETRY = 400; // ms after the page around has changed: its style may follow its attributes
const DARK_BROWSER = "(prefers-color-scheme: dark)";

// Whether the text around this page's frame is light; without a frame, whether the browser prefers
// dark.
function isDarkAround() {
  const around = window.frameElement?.parentElement;
  return around ? isLight(getComputedStyle(around).color) : matchMedia(DARK_BROWSER).matches;
}

function watchAround(look) {
  matchMedia(DARK_BROWSER).addEventListener("change", look);
  const around = window.frameElement?.ownerDocument;
  if (!around) return;
  const observer = new MutationObserver(() => {
    look();
    setTimeout(look, RETRY);
  });
  for (const node of [around.documentElement, around.body]) {
    observer.observe(node, {attributes: true});
  }
  // otherwise the page around keeps a removed frame in memory
  window.addEventListener("pagehide", () => observer.disconnect());
}

// onChange is called after the theme has changed.
export function createTheme(viewer, {backgrounds, shades: codes}) {
  let name = "light", dark = false, onChange = () => {};
  let table = null; // of shades, for the name
  const shades = () => table ??= darkShades({backgrounds, shades: codes}, name);
  const shade = (colour) => dark ? shades().get(colour) ?? colour : colour;

  function paint({material, geometry}) {
    if (!material?.color) return;
    const {type, vertexColors, userData: kept} = material;
    if (type === "SpriteMaterial") return paintLabel(material, kept);
    if (type === "MeshBasicMaterial" && vertexColors) {
      return paintCorners(geometry.attributes.color, kept);
    }
    kept.own ??= material.color.getHex();
    if (material.emissive && vertexColors) material.emissive.setHex(dark ? GLOW : 0);
    if (kept.own !== WHITE && shades().has(kept.own)) material.color.setHex(shade(kept.own));
  }
  function paintCorners(colours, kept) {
    kept.own ??= colours.array.slice();
    for (let i = 0; i < kept.own.length; i += 3) {
      const [red, green, blue] = kept.own.slice(i, i + 3);
      colours.array.set(toChannels(shade((red << 16) + (green << 8) + blue)), i);
    }
    colours.needsUpdate = true;
  }
  function paintLabel({map}, kept) {
    const data = map?.image?.data;
    if (!data) return;
    kept.own ??= data.slice();
    kept.inverts ??= hasDarkLetters(kept.own);
    if (!kept.inverts) return;
    copyGreys(kept.own, data, dark);
    map.needsUpdate = true;
  }

  function paintBackground() {
    const [top, bottom] = backgrounds[dark ? "dark" : name];
    const parts = (code) => toChannels(toNumber(code)).map((channel) => channel / 255);
    viewer.scene.background?.dispose?.(); // meshcat makes another one
    viewer.set_property(["Background"], "top_color", parts(top));
    viewer.set_property(["Background"], "bottom_color", parts(bottom));
  }
  const wanted = () => name === "dark" || isDarkAround();
  function change() {
    dark = wanted();
    document.body.classList.toggle("dark", dark);
    paintBackground();
    viewer.scene.traverse(paint);
    onChange();
    viewer.set_dirty();
  }
  watchAround(() => { if (wanted() !== dark) change(); });
  return {
    set(command) {
      name = command.name;
      table = null;
      change();
    },
    onChange: (call) => { onChange = call; },
    // the code that a colour's code has in the present theme
    colour: (code) => dark ? toCode(shade(toNumber(code))) : code,
    // what a command of meshcat's has changed; made: the object that it has made, if any
    afterCommand({type, path}, made) {
      if (type === "set_property" && path === "/Background" && dark) paintBackground();
      if (made && dark) made.traverse(paint);
    },
  };
}
