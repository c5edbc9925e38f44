// The style sheet's colours, for what is drawn. They change with the paper: light, dark, printed.

const known = new Map();
const listeners = new Set();

/** A variable of the style sheet. */
function variable(name) {
  if (!known.has(name)) {
    known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return known.get(name);
}

/** The colour of an ink. */
export const ink = variable;

/** The dashes of an ink in pixels; empty for a solid line. */
export function dashes(name) {
  // They are written for drawings with four units to a pixel.
  return (variable(`dash-${name}`) || "").split(" ").filter(Boolean).map((length) => Number(length) / 4);
}

/** How a key shows a line of an ink, or dots. */
export const keyOf = (name, isDots = false) => (isDots ? "dots" : dashes(name).length ? "dashed" : "");

/** A colour between those of the classes, slow to fast, for a part from 0 to 1. */
export function shade(part) {
  const stops = [0, 1, 2, 3, 4, 5].map((i) => variable(`class-${i}`));
  const at = Math.min(1, Math.max(0, part)) * (stops.length - 1);
  const below = Math.min(stops.length - 2, Math.floor(at));
  const channel = (colour, i) => parseInt(colour.slice(1 + 2 * i, 3 + 2 * i), 16);
  const mixed = [0, 1, 2].map((i) => {
    const [a, b] = [channel(stops[below], i), channel(stops[below + 1], i)];
    return Math.round(a + (b - a) * (at - below));
  });
  return `rgb(${mixed.join(",")})`;
}

/** Calls `listener` when colours have changed, until what it returns is called. */
export function onChange(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

function changed() {
  known.clear();
  for (const listener of listeners) listener();
}

matchMedia("(prefers-color-scheme:dark)").addEventListener("change", changed);
addEventListener("beforeprint", () => {
  document.documentElement.dataset.theme = "light";
  changed();
});
addEventListener("afterprint", () => {
  delete document.documentElement.dataset.theme;
  changed();
});
