// What the panel's controls decide without a document.

// The kind of the control that a command set_control asks for.
export function kindOf({value, min, choices, term}) {
  if (term) return "toggle";
  if (choices) return "choice";
  if (value === undefined) return "button";
  return min === undefined ? "checkbox" : "slider";
}

// Where a control goes: {label, key}, of a row of its section. "friction model" is the row
// "friction" in the column "model".
export function rowOf({name, column, section = ""}) {
  const label = column ? name.slice(0, name.length - column.length).trim() : name;
  return {label, key: `${section}/${label}`};
}

// Whether a key undoes the last change: Ctrl+Z, or ⌘Z on a Mac.
export const isUndo = ({key, ctrlKey, metaKey, shiftKey, altKey}) =>
  key.toLowerCase() === "z" && (ctrlKey || metaKey) && !shiftKey && !altKey;

// How many digits after the point a value has that moves by such steps.
export function digits(step) {
  return Math.max(0, Math.min(6, Math.ceil(-Math.log10(step || 1))));
}

// What a slider shows beside it. at_most: text in place of the largest value.
export function sliderText({value, max, step, at_most: atMost}) {
  return atMost && value >= max ? atMost : value.toFixed(digits(step));
}

// What this page has reported, and which of the values that come from the window are news to it:
// of its own reports that come back only the last one, for the reader may be moving the control.
export function createReports(send, me = String(Math.random())) {
  const reported = new Map();
  return {
    report(name, value) {
      reported.set(name, value);
      send({type: "control", name, value, by: me});
    },
    isNews: ({name, value, by}) => by !== me || value === reported.get(name),
  };
}
