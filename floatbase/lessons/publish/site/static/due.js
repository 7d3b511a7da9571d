// Which answers are right, and which questions of earlier lessons are due: the rules of
// floatbase.lessons.predictions and floatbase.lessons.recalling. A test compares the two.

{
  const HOUR = 3600e3; // ms
  const ROUNDING = 1e-6;

  const within = (numbers, intervals) => numbers.length === intervals.length
    && numbers.every((x, i) => x >= intervals[i][0] - ROUNDING && x <= intervals[i][1] + ROUNDING);

  const isRight = (said, right) => typeof said === "string" || typeof right === "string"
    ? String(said).toLowerCase() === String(right).toLowerCase()
    : within([said].flat(), right);

  // hours for which a question rests after an answer, from the pause before it
  const nextPause = (event, pause, right, rule) => {
    let knew = event.knew === true;
    if (!("recalled" in event)) {
      if (!("said" in event)) return pause;
      knew = isRight(event.said, right);
    }
    if (knew) return Math.max(rule.first, rule.growth * pause);
    return event.sure ? rule.sureAndMissed : rule.missed;
  };

  const timeOf = ({time}) => typeof time === "string" ? Date.parse(time) : NaN;

  // Imported answers may be later in the list than in time.
  const inOrder = (events) => {
    let last = 0;
    const timed = events.map((event) => {
      const time = timeOf(event);
      if (Number.isFinite(time)) last = time;
      return [last, event];
    });
    return timed.sort(([a], [b]) => a - b).map(([, event]) => event);
  };

  // names of the questions that are due, the most overdue first, from different lessons if possible
  // questions: name -> {right, …}; history: name -> events; now: in ms
  const due = (rule, questions, history, now) => {
    const overdue = new Map();
    for (const [name, {right}] of Object.entries(questions)) {
      const events = history[name] ?? [];
      if (!["said", "is"].every((key) => events.some((event) => key in event))) continue;
      let [pause, last] = [rule.missed, now - rule.old * HOUR];
      for (const event of inOrder(events)) {
        pause = nextPause(event, pause, right, rule);
        const time = timeOf(event);
        if (Number.isFinite(time)) last = time;
      }
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

  globalThis.floatbaseRules = {due, isRight, within};
}
