// Light or dark. A picture that was asked for "white" or "light" is dark where the page around it is, or the browser. BACKGROUNDS
// and DARK_SHADES come from colours.py: what the backgrounds are, and colours that a dark one needs in another shade.

const GLOW = 0x181b1f;  // that robots have of their own in the dark, where black parts would not be seen
const RETRY = 400;  // ms after a change of the page around, whose style may come later than its mark

// Whether the words around this page's frame are lighter than its paper; of a page on its own, what the browser prefers.
function darkAround() {
  const around = window.frameElement?.parentElement;
  if (!around) return matchMedia("(prefers-color-scheme: dark)").matches;
  const colour = getComputedStyle(around).color, whole = colour.startsWith("color(") ? 1 : 255;  // color(srgb 1 1 1), rgb(255, 255, 255)
  const [red, green, blue] = colour.match(/[\d.]+/g).map(Number);
  return 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 * whole;
}

function watchAround(look) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", look);
  const around = window.frameElement?.ownerDocument;
  if (!around) return;
  const again = new MutationObserver(() => { look(); setTimeout(look, RETRY); });
  for (const node of [around.documentElement, around.body]) again.observe(node, {attributes: true});
  window.addEventListener("pagehide", () => again.disconnect());  // else the page around holds all of a frame that it removes
}

// legend: is shown anew when the theme changes.
function startTheme(viewer, legend) {
  let asked = "light", dark = false;
  const number = (colour) => parseInt(colour.slice(1), 16);
  let table = null;  // of shades, for what was asked
  const shades = () => table ??= made();
  const made = () => {
    const [paper, , lines, text] = BACKGROUNDS[asked], [night, , dim, bright] = BACKGROUNDS.dark;
    return new Map([...Object.entries(DARK_SHADES), [lines, dim], [text, bright], [paper, night]].map((pair) => pair.map(number)));
  };
  const shade = (colour, own = colour) => dark ? shades().get(colour) ?? own : own;

  function paint({material, geometry}) {
    if (!material?.color) return;
    const kept = material.userData;
    if (material.type == "SpriteMaterial") return paintLabel(material, kept);
    if (material.type == "MeshBasicMaterial" && material.vertexColors) return paintCorners(geometry.attributes.color, kept);
    kept.own ??= material.color.getHex();
    if (material.emissive && material.vertexColors) material.emissive.setHex(dark ? GLOW : 0);
    if (kept.own != 0xffffff && shades().has(kept.own)) material.color.setHex(shade(kept.own));  // white is no colour of its own
  }
  function paintCorners(colours, kept) {
    kept.own ??= colours.array.slice();
    for (let i = 0; i < kept.own.length; i += 3) {
      const [red, green, blue] = kept.own.slice(i, i + 3), now = shade((red << 16) + (green << 8) + blue);
      colours.array.set([now >> 16, now >> 8 & 255, now & 255], i);
    }
    colours.needsUpdate = true;
  }
  // A label is grey and alpha in turn. One with dark letters has a light plate: in the dark its greys are turned round.
  function paintLabel({map}, kept) {
    const data = map?.image?.data;
    if (!data) return;
    kept.own ??= data.slice();
    kept.light ??= Math.min(...kept.own.filter((_, i) => i % 2 == 0 && kept.own[i + 1] == 255)) < 128;
    if (!kept.light) return;
    for (let i = 0; i < data.length; i += 2) data[i] = dark ? 255 - kept.own[i] : kept.own[i];
    map.needsUpdate = true;
  }

  function stage() {
    const [top, bottom] = BACKGROUNDS[dark ? "dark" : asked];
    const parts = (colour) => [16, 8, 0].map((by) => (number(colour) >> by & 255) / 255);
    viewer.set_property(["Background"], "top_color", parts(top));
    viewer.set_property(["Background"], "bottom_color", parts(bottom));
  }
  function look() {
    dark = asked == "dark" || darkAround();
    document.body.classList.toggle("dark", dark);
    stage();
    viewer.scene.traverse(paint);
    legend.again();
    viewer.set_dirty();
  }
  watchAround(() => { if ((asked == "dark" || darkAround()) != dark) look(); });
  return {
    ask: ({name}) => { asked = name; table = null; look(); },
    colour: (code) => dark ? `#${shade(number(code)).toString(16).padStart(6, "0")}` : code,
    // what a command of meshcat's has changed; made: the object that it has made, if any
    after({type, path}, made) {
      if (type == "set_property" && path == "/Background" && dark) stage();
      if (made && dark) made.traverse(paint);
    },
  };
}
