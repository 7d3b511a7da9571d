// Controls of a live robot: commands for the viewer's panel, what each of them changes, and what it
// shows.

import {challenges} from "../engine/challenges.js";
import {rangeOf, rows, terms} from "../engine/settings.js";
import {footName, pointName} from "./words.js";

const SIDES = { // texts on the switches of a term
  assumed: {part: "model", setting: "assumedOff"}, actual: {part: "reality", setting: "actualOff"},
};
const NO_ARROWS = "This page draws no arrows for this term. The playground does.";
const CHALLENGED = "go2"; // the robot with challenges, as in the playground
const titles = challenges.map(({title}) => title);

// The text of a control, such as "CoM x [cm]". row: of the table of settings.
export const labelOf = ({name, symbol = "", unit = ""}) => (
  [name, symbol, unit && `[${unit}]`].filter((part) => part).join(" "));

// What the controls say about settings that differ from `first`, such as "trot, torque limits [%]
// 50". controls: as from `controlsOf`.
export function settingsText(controls, settings, first) {
  const changed = controls.filter(({shown, command}) => (
    shown && command.name !== rows.gait.name && shown(settings) !== shown(first)));
  const words = changed.map(({command: {name, choices}, shown}) => {
    const value = shown(settings);
    if (typeof value === "boolean") return `${name} ${value ? "on" : "off"}`;
    return `${name} ${choices ? choices[value] : Number(value.toPrecision(3))}`;
  });
  const {gait, speed} = settings;
  return [gait ? `${gait}, ${speed.toFixed(2)} m/s` : "standing", ...words].join(", ");
}

// The controls of a robot: [{command, change(value), shown(settings)}]; change returns messages for
// the worker: {set}, {timeScale} and others. shown returns the value for settings of the engine; it
// is null for a control of something else. push: {force, towards, duration}, changed in place.
// open: called with another robot's name. walk: called with the name of a gait, or null to stand.
// draw: called with a term of eq. (7), and whether to draw it. watch: called with the name of a
// contact point, or null.
export function controlsOf(robot, settings, push, {names, name, open, walk, draw, watch}) {
  const control = (label, command, change, shown = null) => {
    const present = shown ? {value: shown(settings)} : {};
    return {
      command: {type: "set_control", path: "", name: label, ...present, ...command}, change, shown,
    };
  };
  const ranged = (key, column, command, change, shown) => {
    const {low: min, high: max, step} = rangeOf(key, robot), {section} = rows[key];
    const label = column ? `${labelOf(rows[key])} ${column}` : labelOf(rows[key]);
    return control(label, {min, max, step, section, column, ...command}, change, shown);
  };
  const slider = (key, setting, column) => {
    const {scale = 1} = rows[key];
    return ranged(key, column, {}, (value) => ({set: {[setting]: value * scale}}),
      (now) => now[setting] / scale);
  };
  const pair = (key, model, reality) => [
    slider(key, model, "model"), slider(key, reality, "reality"),
  ];
  const choice = (key, choices, change, shown) => (
    control(labelOf(rows[key]), {choices, section: rows[key].section}, change, shown));

  // A switch shows the latest settings: those of the other terms of its side stay.
  const off = {assumedOff: settings.assumedOff, actualOff: settings.actualOff};
  const termSwitch = (term, {part, setting}, label) => control(label, {term: term.symbol, part},
    (isOn) => {
      const others = off[setting].filter((other) => other !== term.name);
      off[setting] = isOn ? others : [...others, term.name];
      return {set: {[setting]: off[setting]}};
    },
    (now) => {
      off[setting] = now[setting];
      return !now[setting].includes(term.name);
    });
  const board = terms.flatMap((term) => {
    const {is_shown: isShown = false} = term, isDrawn = term.page_arrow || isShown;
    const command = {
      term: term.symbol, part: "shown", value: isShown, disabled: !isDrawn,
      description: isDrawn ? `show ${term.arrow ?? term.name}` : `${term.arrow}. ${NO_ARROWS}`,
    };
    const switches = Object.entries(SIDES).filter(([side]) => term[`${side}_switch`])
      .map(([side, where]) => termSwitch(term, where, term[`${side}_switch`]));
    return [control(`show ${term.name}`, command, (isOn) => draw(term.name, isOn)), ...switches];
  });

  const gaits = Object.keys(robot.gaits);
  return [
    ranged("push", "", {value: push.force, on_release: true}, (value) => { push.force = value; }),
    ranged("towards", "", {value: push.towards}, (value) => { push.towards = value; }),
    ranged("duration", "", {value: push.duration}, (value) => { push.duration = value; }),
    ranged("speed", "", {value: rows.speed.first}, (value) => ({timeScale: value})),
    control(rows.robot.name, {value: names.indexOf(name), choices: names, opens_page: true},
      (value) => { open(names[value]); }),
    ...(name === CHALLENGED ? [control(rows.challenge.name,
      {value: 0, choices: ["free play", ...titles]},
      (value) => ({challenge: titles[value - 1] ?? null}))] : []),
    ...pair("friction", "mu", "actualMu"),
    ...pair("payload", "payload", "actualPayload"),
    slider("gravity", "gravity"),
    choice("leg", robot.legs.map(footName), (value) => ({set: {leg: robot.legs[value]}}),
      ({leg}) => robot.legs.indexOf(leg)),
    ...(robot.lifted.length ? [choice("lift", ["none", ...robot.lifted.map(footName)],
      (value) => ({set: {lifted: robot.lifted[value - 1] ?? null}}),
      ({lifted}) => robot.lifted.indexOf(lifted) + 1)] : []),
    slider("com_x", "forward"),
    slider("com_y", "left"),
    slider("com_z", "height"),
    ...(gaits.length ? [choice("gait", ["stand", ...gaits],
      (value) => walk(gaits[value - 1] ?? null), ({gait}) => gaits.indexOf(gait) + 1)] : []),
    choice("facets", robot.facets.map(String), (value) => (
      {set: {facets: robot.facets[value]}}), ({facets}) => robot.facets.indexOf(facets)),
    slider("torque_limits", "torque"),
    control(labelOf(rows.foot), {
      value: 0, choices: ["none", ...robot.points.map(pointName)], section: rows.foot.section,
    }, (value) => { watch(robot.points[value - 1] ?? null); }),
    ...board,
  ];
}
