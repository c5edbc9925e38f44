// The figures of a page: each is drawn where an element has its number.

import { inflate } from "page/data.js";
import { Plane, Polar } from "page/flat.js";
import { Stack } from "page/stack.js";

const KINDS = { stack: Stack, polar: Polar, plane: Plane };

/** Draws a figure into an element. */
export function drawFigure(element, figure) {
  return new KINDS[figure.kind](element, figure);
}

/** Draws the figures that are embedded in the page; those drawn. */
export async function drawEmbedded() {
  const script = document.getElementById("figures");
  if (!script) return [];
  const figures = JSON.parse(new TextDecoder().decode(await inflate(script.textContent)));
  // Their text is as long as the page.
  script.remove();
  return figures.map((figure, i) => drawFigure(document.querySelector(`[data-figure="${i}"]`), figure));
}
