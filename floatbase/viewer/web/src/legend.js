// The legend, at the lower left. If it would cover what the camera looks at, it is collapsed into a
// button: pointing at it or focusing it with the keyboard opens it, a click keeps it open, Escape
// closes it.

import {element, make} from "./dom.js";

const LINGER = 1000; // ms before entries disappear: a force that comes and goes makes no flicker

// Whether an open legend would be in the way. All in pixels: lines: the box of the open legend;
// player: that of the player, null without one; titleBottom: lower edge of the title; width,
// height: of the picture.
export function isCrowded({lines, player, titleBottom, width, height}) {
  const middle = {x: width / 2, y: height / 2};
  const away = Math.hypot(
    Math.max(middle.x - lines.right, 0), Math.max(lines.top - middle.y, 0),
  );
  return lines.bottom - lines.top > 0.3 * height
    || away < middle.y // the camera fits what it looks at into a ball as high as the picture
    || lines.top < titleBottom
    || (player !== null && lines.right > player.left);
}

// Whether items are some of those that are shown, and not all.
export function isFewer(items, shown) {
  const known = new Set(shown.map(String));
  return items.length < shown.length && items.every((item) => known.has(String(item)));
}

// The items in the colours of a theme, and each of these colours once. items: [colour, text,
// symbol], …; shade: the colour that a colour has in the theme.
export function shadedItems(items, shade) {
  const shaded = items.map(([colour, ...rest]) => [shade(colour), ...rest]);
  return {shaded, colours: [...new Set(shaded.map(([colour]) => colour))]};
}

export function createLegend(shade) {
  const legend = element("legend"), lines = element("lines");
  const button = legend.querySelector("button");
  const box = (id) => element(id).getBoundingClientRect();
  let isKept = false, shown = [], timer = 0;
  const open = (now) => {
    legend.classList.toggle("open", now);
    button.setAttribute("aria-expanded", now);
  };
  const keep = (now) => { open(isKept = now); };
  function fold() {
    legend.classList.remove("folded"); // to measure its open size
    const player = box("player").width > 0 ? box("player") : null;
    const crowded = isCrowded({
      lines: box("lines"), player, titleBottom: box("title").bottom,
      width: element("meshcat-pane").clientWidth, height: element("meshcat-pane").clientHeight,
    });
    legend.classList.toggle("folded", crowded && lines.childElementCount > 0);
    const covers = player !== null && button.getBoundingClientRect().right > player.left;
    legend.classList.toggle("raised", covers);
  }
  legend.onpointerenter = ({pointerType}) => { if (pointerType === "mouse") open(true); };
  legend.onpointerleave = () => open(isKept);
  legend.onkeydown = ({key}) => { if (key === "Escape") keep(false); };
  button.onfocus = () => open(true);
  button.onblur = () => open(isKept);
  button.onclick = () => keep(!isKept);
  const sizes = new ResizeObserver(fold);
  for (const id of ["meshcat-pane", "player", "panel"]) sizes.observe(element(id));
  function show(items) {
    clearTimeout(timer);
    if (isFewer(items, shown)) timer = setTimeout(draw, LINGER, items);
    else draw(items);
  }
  function draw(items) {
    shown = items;
    const {shaded, colours} = shadedItems(items, shade);
    lines.replaceChildren(...shaded.map(
      ([colour, text, symbol]) => make("div", {}, spot(colour, symbol), text),
    ));
    button.firstChild.replaceChildren(...colours.map((colour) => spot(colour)));
    fold();
  }
  return {show, redraw: () => draw(shown)};
}

// A patch of a colour, or one of the style sheet's symbols in it: a disc, a ring, a diamond, a
// line, a cone, a tile, a curl.
function spot(colour, symbol = "patch") {
  const made = make("i", {className: symbol});
  made.style.color = colour;
  return made;
}
