// What pointers, wheel and keys do to the picture of the path: turn it, move it, zoom it, and point at a place of the run.

import { grip, placeIn } from "page/input.js";

/** How far a pointer moves at most to have pointed [px]. */
const STILL_PX = 3;
/** Pixels of a turn by a radian. */
const PX_PER_RAD = 150;
/** Pixels of the wheel that double the scale. */
const PX_PER_DOUBLING = 300;
/** A press of a key turns by this [rad], or moves by this [px]. */
const KEY_RAD = 0.1;
const KEY_PX = 20;

export function listen(path) {
  const { stage, state, camera } = path;
  const fingers = new Map();
  let drag = null;
  const at = (event) => placeIn(stage, event);

  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    const turns = camera.isInSpace && fingers.size === 1 && event.button === 0 && !event.shiftKey;
    drag = { ...grip(fingers), turns, far: 0 };
  });
  stage.addEventListener("pointermove", (event) => {
    if (!drag) {
      const tick = event.pointerType === "mouse" ? path.tickNear(...at(event)) : undefined;
      if (tick === undefined) state.leave();
      else state.hover(tick);
      return;
    }
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, at(event));
    const now = grip(fingers);
    const [dx, dy] = [now.x - drag.x, now.y - drag.y];
    const far = drag.far + Math.abs(dx) + Math.abs(dy);
    if (far <= STILL_PX) {
      drag.far = far;
      return;
    }
    if (drag.turns) {
      camera.turn(dx / PX_PER_RAD, dy / PX_PER_RAD);
    } else {
      camera.shift(dx, dy);
      if (drag.spread && now.spread) camera.zoom(now.x, now.y, now.spread / drag.spread);
    }
    drag = { ...now, turns: drag.turns, far };
    path.move();
  });
  const end = (event) => {
    // A pointer that stayed where it was points at the path.
    if (drag && drag.far <= STILL_PX && fingers.size === 1) {
      const tick = path.tickNear(...at(event));
      if (tick !== undefined) state.visit(tick);
    }
    fingers.delete(event.pointerId);
    drag = fingers.size ? { ...grip(fingers), turns: false, far: Infinity } : null;
  };
  stage.addEventListener("pointerup", end);
  stage.addEventListener("pointercancel", end);
  stage.addEventListener("pointerleave", () => drag || state.leave());
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("dblclick", () => path.showAll());
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(...at(event), 2 ** (-event.deltaY / PX_PER_DOUBLING));
    path.move();
  }, { passive: false });

  const zoom = (factor) => () => {
    camera.zoom(camera.size[0] / 2, camera.size[1] / 2, factor);
    path.move();
  };
  const go = (right, down) => () => {
    if (camera.isInSpace) camera.turn(right * KEY_RAD, down * KEY_RAD);
    else camera.shift(-right * KEY_PX, -down * KEY_PX);
    path.move();
  };
  const keys = {
    "+": zoom(1.5),
    "=": zoom(1.5),
    "-": zoom(1 / 1.5),
    0: () => path.showAll(),
    ArrowLeft: go(-1, 0),
    ArrowRight: go(1, 0),
    ArrowUp: go(0, -1),
    ArrowDown: go(0, 1),
  };
  stage.addEventListener("keydown", (event) => {
    if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
    keys[event.key]();
    event.preventDefault();
  });
}
