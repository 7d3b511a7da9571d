// What "undo" restores: the settings before each change. Changes of the same settings in quick
// succession, as while a slider moves, are one change.

const SAME_CHANGE = 1000; // ms between two changes that count as one
const MOST = 100; // changes that are remembered

export function createHistory() {
  let former = [], last = {names: "", time: -Infinity};
  return {
    // Remember the settings before a change. now: ms.
    remember(settings, changes, now) {
      const names = Object.keys(changes).sort().join();
      if (names !== last.names || now - last.time > SAME_CHANGE) {
        former = [...former, settings].slice(-MOST);
      }
      last = {names, time: now};
    },
    // The settings before the last change that differ from the present ones, or null.
    undo(present) {
      last = {names: "", time: -Infinity};
      while (former.length) {
        const before = former.pop();
        if (JSON.stringify(before) !== JSON.stringify(present)) return before;
      }
      return null;
    },
    clear() {
      former = [];
      last = {names: "", time: -Infinity};
    },
  };
}
