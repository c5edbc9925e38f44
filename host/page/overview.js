// The feed of the whole run, with the window of the plots on it.

import { MARGIN } from "page/axes.js";
import { Sheet } from "page/sheet.js";
import { wheelFactor } from "page/span.js";
import { ink } from "page/theme.js";
import { work } from "page/work.js";

export class Overview {
  constructor(state, element) {
    this.state = state;
    this.element = element;
    this.sheet = new Sheet(element);
    this.window = element.appendChild(document.createElement("i"));
    this.window.className = "window";
    this.line = element.appendChild(document.createElement("i"));
    this.line.className = "cursor";
    this.isOld = true;
    let grip = null;
    const at = (event) => {
      const [from, to] = state.ends();
      const part = (event.clientX - element.getBoundingClientRect().left - MARGIN.left) / this.width;
      return from + part * (to - from);
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      const x = at(event);
      const half = (state.to - state.from) / 2;
      // What is not taken hold of comes to where the pointer is.
      if (x < state.from || x > state.to) state.show(x - half, x + half);
      grip = x - state.from;
    });
    element.addEventListener("pointermove", (event) => {
      if (grip === null) return;
      const width = state.to - state.from;
      const from = at(event) - grip;
      state.show(from, from + width);
    });
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => (grip = null));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      state.zoom(at(event), wheelFactor(event.deltaY));
    }, { passive: false });
  }

  draw() {
    const { state } = this;
    if (this.over !== state.over) this.isOld = true;
    if (this.isOld) {
      this.sheet.measure();
      const { width, height } = this.sheet.clear();
      this.width = width - MARGIN.left - MARGIN.right;
      const [from, to] = state.ends();
      const { run } = state;
      const feed = run.quantity("feed");
      const count = Math.max(1, Math.round(this.width));
      const { context } = this.sheet;
      context.fillStyle = ink("feed");
      const most = feed.range(0, run.samples) ? feed.high : 0;
      const tickAt = (i) => state.tickAt(run, from + ((to - from) * i) / count);
      for (let i = 0; i < count && most > 0; i += 1) {
        work.columns += 1;
        const first = run.sampleOf(tickAt(i));
        if (!feed.range(first, Math.max(first + 1, run.sampleOf(tickAt(i + 1))))) continue;
        const [top, bottom] = [feed.high, feed.low].map((value) => height - 1 - (value / most) * (height - 3));
        context.globalAlpha = 0.35;
        context.fillRect(MARGIN.left + i, bottom, 1, height - bottom);
        context.globalAlpha = 1;
        context.fillRect(MARGIN.left + i, top - 0.6, 1, Math.max(1.2, bottom - top));
      }
      this.over = state.over;
      this.isOld = false;
    }
    const [from, to] = state.ends();
    const px = (x) => MARGIN.left + ((x - from) / (to - from)) * this.width;
    this.window.hidden = state.isWhole();
    this.window.style.left = `${px(state.from)}px`;
    this.window.style.width = `${Math.max(3, px(state.to) - px(state.from))}px`;
  }

  place() {
    const { state } = this;
    const [from, to] = state.ends();
    const x = MARGIN.left + ((state.xOf(state.run, state.cursor) - from) / (to - from)) * this.width;
    this.line.style.transform = `translateX(${x}px)`;
  }
}
