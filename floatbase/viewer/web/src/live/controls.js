// Controls of a live robot: commands for the viewer's panel, and what each of them changes.

import {rangeOf, rows} from "../engine/settings.js";
import {footName} from "./words.js";

const TERMS = "terms of eq. (7)"; // a section

// The text of a control, such as "CoM x [cm]". row: of the table of settings.
export const labelOf = ({name, symbol = "", unit = ""}) => (
  [name, symbol, unit && `[${unit}]`].filter((part) => part).join(" "));

// The controls of a robot: [{command, change(value)}]; change returns messages for the worker:
// {set}, {timeScale} and others. push: {force, towards, duration}, changed in place. open: called
// with another robot's name. walk: called with the name of a gait, or null to stand. shove():
// returns the message that pushes the robot.
export function controlsOf(robot, settings, push, {names, name, open, walk, shove}) {
  const control = (label, command, change) => (
    {command: {type: "set_control", path: "", name: label, ...command}, change});
  const slider = (key, value, change, column, more) => {
    const {low: min, high: max, step} = rangeOf(key, robot), {section} = rows[key];
    const label = column ? `${labelOf(rows[key])} ${column}` : labelOf(rows[key]);
    return control(label, {value, min, max, step, section, column, ...more}, change);
  };
  const choice = (key, value, choices, change) => (
    control(labelOf(rows[key]), {value, choices, section: rows[key].section}, change));
  const set = (setting, scale = 1) => (value) => ({set: {[setting]: value * scale}});
  const pair = (key, model, reality) => [
    slider(key, settings[model], set(model), "model"),
    slider(key, settings[reality], set(reality), "reality"),
  ];
  const scaled = (key, setting) => (
    slider(key, rows[key].first, set(setting, rows[key].scale)));
  const term = (label, model, reality) => [["model", model], ["reality", reality]].map(
    ([column, setting]) => control(`${label} ${column}`,
      {value: settings[setting], section: TERMS, column}, (value) => ({set: {[setting]: value}})),
  );

  const gaits = Object.keys(robot.gaits), feet = [...new Set(robot.points.map(footName))];
  return [
    slider("push", push.force, (value) => {
      push.force = value;
      return value > 0 ? shove() : undefined;
    }, "", {on_release: true}),
    slider("towards", push.towards, (value) => { push.towards = value; }),
    slider("duration", push.duration, (value) => { push.duration = value; }),
    slider("speed", rows.speed.first, (value) => ({timeScale: value})),
    control(rows.robot.name, {value: names.indexOf(name), choices: names}, (value) => {
      open(names[value]);
    }),
    ...pair("friction", "mu", "actualMu"),
    ...pair("payload", "payload", "actualPayload"),
    slider("gravity", settings.gravity, set("gravity")),
    ...(robot.lifted.length ? [choice("lift", 0, ["none", ...robot.lifted.map(footName)],
      (value) => ({set: {lifted: robot.lifted[value - 1] ?? null}}))] : []),
    scaled("com_x", "forward"),
    scaled("com_y", "left"),
    scaled("com_z", "height"),
    ...(gaits.length ? [choice("gait", gaits.indexOf(settings.gait) + 1, ["stand", ...gaits],
      (value) => walk(gaits[value - 1] ?? null))] : []),
    choice("facets", 0, robot.facets.map(String), (value) => (
      {set: {facets: robot.facets[value]}})),
    scaled("torque_limits", "torque"),
    ...term("gravity", "hasGravity", "actualHasGravity"),
    ...term("Coriolis", "hasCoriolis", "actualHasCoriolis"),
    control("foot without ground", {value: 0, choices: ["none", ...feet], section: TERMS},
      (value) => ({set: {
        missing: robot.points.filter((point) => footName(point) === feet[value - 1]),
      }})),
  ];
}
