// What pointers and wheel do to a drawing: point at a place, move the drawing, zoom it.
//
// A press or a hovering mouse points; with shift or the middle button a drag moves; two fingers and the wheel zoom.

import { wheelFactor } from "page/span.js";

/** Time after a scroll of the page in which the wheel goes on scrolling it [ms]. */
const SCROLL_GOES_ON_MS = 350;
let scrolledAt = -Infinity;

/** The place of an event, from an element's upper left corner [px]. */
export function placeIn(element, event) {
  const box = element.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

/** The middle of all fingers, a map to their places, and how far apart the first two are. */
export function grip(fingers) {
  const places = [...fingers.values()];
  const mean = (way) => places.reduce((sum, place) => sum + place[way], 0) / places.length;
  const spread = places.length > 1 ? Math.hypot(places[0][0] - places[1][0], places[0][1] - places[1][1]) : 0;
  return { x: mean(0), y: mean(1), spread };
}

/** Listens on an element. `drawing` is told places in pixels from the element's upper left corner: `point(x, y, isSet)`, `leave()`,
 * `pan(dx, dy)`, `zoom(x, y, factor)`, above 1 to see more, `showAll()`, and whether it shows all already, `isWhole()`. */
export function listen(element, drawing) {
  const fingers = new Map();
  let drag = null;
  const at = (event) => placeIn(element, event);
  element.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    const moves = fingers.size > 1 || event.shiftKey || event.button === 1;
    drag = { moves, ...grip(fingers) };
    if (moves) event.preventDefault();
    else drawing.point(...at(event), true);
    element.closest("[tabindex]")?.focus({ preventScroll: true });
  });
  element.addEventListener("pointermove", (event) => {
    if (fingers.has(event.pointerId)) fingers.set(event.pointerId, at(event));
    if (drag?.moves) {
      const now = grip(fingers);
      drawing.pan(now.x - drag.x, now.y - drag.y);
      if (drag.spread && now.spread) drawing.zoom(now.x, now.y, drag.spread / Math.max(10, now.spread));
      drag = { moves: true, ...now };
    } else if (drag) {
      drawing.point(...at(event), true);
    } else if (event.pointerType === "mouse") {
      drawing.point(...at(event), false);
    }
  });
  const end = (event) => {
    fingers.delete(event.pointerId);
    drag = fingers.size ? { moves: true, ...grip(fingers) } : null;
  };
  element.addEventListener("pointerup", end);
  element.addEventListener("pointercancel", end);
  element.addEventListener("pointerleave", () => drag || drawing.leave());
  element.addEventListener("dblclick", () => drawing.showAll());
  element.addEventListener("wheel", (event) => {
    const unit = event.deltaMode === 0 ? 1 : 33;
    const [dx, dy] = [event.deltaX * unit, event.deltaY * unit];
    // A page that scrolls already goes on scrolling.
    const scrolls = performance.now() - scrolledAt < SCROLL_GOES_ON_MS || (dy > 0 && drawing.isWhole());
    if (!event.ctrlKey && scrolls && Math.abs(dx) <= Math.abs(dy)) {
      scrolledAt = performance.now();
      return;
    }
    event.preventDefault();
    if (Math.abs(dx) > Math.abs(dy)) drawing.pan(-dx, 0);
    else drawing.zoom(...at(event), wheelFactor(dy));
  }, { passive: false });
}

/** Does what a key stands for; modifiers are the browser's. */
export function press(event, actions) {
  if (!(event.key in actions) || event.ctrlKey || event.metaKey || event.altKey) return;
  actions[event.key]();
  event.preventDefault();
}
