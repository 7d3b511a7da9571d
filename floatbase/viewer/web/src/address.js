// Settings in the page's address, as in #facets=7&gait=trot: the controls that were moved from
// their first values. Such an address can be kept and shared.

import {kindOf, numberOf} from "./controls.js";

const DELAY = 300; // ms: browsers refuse an address that changes too often
const EXTRAS = ["view", "pushed", "motion"]; // keys that are no controls
const COMPLETE = 1000; // ms after the last new control, when all are there
const MOST = 1e4; // of a number of such a key
const MOST_SHOWN = 40; // characters of a text in a message
const SWITCHES = new Map([["on", true], ["off", false]]);

// A control that opens another page would open it again when the reader goes back.
export const isKept = (command) => (
  !command.is_hidden && !command.opens_page && kindOf(command) !== "button");

// The value of a control as a text, and back; undefined for a text that is no value.
export function textOf({choices}, value) {
  if (choices) return choices[value];
  return typeof value === "boolean" ? (value ? "on" : "off") : String(value);
}
export function valueOf(command, text) {
  const kind = kindOf(command);
  if (kind === "choice") {
    const number = command.choices.indexOf(text);
    return number < 0 ? undefined : number;
  }
  if (kind !== "slider") return SWITCHES.get(text);
  const number = numberOf(text);
  return number >= command.min && number <= command.max ? number : undefined;
}

// Why a text is no value of a control.
export function refusalOf(command, text) {
  const valid = {
    choice: () => `one of ${command.choices.join(", ")}`,
    slider: () => `a number from ${command.min} to ${command.max}`,
  }[kindOf(command)] ?? (() => "on or off");
  return `${command.name} in the address must be ${valid()}, not "${text.slice(0, MOST_SHOWN)}". ` +
    "It keeps its value.";
}

// The numbers of a key that is no control; undefined for a text that is no such list.
export function numbersOf(text, count) {
  const numbers = text.split(",").map(numberOf);
  const isValid = numbers.length === count && numbers.every((x) => Math.abs(x) <= MOST);
  return isValid ? numbers : undefined;
}

export const readHash = (hash) => new Map(new URLSearchParams(hash.replace(/^#/, "")));
export function writeHash(entries) {
  const text = String(new URLSearchParams(entries));
  return text && `#${text}`;
}

// controls: {name: {getValue, setValue}}, those of the panel. say(text): shows what was refused.
export function createAddress(controls, say) {
  const kept = new Map(); // name -> {command, first: text of the first value}
  const refused = new Map(); // name -> sentence
  const opened = readHash(location.hash); // writing the address drops what is not there yet
  const waiting = new Map(); // name -> text of a new control
  let timer = null, completed = null;
  const present = ([name, {command}]) => textOf(command, controls[name].getValue());
  function set(name, text) {
    const {command} = kept.get(name), value = valueOf(command, text);
    if (value === undefined) refused.set(name, refusalOf(command, text));
    else if (text !== present([name, {command}])) controls[name].setValue(value);
  }
  // Refuse the keys that are no controls of this page.
  function checkKeys(wanted) {
    const unknown = [...wanted.keys()]
      .filter((key) => !kept.has(key) && !EXTRAS.includes(key));
    for (const key of unknown) {
      const similar = [...kept.keys()].filter((name) => name.startsWith(key));
      refused.set(key, `There is no control "${key.slice(0, MOST_SHOWN)}" for the address. ` +
        (similar.length ? `Similar names: ${similar.join(", ")}.` : "It is ignored."));
    }
    if (unknown.length) say([...refused.values()].join(" "));
  }
  const moved = () => [...kept].filter((entry) => present(entry) !== entry[1].first)
    .map((entry) => [entry[0], present(entry)]);
  const addressWith = (extras) => (
    location.pathname + location.search + writeHash([...moved(), ...extras]));
  function write() {
    timer = null;
    const extras = [...readHash(location.hash)].filter(([key]) => EXTRAS.includes(key));
    history.replaceState(null, "", addressWith(extras));
  }
  addEventListener("hashchange", () => {
    const wanted = readHash(location.hash);
    const hadRefused = refused.size > 0;
    refused.clear();
    for (const [name, {first}] of kept) set(name, wanted.get(name) ?? first);
    if (hadRefused || refused.size > 0) say([...refused.values()].join(" "));
    checkKeys(wanted);
  });
  return {
    // A control is new, or was added again. Its value follows with `apply`, because the window may
    // send the present one first.
    added(command) {
      const {name} = command;
      if (!isKept(command) || kept.has(name)) return;
      kept.set(name, {command, first: present([name, {command}])});
      clearTimeout(completed);
      completed = setTimeout(() => checkKeys(opened), COMPLETE);
      if (opened.has(name)) waiting.set(name, opened.get(name));
    },
    apply() {
      for (const [name, text] of waiting) {
        set(name, text);
        if (refused.has(name)) say([...refused.values()].join(" "));
      }
      waiting.clear();
    },
    changed() { timer ??= setTimeout(write, DELAY); },
    // The part after # that another robot understands: without the top of the panel and the view.
    settings: () => writeHash(moved().filter(([name]) => {
      const {section, term} = kept.get(name).command;
      return section || term;
    })),
    // `count` numbers of a key that is no control, or undefined.
    numbers(key, count) {
      const text = readHash(location.hash).get(key);
      if (text === undefined) return undefined;
      const numbers = numbersOf(text, count);
      if (!numbers) {
        refused.set(key, `${key} in the address must be ${count} numbers with commas between ` +
          `them, each at most ${MOST}, not "${text.slice(0, MOST_SHOWN)}". It is ignored.`);
        say([...refused.values()].join(" "));
      }
      return numbers;
    },
    // An address that opens the same. extras: {key: numbers}, undefined for none.
    link(extras) {
      const texts = Object.entries(extras).filter(([, numbers]) => numbers)
        .map(([key, numbers]) => [key, numbers.map((x) => Number(x.toFixed(4))).join()]);
      return location.origin + addressWith(texts);
    },
  };
}
