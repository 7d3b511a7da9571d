// MuJoCo's models of a robot: one for the physics, one for what the controller assumes.

import {biasForces, cross} from "./dynamics.js";

// Make a model and its data, with all digits. mj: MuJoCo. robot: its data.
export function makeModel(mj, robot) {
  const model = mj.MjModel.from_xml_string(robot.xml);
  for (const [name, values] of Object.entries(robot.overrides)) model[name]?.set(values);
  const base = robot.bodies[1], baseMass = model.body_mass[base];
  const data = new mj.MjData(model), scratch = new mj.MjData(model);
  const [moving, resting, turning] = [0, 1, 2].map(() => new mj.DoubleBuffer(robot.nv));
  return {
    model, data, baseMass,
    // Forces that cancel the Coriolis and centrifugal forces of eq. (7), in MuJoCo's coordinates.
    // In (7), the base's velocity is expressed along the axes of the base, which adds M (ω × v).
    coriolisCompensation() {
      scratch.qpos.set(data.qpos);
      scratch.qvel.set(data.qvel);
      mj.mj_kinematics(model, scratch);
      mj.mj_comPos(model, scratch);
      mj.mj_makeM(model, scratch);
      biasForces(mj, model, scratch, moving, true);
      biasForces(mj, model, scratch, resting, false);
      const R = scratch.xmat.subarray(9 * base, 9 * base + 9), v = data.qvel;
      const [x, y, z] = [0, 3, 6].map((r) => R[r] * v[3] + R[r + 1] * v[4] + R[r + 2] * v[5]);
      const acceleration = new Float64Array(robot.nv);
      acceleration.set(cross([x, y, z], v));
      mj.mj_mulM(model, scratch, turning, acceleration);
      const [h, atRest, frame] = [moving, resting, turning].map((buffer) => buffer.GetView());
      return h.map((force, i) => force - atRest[i] + frame[i]);
    },
    // The wrench on the base that eq. (7) requires beyond the forces at the contact points, in
    // MuJoCo's coordinates. qdd: in the package's order and coordinates, as v. forces: {at, force},
    // world frame. hasCoriolis: whether (7) has velocity-dependent forces.
    baseWrench(qdd, v, forces, hasCoriolis) {
      const R = data.xmat.subarray(9 * base, 9 * base + 9);
      const turning = hasCoriolis ? cross(v.subarray(3, 6), v) : [0, 0, 0];
      const linear = turning.map((x, i) => qdd[i] + x);
      for (let i = 0; i < robot.nv; i++) data.qacc[robot.qvelOfV[i]] = qdd[i];
      for (let r = 0; r < 3; r++) {
        data.qacc[r] = [0, 1, 2].reduce((sum, c) => sum + R[3 * r + c] * linear[c], 0);
      }
      biasForces(mj, model, data, moving, hasCoriolis, true);
      const wrench = moving.GetView().slice(0, 6), middle = data.xpos.subarray(3 * base);
      for (const {at, force: f} of forces) {
        const moment = cross(at.map((c, i) => c - middle[i]), f);
        for (let i = 0; i < 3; i++) {
          wrench[i] -= f[i];
          for (let r = 0; r < 3; r++) wrench[3 + i] -= R[3 * r + i] * moment[r];
        }
      }
      return wrench;
    },
    // payload: kg at the base's centre of mass. gravity: m/s², downwards.
    change({payload, gravity}) {
      model.opt.gravity[2] = -gravity;
      if (model.body_mass[base] === baseMass + payload) return;
      model.body_mass[base] = baseMass + payload;
      mj.mj_setConst(model, scratch);
    },
    setFriction(mu) {
      const friction = model.geom_friction;
      for (let i = 0; i < friction.length; i += 3) friction[i] = mu;
    },
    // Scale the motors' limits.
    setTorque(fraction) {
      const range = model.actuator_ctrlrange;
      robot.motors.forEach((motor, i) => {
        range[2 * motor] = -fraction * robot.torqueLimits[i];
        range[2 * motor + 1] = fraction * robot.torqueLimits[i];
      });
    },
    // Contact points, by their names, that pass through the ground.
    setMissing(names) {
      for (const {name, geom} of robot.points) {
        model.geom_conaffinity[geom] = Number(!names.includes(name));
      }
    },
    // Switch collisions between the ground and the links' hulls on or off.
    setHulls(isOn) {
      for (const geom of robot.hulls) model.geom_conaffinity[geom] = Number(isOn);
      for (const body of robot.hullBodies) model.body_conaffinity[body] = Number(isOn);
    },
    free() {
      for (const one of [moving, resting, turning, scratch, data, model]) one.delete();
    },
  };
}

// Call call(point, i, contact) for each contact i of a contact point with the ground.
function forEachContact({data}, robot, call) {
  const pointOf = new Map(robot.points.map(({geom}, i) => [geom, i]));
  const contacts = data.contact;
  for (let i = 0; i < data.ncon; i++) {
    const contact = contacts.get(i), point = pointOf.get(contact.geom2);
    if (point !== undefined) call(point, i, contact);
    contact.delete();
  }
  contacts.delete();
}

// Forces of the ground on the robot's contact points in the last step, world frame, 3 numbers each.
// adhesion: N, with which the ground attracts each of them.
export function contactForces(mj, actual, robot, buffer, adhesion) {
  const forces = new Float64Array(3 * robot.points.length);
  forEachContact(actual, robot, (point, i, {frame}) => { // axes of the contact, row by row
    mj.mj_contactForce(actual.model, actual.data, i, buffer);
    const force = buffer.GetView();
    for (let r = 0; r < 3; r++) {
      for (let c = 0; c < 3; c++) forces[3 * point + c] += force[r] * frame[3 * r + c];
    }
    forces[3 * point + 2] -= adhesion;
  });
  return forces;
}

// Contact points that touch the ground at the present positions.
export function touchingPoints(mj, actual, robot) {
  const found = [];
  mj.mj_fwdPosition(actual.model, actual.data);
  forEachContact(actual, robot, (point) => found.push(robot.points[point]));
  return found;
}
