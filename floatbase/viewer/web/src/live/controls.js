// Controls of a live robot: commands for the viewer's panel, and what each of them changes.

import {footName} from "./words.js";

const SPEEDS = [1, 0.5, 0.25, 0.1];
const slider = (value, min, max, step, more = {}) => ({value, min, max, step, ...more});

// The controls of a robot, by name: {command, change(value)}; change returns messages for the
// worker: {set}, {timeScale} and others. push: {force, towards, duration}, changed in place. open:
// called with another robot's name. walk: called with the name of a gait, or null to stand.
export function controlsOf(robot, settings, push, {names, name, open, walk}) {
  const set = (key, factor = null) => (value) => (
    {set: {[key]: factor === null ? value : value * factor}});
  const {weight} = robot, heaviest = Math.max(1, Math.round(weight / 9.81 * 0.4));
  const most = 5 * Math.ceil(2.5 * weight / 5);
  const choices = Object.keys(robot.gaits);
  const gaits = choices.length ? {gait: [{
    value: choices.indexOf(settings.gait) + 1, choices: ["stand", ...choices],
  }, (value) => walk(choices[value - 1] ?? null)]} : {};
  const term = (key, value, column) => [
    {value, ...pair("terms of eq. (7)", column)}, set(key),
  ];
  const feet = [...new Set(robot.points.map(footName))];
  const terms = {
    "gravity model": term("hasGravity", settings.hasGravity, "model"),
    "gravity reality": term("actualHasGravity", settings.actualHasGravity, "reality"),
    "Coriolis model": term("hasCoriolis", settings.hasCoriolis, "model"),
    "Coriolis reality": term("actualHasCoriolis", settings.actualHasCoriolis, "reality"),
    "foot without ground": [{
      value: 0, choices: ["none", ...feet], section: "terms of eq. (7)",
    }, (value) => ({set: {
      missing: robot.points.filter((name) => footName(name) === feet[value - 1]),
    }})],
  };
  const all = {
    "push [N]": [slider(push.force, 0, most, 5), (value) => { push.force = value; }],
    "towards [°]": [slider(push.towards, -180, 180, 15), (value) => { push.towards = value; }],
    "duration [s]": [slider(push.duration, 0.05, 0.5, 0.05), (value) => {
      push.duration = value;
    }],
    speed: [{value: 0, choices: SPEEDS.map((x) => `${x} ×`)}, (value) => (
      {timeScale: SPEEDS[value]})],
    robot: [{value: names.indexOf(name), choices: names}, (value) => { open(names[value]); }],
    ...gaits,
    "friction model": [slider(settings.mu, 0.05, 1.2, 0.05, pair("ground and load")),
      set("mu")],
    "friction reality": [slider(settings.actualMu, 0.05, 1.2, 0.05,
      pair("ground and load", "reality")), set("actualMu")],
    "payload [kg] model": [slider(settings.payload, 0, heaviest, heaviest / 20,
      pair("ground and load")), set("payload")],
    "payload [kg] reality": [slider(settings.actualPayload, 0, heaviest, heaviest / 20,
      pair("ground and load", "reality")), set("actualPayload")],
    "gravity [m/s²]": [slider(settings.gravity, 0.5, 20, 0.1, {section: "gravity and motors"}),
      set("gravity")],
    ...terms,
    "torque limits [%]": [slider(100, 10, 100, 1, {section: "gravity and motors"}),
      set("torque", 0.01)],
    "higher [cm]": [slider(0, -8, 3, 0.5, {section: "where it stands"}), set("height", 0.01)],
    "forward [cm]": [slider(0, -10, 10, 0.5, {section: "where it stands"}),
      set("forward", 0.01)],
    "left [cm]": [slider(0, -8, 8, 0.5, {section: "where it stands"}), set("left", 0.01)],
    "facets of each cone": [{value: 0, choices: robot.facets.map(String),
      section: "constraints"}, (value) => ({set: {facets: robot.facets[value]}})],
  };
  if (robot.lifted.length) {
    all["foot in the air"] = [{
      value: 0, choices: ["none", ...robot.lifted.map(footName)], section: "where it stands",
    }, (value) => ({set: {lifted: robot.lifted[value - 1] ?? null}})];
  }
  return Object.entries(all).map(([key, [command, change]]) => (
    {command: {type: "set_control", path: "", name: key, ...command}, change}));
}

const pair = (section, column = "model") => ({section, column});
