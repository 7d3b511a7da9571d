// Predictions and exercises on a page: judged here, kept in this browser, saved as a file for
// hand_in, review and grade. Nothing is sent.

{
  const KEY = "floatbase-answers";
  const NOT_STORED = " This browser cannot store your answer.";
  const SITE = new URL("..", document.currentScript.src || location.href); // script: in a folder of it
  const {due, isAnswer, isRight, numbersIn, within} = globalThis.floatbaseRules;

  // predictions and exercises: name -> entry; recalled: name -> list of answers. An entry of
  // another form is damaged, and left out.
  const FORMS = {
    predictions: (entry) => isAnswer(entry?.said),
    exercises: (entry) => isAnswer(entry?.answer)
      && [entry.tries, entry.right].every(Number.isInteger),
    recalled: Array.isArray,
  };
  const load = () => {
    let found = null;
    try {
      found = JSON.parse(localStorage.getItem(KEY));
    } catch {
      // damaged, or not allowed
    }
    return Object.fromEntries(Object.entries(FORMS).map(([kind, isOfForm]) => [kind,
      Object.fromEntries(Object.entries(found?.[kind] ?? {}).filter(([, one]) => isOfForm(one)))]));
  };

  const store = (kind, name, entry) => {
    const kept = load();
    kept[kind][name] = kind === "recalled" ? [...kept.recalled[name] ?? [], entry] : entry;
    try {
      localStorage.setItem(KEY, JSON.stringify(kept));
      return true;
    } catch {
      return false; // a private window, or no space left
    }
  };

  const make = (tag, attributes = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), attributes);
    made.append(...children);
    return made;
  };

  const wanted = ({unit, count}) =>
    `${count === 1 ? "a number" : `${count} numbers`}${unit ? `, in ${unit}` : ""}`;

  const field = (data) => data.choices.length
    ? make("select", {name: "answer", ariaLabel: `${data.name}: choose an answer`}, make("option", {value: "", textContent: "choose …"}),
      ...data.choices.map((choice) => make("option", {value: choice, textContent: choice})))
    : make("input", {name: "answer", inputMode: "decimal", autocomplete: "off", size: 12,
      ariaLabel: `${data.name}: ${wanted(data)}`});

  // what a reader has answered: a choice, a number, a list of numbers, or null with a message
  const answerIn = (form, data, say) => {
    const text = form.elements.answer.value;
    if (data.choices.length) {
      if (!text) say("Choose an answer.");
      return text || null;
    }
    const numbers = numbersIn(text, data.count);
    if (!numbers) {
      say(`Write ${wanted(data)}, such as ${Array(data.count).fill("12.5").join(", ")}.`);
      return null;
    }
    return data.count === 1 ? numbers[0] : numbers;
  };

  const shownAnswer = (said) => [said].flat().join(", ");

  const predicted = new Set(Object.keys(load().predictions)); // also where nothing can be stored
  const openResults = () => {
    for (const details of document.querySelectorAll("details.result")) {
      details.open ||= details.dataset.names.split(" ").every((name) => predicted.has(name));
    }
  };

  const prediction = (element, data) => {
    const before = load().predictions[data.name];
    const sure = make("input", {type: "checkbox", name: "sure", checked: before?.sure ?? false});
    const message = make("output");
    const label = data.choices.length ? "" : ` (${wanted(data)})`;
    const form = make("form", {},
      make("strong", {textContent: data.name}), `, your prediction${label}: `, field(data), " ",
      make("label", {}, sure, " I am sure"), " ", make("button", {textContent: "Predict"}),
      message);
    const say = (text) => { message.textContent = ` ${text}`; };
    const show = ({said, sure: isSure}) => {
      const right = isRight(said, data.right);
      const off = right ? "right" : isSure ? "not right, and you were sure" : "not right";
      say(`You predicted ${shownAnswer(said)}: ${off}. Read on for the result.`);
    };
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const said = answerIn(form, data, say);
      if (said === null) return;
      const entry = {said, unit: data.unit, sure: sure.checked, is: data.result};
      show(entry);
      if (!store("predictions", data.name, {...entry, time: new Date().toISOString()})) {
        message.append(NOT_STORED);
      }
      predicted.add(data.name);
      openResults();
      document.dispatchEvent(new Event("answers"));
    });
    if (before) {
      form.elements.answer.value = shownAnswer(before.said);
      show(before);
    }
    element.replaceChildren(form);
  };

  const exercise = (element, data) => {
    const before = load().exercises[data.name];
    const message = make("output");
    const form = make("form", {}, make("strong", {textContent: data.name}),
      `, your answer (${wanted(data)}): `, field(data), " ",
      make("button", {textContent: "Check"}), message);
    const say = (text) => { message.textContent = ` ${text}`; };
    const judge = (answer) => {
      const found = data.cases.findIndex(({right}) => within([answer].flat(), right));
      const text = found < 0 ? data.otherwise : data.cases[found].text;
      say(`${found === 0 ? "✓ Right." : "✗ Not yet."} ${text}`);
      return found === 0;
    };
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const answer = answerIn(form, data, say);
      if (answer === null) return;
      const right = judge(answer);
      const old = load().exercises[data.name] ?? {tries: 0, right: 0};
      const entry = {
        tries: old.tries + 1, right: old.right + Number(right),
        answer: right || !old.right ? answer : old.answer,
      };
      if (!store("exercises", data.name, entry)) message.append(NOT_STORED);
      document.dispatchEvent(new Event("answers"));
    });
    if (before) {
      form.elements.answer.value = shownAnswer(before.answer);
      judge(before.answer);
    }
    element.replaceChildren(form);
  };

  const isOf = (name, lesson) => !lesson || name.split(".")[0] === lesson;

  const save = (name, form) => {
    const text = JSON.stringify({
      form, name, id: "", lesson: "", floatbase: "site", time: new Date().toISOString(), ...load(),
    }, null, 1);
    const link = make("a", {href: URL.createObjectURL(new Blob([text], {type: "application/json"})),
      download: `answers-${name.match(/[\p{L}\p{N}]+/gu)?.join("_") ?? "site"}.json`});
    link.click();
    URL.revokeObjectURL(link.href);
  };

  const review = (element, data) => {
    const name = make("input", {name: "name", autocomplete: "name", placeholder: "your name"});
    const form = make("form", {}, name, " ", make("button", {textContent: "Save my answers"}),
      " as a file for your teacher and for the live lessons. Nothing is sent.");
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      save(name.value.trim() || "reader", data.form);
    });
    const rights = new Map([...document.querySelectorAll(".answers-prediction")]
      .map((one) => JSON.parse(one.dataset.answers)).map(({name, right, shown}) =>
        [name, {right, shown}]));
    const show = () => {
      const rows = Object.entries(load().predictions)
        .filter(([name]) => isOf(name, data.lesson) && rights.has(name))
        .map(([name, {said, unit, sure}]) => {
          const {right, shown} = rights.get(name);
          const text = Array.isArray(right) ? `${shownAnswer(said)} ${unit}` : said;
          return {name, text, sure, right: isRight(said, right), shown};
        })
        .sort((a, b) => (b.sure && !b.right) - (a.sure && !a.right)
          || a.name.localeCompare(b.name));
      const cells = rows.map(({name, text, shown, right, sure}) => make("tr", {},
        ...[name, text, shown, right ? "right" : sure ? "sure" : ""].map((textContent) =>
          make("td", {textContent}))));
      const head = make("tr", {}, ...["", "you predicted", "result", ""].map((textContent) =>
        make("th", {textContent})));
      const counts = [true, false].map((sure) => rows.filter((row) => row.sure === sure))
        .map((some, i) => some.length ? `${i ? "when you were not sure" : "when you were sure"} ${
          some.filter(({right}) => right).length} of ${some.length} times` : "").filter(Boolean);
      const table = rows.length ? [make("table", {}, head, ...cells),
        make("p", {textContent: `You were right ${counts.join(" and ")}.`})]
        : [make("p", {textContent: "You have made no predictions on this page yet."})];
      element.replaceChildren(...table, form);
    };
    document.addEventListener("answers", show);
    show();
  };

  // the events of each question
  const histories = ({predictions, recalled}) => Object.fromEntries(
    Object.entries(predictions).map(([name, entry]) => [name, [entry, ...recalled[name] ?? []]]));

  // A question that is due. The answer to a first question is a prediction.
  const recallForm = (data, isFirst) => {
    const message = make("output");
    const question = make("p", {id: `recall-${data.name}`});
    question.innerHTML = `<strong>${data.name}</strong>, ${data.topic}. ${data.context}
      <strong>${data.text}</strong>`;
    const answerField = field(data);
    answerField.setAttribute("aria-describedby", question.id);
    const button = make("button", {textContent: "Answer"});
    const label = data.choices.length ? "" : ` (${wanted(data)})`;
    const form = make("form", {}, question, `Your answer${label}: `, answerField, " ", button,
      message);
    let isAnswered = false;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (isAnswered) return; // the result is shown
      const recalled = answerIn(form, data, (text) => { message.textContent = ` ${text}`; });
      if (recalled === null) return;
      const knew = isRight(recalled, data.right);
      isAnswered = true;
      button.ariaDisabled = "true"; // and it keeps the focus
      const result = make("strong", {textContent: data.shown});
      message.replaceChildren(knew ? " Right: " : " Not yet. The result is ", result, ".");
      if (!knew) {
        const lesson = `lesson ${data.lesson}`;
        const link = data.address
          ? make("a", {href: new URL(data.address, SITE).href, textContent: lesson}) : lesson;
        message.append(" Look it up in ", link, ".");
      }
      const time = new Date().toISOString();
      const isStored = isFirst
        ? store("predictions", data.name,
          {said: recalled, unit: data.unit, sure: false, is: data.result, time})
        : store("recalled", data.name, {recalled, knew, time});
      if (!isStored) message.append(NOT_STORED);
      else if (isFirst) message.append(" The question comes back here after some days.");
    });
    return form;
  };

  const recall = (element, {offersFirst}) => {
    const {rule, questions} = globalThis.floatbaseRecall;
    const known = histories(load());
    const names = due(rule, questions, known, Date.now());
    const some = Object.keys(questions).some((name) => name in known);
    const first = offersFirst && !some
      && Object.values(questions).find(({address}) => address); // its lesson is on this site
    const text = names.length ? "From earlier lessons:"
      : some ? "There is nothing to recall today."
        : first ? "No question is due yet. Here is a first one. Guess before you look it up:"
          : "Questions from earlier lessons come back here, some days after you predicted the result.";
    element.replaceChildren(make("p", {textContent: text}),
      ...names.map((name) => recallForm(questions[name], false)),
      ...first ? [recallForm(first, true)] : []);
  };

  const KINDS = {prediction, exercise, review, recall};
  for (const [kind, fill] of Object.entries(KINDS)) {
    for (const element of document.querySelectorAll(`.answers-${kind}`)) {
      fill(element, JSON.parse(element.dataset.answers));
    }
  }
  openResults();
}
