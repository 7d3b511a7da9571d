// Which texts are numbers, which answers are right, and which questions of earlier lessons are due:
// the rules of floatbase.lessons.predictions and floatbase.lessons.recalling. Tests compare them.

{
  const HOUR = 3600e3; // ms
  const ROUNDING = 1e-6;
  const LARGEST = 1e30;
  const NUMBER = /^[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?$/;
  const PRINTABLE = /^(?:[^\p{C}\p{Z}]| )*$/u; // as str.isprintable

  // the numbers in a text such as "12.5", "3, 4" or "[3 4]", or null if it is no such list
  const numbersIn = (text, count) => {
    const trim = (some) => some.replace(/^ +| +$/g, "");
    const whole = trim(text.replace(/[−–]/g, "-").replace(/[\t\u00a0]/g, " "));
    const isBracketed = /^(?:\[.*\]|\(.*\))$/.test(whole);
    const parts = trim(isBracketed ? whole.slice(1, -1) : whole).split(/ *[,;] *| +/);
    const numbers = parts.map((part) => NUMBER.test(part) ? Number(part) : NaN);
    return numbers.length === count && numbers.every(isUsable) ? numbers : null;
  };

  const isUsable = (x) => typeof x === "number" && Math.abs(x) <= LARGEST;

  // whether a value can be an answer: a number, a list of numbers, or a text
  const isAnswer = (value) => typeof value === "string" ? PRINTABLE.test(value)
    : [value].flat().length > 0 && [value].flat().every(isUsable);

  const within = (numbers, intervals) => numbers.length === intervals.length
    && numbers.every((x, i) => x >= intervals[i][0] - ROUNDING && x <= intervals[i][1] + ROUNDING);

  const isRight = (said, right) => typeof said === "string" || typeof right === "string"
    ? String(said).toLowerCase() === String(right).toLowerCase()
    : within([said].flat(), right);

  // whether a stored result can be one of this question
  const fits = (result, {choices, count}) => {
    if (choices.length || !isAnswer(result) || typeof result === "string") {
      return choices.includes(result);
    }
    return [result].flat().length === count;
  };

  // hours for which a question rests after an answer, from the pause before it
  const nextPause = (knew, event, pause, rule) => {
    if (knew) return Math.min(rule.longest, Math.max(rule.first, rule.growth * pause));
    return event.sure === true ? rule.sureAndMissed : rule.missed;
  };

  // ms, or NaN: a day such as 30 February would become another one
  const timeOf = ({time}, rule) => {
    const [, local] = typeof time === "string" && new RegExp(`^${rule.time}$`).exec(time) || [];
    const day = new Date(`${local}Z`);
    if (Number.isNaN(day.getTime())) return NaN;
    return day.toISOString().startsWith(local) ? Date.parse(time) : NaN;
  };

  // Events with their times, sorted by time: imported ones may be later in the list than in time.
  // An event without a time has that of the event before it. One in the future has none: its clock
  // was wrong.
  const inOrder = (events, rule, now) => {
    const times = events.map((event) => timeOf(event, rule))
      .map((time) => time <= now ? time : NaN);
    let last = Math.min(now - rule.old * HOUR, ...times.filter(Number.isFinite));
    const timed = events.map((event, i) => {
      if (Number.isFinite(times[i])) last = times[i];
      return {time: last, event};
    });
    return timed.sort((a, b) => a.time - b.time);
  };

  // When the last answer that counts was given, in ms, and for how many hours the question then
  // rests. Until the result is shown, the last prediction counts. After that, only an answer to a
  // question that is due counts.
  const lastAnswer = (events, right, rule, now) => {
    let [last, pause, isShown] = [null, rule.missed, false];
    for (const {time, event} of inOrder(events, rule, now)) {
      let knew = null;
      if (isAnswer(event.recalled)) [knew, isShown] = [event.knew === true, true];
      else if (isAnswer(event.said)) knew = isRight(event.said, right);
      const isDue = last === null || time - last >= pause * HOUR;
      if (knew !== null && (isDue || !isShown)) {
        pause = nextPause(knew, event, isShown ? pause : rule.missed, rule);
        last = time;
      }
      isShown ||= isAnswer(event.is);
    }
    return {last: last ?? now - rule.old * HOUR, pause};
  };

  // the events with something that can be an answer
  const usable = (events) => events.filter((event) => event instanceof Object
    && [event.said, event.is, event.recalled].some(isAnswer));

  // names of the questions that are due, the most overdue first, from different lessons if possible
  // questions: name -> {right, …}; history: name -> events; now: in ms
  const due = (rule, questions, history, now) => {
    const overdue = new Map();
    for (const [name, question] of Object.entries(questions)) {
      const events = usable(Object.hasOwn(history, name) ? history[name] : []);
      const result = events.map((event) => event.is).filter(isAnswer).at(-1);
      if (!fits(result, question) || !events.some(({said}) => isAnswer(said))) continue;
      const {last, pause} = lastAnswer(events, question.right, rule, now);
      const ratio = (now - last) / (pause * HOUR);
      if (ratio >= 1) overdue.set(name, ratio);
    }
    const ordered = [...overdue.keys()]
      .sort((a, b) => overdue.get(b) - overdue.get(a) || (a < b ? -1 : 1));
    const lesson = (name) => name.split(".")[0];
    const isFirst = (name) => ordered.find((other) => lesson(other) === lesson(name)) === name;
    const mixed = ordered.filter(isFirst); // one per lesson
    const others = ordered.filter((name) => !isFirst(name));
    return [...mixed, ...others].slice(0, rule.perDay);
  };

  globalThis.floatbaseRules = {due, isAnswer, isRight, numbersIn, within};
}
