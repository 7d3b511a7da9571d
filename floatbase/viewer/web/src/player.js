// Play, pause, seek and slow motion for an animation.

import {element, prefersReducedMotion} from "./dom.js";

export function createPlayer(viewer) {
  const bar = element("player"), button = bar.querySelector("button");
  const slider = bar.querySelector("input"), speed = bar.querySelector("select");
  const clock = bar.querySelector("output");
  const animator = () => viewer.animator; // replaced with each animation
  let isTicking = false;
  function tick() {
    isTicking = bar.style.display !== "none";
    if (!isTicking) return;
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
    // Show what meshcat has loaded: animations and options of the command set_animation.
    load({animations, options}) {
      bar.style.display = animations.length ? "flex" : "none";
      if (!animations.length) return;
      slider.max = animator().duration;
      const requested = String(options.speed);
      if (![...speed.options].some(({value}) => value === requested)) {
        speed.add(new Option(`${requested}×`, requested));
      }
      speed.value = requested;
      animator().mixer.timeScale = options.speed;
      if (options.paused || prefersReducedMotion()) {
        animator().pause();
        animator().seek(0); // the first picture; until then, items that appear later are visible
      }
      if (!isTicking) tick();
    },
  };
}
