// Elements of the page.

/** An element with attributes and children. */
export function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** A button that does something. */
export function button(text, label, act) {
  const made = make("button", { type: "button", ...(label && { "aria-label": label }) }, text);
  made.addEventListener("click", act);
  return made;
}

/** Says what cannot be shown. */
export function complain(words) {
  const problem = document.getElementById("problem");
  problem.hidden = false;
  problem.textContent = words;
}
