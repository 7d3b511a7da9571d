// When the feet of a gait stand and swing, as `Gait` in floatbase/behaviours/walk/gait.py. A gait:
// {offsets: {foot: fraction of the period}, period, swing, start, stop}, s; stop is Infinity in an
// endless gait.

const TOLERANCE = 1e-9; // s

const firstLiftOff = (gait, foot) => gait.start + gait.offsets[foot] * gait.period;
const mayLift = (gait, time) => time < gait.stop - TOLERANCE;

// Times of lift-off and touchdown of a foot in the air at t, or null.
export function swingAt(gait, foot, t) {
  const first = firstLiftOff(gait, foot);
  const cycles = Math.floor((t + TOLERANCE - first) / gait.period);
  const liftOff = first + cycles * gait.period;
  const isSwinging = cycles >= 0 && t < liftOff + gait.swing - TOLERANCE && mayLift(gait, liftOff);
  return isSwinging ? [liftOff, liftOff + gait.swing] : null;
}

// Time of a foot's first lift-off at t or later, or Infinity.
export function nextLiftOff(gait, foot, t) {
  const first = firstLiftOff(gait, foot);
  const cycles = Math.max(0, -Math.floor((first - t + TOLERANCE) / gait.period));
  const liftOff = first + cycles * gait.period;
  return mayLift(gait, liftOff) ? liftOff : Infinity;
}

export const stanceAt = (gait, t) =>
  Object.keys(gait.offsets).filter((foot) => !swingAt(gait, foot, t));

export const liftsLater = (gait, t) => Object.keys(gait.offsets)
  .some((foot) => nextLiftOff(gait, foot, Math.max(t, gait.start)) < Infinity);

function nextContactChange(gait, t) {
  return Math.min(...Object.keys(gait.offsets).flatMap((foot) => [
    swingAt(gait, foot, t)?.[1] ?? Infinity, nextLiftOff(gait, foot, t + 2 * TOLERANCE),
  ]));
}

// The next `count` periods of constant stance: {begin, end, stance}. A stance that lasts longer
// than `most` is cut off there, and is the last one.
export function phasesOf(gait, t, count, most) {
  const phases = [];
  for (let begin = t; phases.length < count;) {
    const end = nextContactChange(gait, begin), stance = stanceAt(gait, begin);
    if (end - begin > most) return [...phases, {begin, end: begin + most, stance}];
    phases.push({begin, end, stance});
    begin = end;
  }
  return phases;
}
