// The panel beside the picture: controls in sections, a table of pairs, the terms of an equation,
// texts, and a plot. Every control reports to the window by its name.

import {createReports, isUndo, kindOf, rowOf, sliderText} from "./controls.js";
import {element, make} from "./dom.js";
import {FORCE} from "./drag.js";
import {createPlot} from "./plot.js";

const COLUMNS = ["", "model", "reality"];
const WHOLE_EQUATION = "Left: inertia and weight. Right: motors and forces at the feet. " +
  "Press a term.";
const COPIED_FOR = 2000; // ms

// send(message): sends a message to the window.
export function createPanel(send) {
  const {report, isNews} = createReports(send);
  const root = element("panel"), foldButton = element("fold"), sections = new Map();
  const controls = Object.create(null); // without predefined names, not even "constructor"
  function fold(isFolded) {
    document.body.classList.toggle("folded-panel", isFolded);
    foldButton.setAttribute("aria-expanded", !isFolded);
  }
  foldButton.onclick = () => fold(!document.body.classList.contains("folded-panel"));

  const head = make("div", {className: "head"}); // stays visible when the panel is scrolled
  root.append(head);

  addEventListener("keydown", (event) => {
    if (!controls.undo || !isUndo(event)) return;
    event.preventDefault();
    controls.undo.fire();
  });

  function section(name = "") {
    if (!sections.has(name)) {
      const made = name ? make("details", {}, make("summary", {textContent: name})) : make("div");
      sections.set(name, made);
      root.append(made);
      document.body.classList.add("has-panel");
    }
    return sections.get(name);
  }
  const findLine = (place, key) => [...place.children].find(({dataset}) => dataset.key === key);

  // The element that a row's controls go into; rows with columns are lines of a table.
  function row(command) {
    const {label, key} = rowOf(command), place = section(command.section);
    let line = findLine(place, key);
    if (!line) {
      if (command.column && !place.querySelector(".columns")) {
        const heads = COLUMNS.map((text) => make("span", {textContent: text}));
        place.append(make("div", {className: "row pair columns"}, ...heads));
      }
      const title = make("span", {textContent: label, title: label});
      line = make("div", {className: command.column ? "row pair" : "row"}, title);
      line.dataset.key = key;
      place.append(line);
    }
    return line;
  }

  function slider(command) {
    const {name, at_most, on_release: waits} = command;
    const input = make("input", {type: "range"}), shown = make("output");
    const show = (now) => {
      input.value = now;
      const [value, max, step] = [input.value, input.max, input.step].map(Number);
      shown.textContent = sliderText({value, max, step, at_most});
      if (at_most) input.setAttribute("aria-valuetext", shown.textContent);
    };
    const remake = ({value, min, max, step}) => {
      Object.assign(input, {min, max, step}).dataset.home = value;
      show(value);
    };
    const setValue = (now) => {
      show(now);
      report(name, Number(input.value));
    };
    input.setAttribute("aria-label", name);
    remake(command);
    // Letting go of "push [N]" presses the button "push".
    const release = (now) => {
      setValue(now);
      if (name === FORCE && Number(now) > 0) controls.push?.fire?.();
    };
    input.oninput = () => waits ? show(input.value) : setValue(input.value);
    if (waits) input.onchange = () => release(input.value);
    input.ondblclick = () => setValue(input.dataset.home);
    if (!command.is_hidden) row(command).append(input, shown);
    return {
      getValue: () => Number(input.value), getMax: () => Number(input.max), show, setValue, release,
      remake,
    };
  }
  function checkbox(command) {
    const {name, value} = command;
    const input = make("input", {type: "checkbox", checked: value});
    input.onchange = () => report(name, input.checked);
    return labelled(input, command, () => input.checked, (now) => { input.checked = now; });
  }
  function choice(command) {
    const {name, value, choices} = command;
    const input = make("select", {}, ...choices.map((text, i) => new Option(text, i)));
    input.value = value;
    input.onchange = () => report(name, Number(input.value));
    return labelled(input, command, () => Number(input.value), (now) => { input.value = now; });
  }
  function labelled(input, command, getValue, show) {
    input.setAttribute("aria-label", command.name);
    row(command).append(input);
    const setValue = (now) => {
      show(now);
      report(command.name, now);
    };
    return {getValue, show, setValue};
  }
  function button({name, section: where}) {
    const made = make("button", {type: "button", textContent: name});
    const press = () => report(name, null);
    made.onclick = press;
    if (name === "undo") made.title = "key: Ctrl+Z";
    const place = where ? section(where) : (section(), head), last = place.lastElementChild;
    const line = last?.classList.contains("buttons") ? last : make("div", {className: "buttons"});
    line.append(made);
    place.append(line);
    return {getValue: () => press, show() {}, fire: () => made.click()};
  }

  // what the term under the pointer means, for those who see no titles: on a phone, or in a lecture
  const explanation = make("p", {ariaHidden: true, textContent: WHOLE_EQUATION});

  // A term of an equation, above the picture: its symbol shows its arrows, the two boxes switch it
  // off in the controller's model and in the simulated world.
  function toggle({name, value: first, term, part, description = name, disabled = false}) {
    const board = element("board");
    let cell = [...board.children].find(({dataset}) => dataset.term === term);
    if (!cell) {
      cell = make("div");
      cell.dataset.term = term;
      board.append(cell, explanation);
      document.body.classList.add("has-board");
    }
    let value = first;
    const made = make("button", {
      type: "button", className: part, textContent: part === "shown" ? term : part,
      title: description,
    });
    const show = (now) => {
      made.setAttribute("aria-pressed", now);
      value = now;
    };
    const setValue = (now) => {
      show(now);
      report(name, now);
    };
    const label = part === "shown" ? `${term}: ${description}` : description;
    made.setAttribute("aria-label", label); // with the text that the button shows
    made.setAttribute("aria-disabled", disabled); // it keeps its title and the keyboard's focus
    show(value);
    const explain = () => {
      const state = part === "shown" ? "" : value ? ": on" : ": off";
      explanation.textContent = label + state;
    };
    made.onclick = () => {
      if (!disabled) setValue(!value);
      explain();
    };
    made.onblur = () => { explanation.textContent = WHOLE_EQUATION; };
    made.onpointerleave = ({pointerType}) => { // a finger leaves after each tap
      if (pointerType === "mouse") made.onblur();
    };
    made.onpointerenter = made.onfocus = explain;
    cell.append(made);
    return {getValue: () => value, show, setValue};
  }
  const kinds = {slider, checkbox, choice, button, toggle};

  return {
    controls,
    fold,
    addControl(command) {
      const old = controls[command.name]; // exists when a cell is run again
      if (!old) controls[command.name] = kinds[kindOf(command)](command);
      else if (old.remake) old.remake(command);
      else old.show(command.value);
    },
    setValue(command) {
      if (isNews(command)) controls[command.name]?.show(command.value);
    },
    setText({name, text, section: where, code}) {
      const place = section(where), key = `text/${name}`;
      let line = findLine(place, key);
      if (!line) {
        line = make(code ? "pre" : "p");
        line.dataset.key = key;
        if (!code) line.setAttribute("aria-live", "polite");
        place.append(line);
        if (code) place.append(copyButton(line));
      }
      if (line.textContent !== text) line.textContent = text;
    },
    addPoint: createPlot((...elements) => section().append(...elements)),
  };
}

function copyButton(source) {
  const made = make("button", {type: "button", textContent: "copy", className: "copy"});
  made.onclick = async () => {
    try {
      await navigator.clipboard.writeText(source.textContent);
      made.textContent = "copied";
    } catch { // a page in a frame may not write to the clipboard: select the text, for Ctrl-C
      getSelection().selectAllChildren(source);
      made.textContent = "selected: press Ctrl-C";
    }
    setTimeout(() => { made.textContent = "copy"; }, COPIED_FOR);
  };
  return made;
}
