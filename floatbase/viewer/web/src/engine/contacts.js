// What the forces at the feet say: whether points slip, and whether the robot is in the air.

const SLIPPING = 0.97, BEYOND = 1.02; // fractions of the actual friction limit
const UNLOADED = 0.01; // fraction of the weight: a point with less does not stand

// Contact points whose measured force is at the actual friction limit, while the planned force is
// beyond it.
export function slippingPoints({measured, planned, settings: {actualMu}}, {points, weight}) {
  const least = UNLOADED * weight;
  return points.filter((_, i) => {
    const [x, y, z] = measured.subarray(3 * i, 3 * i + 3);
    const [px, py, pz] = planned.subarray(3 * i, 3 * i + 3);
    return Math.min(z, pz) > least && Math.hypot(x, y) > SLIPPING * actualMu * z
      && Math.hypot(px, py) > BEYOND * actualMu * pz;
  });
}

// At the first picture of a run, no forces have been measured yet.
export const isInAir = ({measured, time}, {weight}) => time > 0
  && measured.every((force) => Math.abs(force) < UNLOADED * weight);
