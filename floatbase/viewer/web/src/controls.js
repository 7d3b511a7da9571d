// Logic of the panel's controls that needs no document.

// The kind of control that a command set_control requests.
export function kindOf({value, min, choices, term}) {
  if (term) return "toggle";
  if (choices) return "choice";
  if (value === undefined) return "button";
  return min === undefined ? "checkbox" : "slider";
}

// Where a control belongs: {label, key} of a row in its section. "friction model" is in the row
// "friction" and in the column "model".
export function rowOf({name, column, section = ""}) {
  const label = column ? name.slice(0, name.length - column.length).trim() : name;
  return {label, key: `${section}/${label}`};
}

// Whether a key undoes the last change: Ctrl+Z, or ⌘Z on a Mac.
export const isUndo = ({key, ctrlKey, metaKey, shiftKey, altKey}) =>
  key.toLowerCase() === "z" && (ctrlKey || metaKey) && !shiftKey && !altKey;

// The number that a text of an address or an attribute means, or NaN.
export const numberOf = (text) =>
  /^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?$/i.test(text.trim()) ? Number(text) : NaN;

// Number of decimals of a value that changes in such steps.
export function digits(step) {
  return Math.max(0, Math.min(6, Math.ceil(-Math.log10(step || 1))));
}

// Text beside a slider. at_most: text instead of the largest value.
export function sliderText({value, max, step, at_most: atMost}) {
  return atMost && value >= max ? atMost : value.toFixed(digits(step));
}

// What this page has reported, and which values from the window are news to it: of its own reports
// that return, only the last one, because the reader may still be moving the control.
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
