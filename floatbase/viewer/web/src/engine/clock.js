// A real-time clock for a simulation that advances only when a picture is wanted. If the machine is
// too slow, it does not catch up: the simulation is in slow motion, and `factor` says how slow.

const LONGEST = 100; // ms that the simulation advances from picture to picture, at most
const LONGEST_PUSHED = 30; // ms, while a push acts and pictures are slower than that
const RESTED = 2000; // ms without a picture, after which the page was not in sight
const BUSY = 0.85; // fraction of the time between two pictures that steps may take
const SMOOTHING = 0.05; // weight of the newest picture in `factor`

// step: s. All times in ms.
export function createClock(step) {
  let last = null, scale = 1, isPaused = false, single = 0, rest = 0, factor = 1, elapsed = 0;
  let stepTime = 0, passed = 0;
  return {
    reset() { [last, rest, factor] = [null, 0, 1]; },
    setScale(value) { scale = value; },
    pause(value) { isPaused = value; },
    single() { single++; },
    // The number of steps until `now`. isPushed: whether a push acts now.
    steps(now, isPushed = false) {
      passed = last === null || now - last > RESTED ? 0 : now - last;
      const isSlow = passed > LONGEST;
      elapsed = isSlow ? (isPushed ? LONGEST_PUSHED : LONGEST) : passed;
      last = now;
      if (isPaused) {
        const count = single;
        single = 0;
        return count;
      }
      single = 0;
      rest += scale * elapsed / 1000 / step;
      const count = Math.floor(rest);
      rest -= count;
      return count;
    },
    // ms that the steps of this picture may take
    get budget() { return Math.max(4, BUSY * elapsed); },
    // Report that `count` steps took `time`.
    done(count, time) {
      if (count > 0) stepTime = time / count;
      if (isPaused || elapsed === 0) return;
      const now = count * step * 1000 / passed / scale;
      factor += SMOOTHING * (Math.min(1, now) - factor);
    },
    get factor() { return factor * scale; },
    get stepTime() { return stepTime; }, // ms
  };
}
