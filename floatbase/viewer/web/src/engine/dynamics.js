// The robot's state in MuJoCo and in Pinocchio's form, which the control step takes: there, the
// base's linear velocity is expressed in the base frame.

export const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

// Write MuJoCo's bias forces of the state in `data` into `result`, with or without those that
// depend on the velocity, and those that give the acceleration in `data`. The positions in `data`
// must be up to date.
export function biasForces(mj, model, data, result, hasCoriolis, hasAcceleration = false) {
  const velocity = hasCoriolis ? null : data.qvel.slice();
  if (velocity) data.qvel.fill(0);
  mj.mj_comVel(model, data);
  mj.mj_rne(model, data, Number(hasAcceleration), result);
  if (velocity) data.qvel.set(velocity);
}

// Update the kinematics of the state in `data`, and write the state into the tick's views q and v.
export function readState(mj, model, data, robot, {q, v}) {
  const {nq, nv, qposOfQ, qvelOfV, bodies} = robot, base = bodies[1];
  mj.mj_kinematics(model, data);
  mj.mj_comPos(model, data);
  const {qpos, qvel} = data, R = data.xmat.subarray(9 * base, 9 * base + 9); // row by row
  for (let i = 0; i < nq; i++) q[i] = qpos[qposOfQ[i]];
  for (let i = 0; i < nv; i++) v[i] = qvel[qvelOfV[i]];
  for (let i = 0; i < 3; i++) v[i] = R[i] * qvel[0] + R[3 + i] * qvel[1] + R[6 + i] * qvel[2];
}
