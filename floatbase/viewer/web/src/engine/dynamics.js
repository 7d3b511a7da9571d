// MuJoCo's quantities of a state in Pinocchio's form, which the control step takes: the base's
// linear velocity in the base frame, spatial Jacobians about the world's origin, linear part first.

const SLIDE = 2; // MuJoCo's type of a prismatic joint

// Write MuJoCo's bias forces of the state in `data` into `result`, with or without those that
// depend on the velocity. The positions in `data` must be up to date.
export function biasForces(mj, model, data, result, hasCoriolis) {
  const velocity = hasCoriolis ? null : data.qvel.slice();
  if (velocity) data.qvel.fill(0);
  mj.mj_comVel(model, data);
  mj.mj_rne(model, data, 0, result);
  if (velocity) data.qvel.set(velocity);
}

// mj: MuJoCo. model, data: those of the controller. robot: its data. views: those of the tick.
// Returns a function that fills the views for the state in `data`; hasCoriolis: whether h contains
// the forces that depend on the velocity.
export function createDynamics(mj, model, data, robot, views) {
  const {nq, nv, d, qposOfQ, qvelOfV, bodies, joints} = robot;
  const M = new mj.DoubleBuffer(nv * nv), C = new mj.DoubleBuffer(3 * nv);
  const h = new mj.DoubleBuffer(nv);
  const turned = new Float64Array(nv * nv), bias = new Float64Array(nv);
  const isSlide = joints.map((joint) => model.jnt_type[joint] === SLIDE);
  const base = bodies[1];

  return function update(hasCoriolis = true) {
    mj.mj_kinematics(model, data);
    mj.mj_comPos(model, data);
    mj.mj_makeM(model, data);
    biasForces(mj, model, data, h, hasCoriolis);
    mj.mj_fullM(model, data, M);
    mj.mj_jacSubtreeCom(model, data, C, base);
    const qpos = data.qpos, qvel = data.qvel, xpos = data.xpos, xmat = data.xmat;
    const R = xmat.subarray(9 * base, 9 * base + 9); // row by row
    state(qpos, qvel, R);
    inertia(M.GetView(), h.GetView(), R, hasCoriolis);
    momentum(C.GetView(), R, model.body_subtreemass[base]);
    poses(xpos, xmat);
    jacobian(xpos, data.xaxis, data.xanchor, R);
  };

  function state(qpos, qvel, R) {
    const {q, v} = views;
    for (let i = 0; i < nq; i++) q[i] = qpos[qposOfQ[i]];
    for (let i = 0; i < nv; i++) v[i] = qvel[qvelOfV[i]];
    for (let i = 0; i < 3; i++) {
      v[i] = R[i] * qvel[0] + R[3 + i] * qvel[1] + R[6 + i] * qvel[2];
    }
  }
  // M and h. The base's velocity turns with the base, which adds M (ω × v) to h.
  function inertia(m, h0, R, hasCoriolis) {
    const {v} = views, on = Number(hasCoriolis);
    const x = on * (v[4] * v[2] - v[5] * v[1]), y = on * (v[5] * v[0] - v[3] * v[2]);
    const z = on * (v[3] * v[1] - v[4] * v[0]);
    const a0 = R[0] * x + R[1] * y + R[2] * z, a1 = R[3] * x + R[4] * y + R[5] * z;
    const a2 = R[6] * x + R[7] * y + R[8] * z;
    for (let r = 0; r < nv; r++) {
      const i = r * nv, m0 = m[i], m1 = m[i + 1], m2 = m[i + 2];
      bias[r] = h0[r] + m0 * a0 + m1 * a1 + m2 * a2;
      for (let c = 0; c < 3; c++) turned[i + c] = m0 * R[c] + m1 * R[3 + c] + m2 * R[6 + c];
      for (let c = 3; c < nv; c++) turned[i + c] = m[i + c];
    }
    for (let i = 0; i < nv; i++) {
      const c = qvelOfV[i];
      const t0 = turned[c], t1 = turned[nv + c], t2 = turned[2 * nv + c];
      for (let r = 0; r < 3; r++) {
        views.M[i * nv + r] = R[r] * t0 + R[3 + r] * t1 + R[6 + r] * t2;
      }
      for (let r = 3; r < nv; r++) views.M[i * nv + r] = turned[qvelOfV[r] * nv + c];
      views.h[i] = i < 3 ? R[i] * bias[0] + R[3 + i] * bias[1] + R[6 + i] * bias[2] : bias[c];
    }
  }
  // The first three rows of the centroidal momentum matrix; the tick does not use the others.
  function momentum(jacobianOfCom, R, mass) {
    for (let i = 0; i < nv; i++) {
      for (let r = 0; r < 3; r++) {
        const at = r * nv;
        views.Ag[6 * i + r] = mass * (i < 3
          ? jacobianOfCom[at] * R[i] + jacobianOfCom[at + 1] * R[3 + i]
            + jacobianOfCom[at + 2] * R[6 + i]
          : jacobianOfCom[at + qvelOfV[i]]);
      }
    }
  }
  function poses(xpos, xmat) {
    const O = views.oMi;
    for (let i = 0; i < bodies.length; i++) {
      for (let c = 0; c < 3; c++) {
        for (let r = 0; r < 3; r++) O[12 * i + 3 * c + r] = xmat[9 * bodies[i] + 3 * r + c];
        O[12 * i + 9 + c] = xpos[3 * bodies[i] + c];
      }
    }
  }
  function jacobian(xpos, axes, anchors, R) {
    const J = views.J, at = 3 * base;
    for (let i = 0; i < 3; i++) {
      for (let r = 0; r < 3; r++) J[6 * i + r] = R[3 * r + i];
      turn(3 + i, R[i], R[3 + i], R[6 + i], xpos[at], xpos[at + 1], xpos[at + 2]);
    }
    for (let i = 0; i < d; i++) {
      const j = 3 * joints[i], x = axes[j], y = axes[j + 1], z = axes[j + 2];
      if (isSlide[i]) {
        J[6 * (6 + i)] = x;
        J[6 * (6 + i) + 1] = y;
        J[6 * (6 + i) + 2] = z;
      } else turn(6 + i, x, y, z, anchors[j], anchors[j + 1], anchors[j + 2]);
    }
  }
  // Column `c` of J: a rotation about the axis (x, y, z) through the point (a, b, e).
  function turn(c, x, y, z, a, b, e) {
    const J = views.J;
    J[6 * c] = b * z - e * y;
    J[6 * c + 1] = e * x - a * z;
    J[6 * c + 2] = a * y - b * x;
    J[6 * c + 3] = x;
    J[6 * c + 4] = y;
    J[6 * c + 5] = z;
  }
}
