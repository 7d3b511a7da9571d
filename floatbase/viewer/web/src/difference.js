// A scene of the site is a map from number of key to number of command; keys are [path, type].
// Slider samples are precomputed: each is a list of the differences from the first scene.

const GONE = -1;
// of the commands of a difference; others, such as the camera, come between
const ORDER = {set_object: 1, set_transform: 2, set_property: 3, set_animation: 5};

// A scene with changes [key, command, key, command, …] applied to it.
export function over(scene, changes) {
  const made = new Map(scene);
  for (let i = 0; i < changes.length; i += 2) {
    if (changes[i + 1] === GONE) made.delete(changes[i]);
    else made.set(changes[i], changes[i + 1]);
  }
  return made;
}

// What leads from one scene to another: whether an animation ends, the paths that are deleted, and
// which commands follow, in order. An item whose colour cannot be reset by a command, or whose
// shape changes, is drawn again.
export function difference(now, goal, keys) {
  const inPicture = (key) => keys[key][0].startsWith("/meshcat/");
  const animation = (scene) => [...scene].find(([key]) => keys[key][1] === "set_animation")?.[1];
  const ended = animation(now) !== undefined && animation(now) !== animation(goal);
  const gone = new Set(
    [...now.keys()].filter((key) => inPicture(key) && !goal.has(key)).map((key) => keys[key][0]),
  );
  const isBelowGone = (path) =>
    [...gone].some((one) => path === one || path.startsWith(`${one}/`));
  const isNew = (key, command) => now.get(key) !== command;
  const redrawn = new Set(
    [...goal].filter(([key, command]) => keys[key][1] === "set_object" && isNew(key, command))
      .map(([key]) => keys[key][0]),
  );
  const changed = [...goal].filter(([key, command]) => {
    const [path, type] = keys[key];
    return isNew(key, command) || (inPicture(key) && isBelowGone(path))
      || (type === "set_property" && redrawn.has(path));
  });
  const order = ([key]) => ORDER[keys[key][1]] ?? 4;
  const commands = changed.sort((a, b) => order(a) - order(b)).map(([, command]) => command);
  return {ended, gone: [...gone], commands};
}
