// The panel beside the picture: controls in sections, a table of pairs, the terms of an equation, texts, and a live strip.
// Every control reports to the window by its name; "friction believed" is the row "friction" in the column "believed".

const HISTORY = 8;  // s that the strip shows

function startPanel(viewer) {
  const me = String(Math.random()), reported = new Map(), root = part("panel"), sections = new Map();
  const controls = viewer.gui_controllers = Object.create(null);  // in it no name has a meaning, not even "constructor"
  const report = (name, value) => {
    reported.set(name, value);
    viewer.connection?.send(JSON.stringify({type: "control", name, value, by: me}));
  };
  part("fold").onclick = () => {
    const closed = document.body.classList.toggle("folded-panel");
    part("fold").setAttribute("aria-expanded", !closed);
    viewer.set_dirty();
  };

  const isBelow = () => root.offsetWidth >= innerWidth;
  function section(name) {
    if (!sections.has(name)) {
      const made = document.createElement(name ? "details" : "div");
      if (name) {
        const head = document.createElement("summary");
        head.textContent = name;
        made.append(head);
      }
      sections.set(name, made);
      root.append(made);
      document.body.classList.add("has-panel");
    }
    return sections.get(name);
  }

  // The element that a row's controls go into; rows with columns are lines of a table.
  function row(command) {
    const {name, column, section: where = ""} = command;
    const label = column ? name.slice(0, name.length - column.length).trim() : name;
    const key = `${where}/${column ? label : name}`;
    let line = [...section(where).children].find((one) => one.dataset.key == key);
    if (!line) {
      line = document.createElement("div");
      line.className = column ? "row pair" : "row";
      line.dataset.key = key;
      const title = document.createElement("span");
      title.textContent = label;
      title.title = label;
      if (column && !section(where).querySelector(".columns")) section(where).append(columns());
      line.append(title);
      section(where).append(line);
    }
    return line;
  }
  function columns() {
    const head = document.createElement("div");
    head.className = "row pair columns";
    head.append(...["", "believed", "true"].map((text) => Object.assign(document.createElement("span"), {textContent: text})));
    return head;
  }

  const digits = (step) => Math.max(0, Math.min(6, Math.ceil(-Math.log10(step || 1))));
  function slider({name, ...given}, line) {
    const input = Object.assign(document.createElement("input"), {type: "range"}), shown = document.createElement("output");
    const say = () => {
      const words = given.at_most && Number(input.value) >= Number(input.max) ? given.at_most : "";
      shown.textContent = words || Number(input.value).toFixed(digits(input.step));
      if (given.at_most) input.setAttribute("aria-valuetext", shown.textContent);
    };
    const set = (now) => { input.value = now; say(); };
    const remake = ({value, min, max, step}) => { Object.assign(input, {min, max, step}).dataset.home = value; set(value); };
    input.setAttribute("aria-label", name);
    remake(given);
    const change = (now) => { set(now); report(name, Number(input.value)); };
    input.oninput = () => change(input.value);
    input.ondblclick = () => change(input.dataset.home);
    line.append(input, shown);
    return {getValue: () => Number(input.value), show: set, setValue: change, remake};
  }
  function checkbox({name, value}, line) {
    const input = Object.assign(document.createElement("input"), {type: "checkbox", checked: value});
    input.setAttribute("aria-label", name);
    input.onchange = () => report(name, input.checked);
    line.append(input);
    return {getValue: () => input.checked, show: (now) => { input.checked = now; },
            setValue: (now) => { input.checked = now; report(name, now); }};
  }
  function choice({name, value, choices}, line) {
    const input = document.createElement("select");
    input.append(...choices.map((text, i) => new Option(text, i)));
    input.value = value;
    input.setAttribute("aria-label", name);
    input.onchange = () => report(name, Number(input.value));
    line.append(input);
    return {getValue: () => Number(input.value), show: (now) => { input.value = now; },
            setValue: (now) => { input.value = now; report(name, now); }};
  }
  function button({name, section: where = ""}) {
    const made = Object.assign(document.createElement("button"), {type: "button", textContent: name});
    made.onclick = () => report(name, null);
    const last = section(where).lastElementChild;
    const line = last?.classList.contains("buttons") ? last : document.createElement("div");
    line.className = "buttons";
    line.append(made);
    section(where).append(line);
    return {element: made, getValue: () => () => report(name, null), show() {}, fire: () => made.click()};
  }

  // A term of an equation over the picture: its symbol shows its arrows, the two boxes switch it off in belief and world.
  function toggle({name, value, term: symbol, part: which}) {
    const board = part("board");
    let cell = [...board.children].find((one) => one.dataset.term == symbol);
    if (!cell) {
      cell = document.createElement("div");
      cell.dataset.term = symbol;
      board.append(cell);
    }
    const made = Object.assign(document.createElement("button"), {type: "button"});
    const set = (now) => { made.setAttribute("aria-pressed", now); value = now; };
    made.className = which;
    made.textContent = which == "shown" ? symbol : which;
    made.title = name;
    made.setAttribute("aria-label", name);
    set(value);
    const change = (now) => { set(now); report(name, now); };
    made.onclick = () => change(!value);
    cell.append(made);
    return {element: made, getValue: () => value, show: set, setValue: change};
  }

  return {
    // what it takes of the picture: on a phone it lies below, else at the right
    width: () => isBelow() ? 0 : root.offsetWidth,
    height: () => isBelow() ? root.offsetHeight : 0,
    add(command) {
      const {name, value, min, choices, term: symbol} = command;
      const old = controls[name];
      if (old) return (old.remake || old.show)(old.remake ? command : value);  // as a cell that is run again does
      const kind = symbol ? toggle : choices ? choice : value === undefined ? button : min === undefined ? checkbox : slider;
      controls[name] = kind(command, kind == toggle || kind == button ? null : row(command));
      if (symbol) document.body.classList.add("has-board");
    },
    move({name, value, by}) {
      // of this page's own reports that come back only the last one is news: the reader may be moving the control
      if (!controls[name] || (by == me && value !== reported.get(name))) return;
      controls[name].show(value);
    },
    text({name, text, section: where = "", code}) {
      let line = [...section(where).children].find((one) => one.dataset.key == `text/${name}`);
      if (!line) {
        line = document.createElement(code ? "pre" : "p");
        line.dataset.key = `text/${name}`;
        if (!code) line.setAttribute("aria-live", "polite");
        section(where).append(line);
        if (code) section(where).append(copying(line));
      }
      if (line.textContent != text) line.textContent = text;
    },
    plot: startPlot(section),
  };
}

function copying(source) {
  const made = Object.assign(document.createElement("button"), {type: "button", textContent: "copy"});
  made.className = "copy";
  made.onclick = async () => {
    try {
      await navigator.clipboard.writeText(source.textContent);
      made.textContent = "copied";
    } catch (error) {  // a page in a frame may not write: select it, for Ctrl-C
      getSelection().selectAllChildren(source);
      made.textContent = "selected: press Ctrl-C";
    }
    setTimeout(() => { made.textContent = "copy"; }, 2000);
  };
  return made;
}

// The last seconds of a number, as a line.
function startPlot(section) {
  let points = [], canvas = null, label = null;
  return ({name, t, value, unit}) => {
    if (!canvas) {
      canvas = Object.assign(document.createElement("canvas"), {width: 560, height: 110, className: "plot"});
      label = document.createElement("p");
      label.className = "plot";
      section("").prepend(label, canvas);
    }
    if (points.length && t < points.at(-1)[0]) points = [];
    points.push([t, value]);
    points = points.filter(([when]) => when > t - HISTORY);
    const peak = Math.max(...points.map(([, y]) => y)), most = Math.max(1, peak) * 1.1, {width: w, height: h} = canvas, draw = canvas.getContext("2d");
    draw.clearRect(0, 0, w, h);
    draw.strokeStyle = getComputedStyle(canvas).color;
    draw.lineWidth = 3;
    draw.beginPath();
    for (const [when, y] of points) draw.lineTo(w * (1 - (t - when) / HISTORY), h - 4 - (h - 8) * y / most);
    draw.stroke();
    const said = (x) => x < 0.05 ? "0" : x < 10 ? x.toFixed(1) : x.toFixed(0);
    label.textContent = `${name}: ${said(value)} ${unit} (up to ${said(peak)} in ${HISTORY} s)`;
    canvas.setAttribute("aria-label", label.textContent);
  };
}
