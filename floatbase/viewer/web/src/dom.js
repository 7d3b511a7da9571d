// Short helpers for the document that every part of the page uses.

export const element = (id) => document.getElementById(id);

// A new element with these properties and children.
export function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Show a text in the middle of the page, instead of a picture or over it.
export function showNotice(text) {
  element("notice").textContent = text;
  element("notice").style.display = "block";
}

export const prefersReducedMotion = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
