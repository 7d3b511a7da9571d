// The attributes of a live robot, which are in the address of its page: ?key=value&….

import {refusalText} from "../engine/settings.js";

// read(key, rule, parse) returns a value that follows its rule (engine/settings.js), and undefined
// for any other or none. `refused` has a sentence about each value that breaks its rule.
export function readAddress(search) {
  const texts = new URLSearchParams(search), refused = [];
  return {
    texts, refused,
    read(key, rule, parse = (text) => text) {
      const text = texts.get(key);
      if (!text) return undefined;
      if (rule.fits(parse(text))) return parse(text);
      refused.push(`${refusalText(key, text, rule.words)} It counts as not given.`);
      return undefined;
    },
  };
}
