// What all figures have: a title, tools, keys, words below, and that they are drawn when they are seen.

import { button, make } from "page/dom.js";
import { press } from "page/input.js";
import { onChange } from "page/theme.js";
import { nextFrame } from "page/work.js";

/** Zoom of a key or a button. */
const ZOOM = 2;

/** What extends it draws: `measure()`, `draw()`; and does what keys and buttons say: `zoomBy(factor)`, above 1 to see more, `panBy(part)`,
 * `showAll()`, `step(count)` of the cursor, `toEnd(isLast)`. */
export class Figure {
  constructor(parent, { title, words }) {
    /** What holds at the cursor. */
    this.place = make("output", { class: "place" });
    this.body = make("div");
    const tools = make("div", { class: "choice" },
      button("−", "Zoom out", () => this.zoomBy(ZOOM)),
      button("+", "Zoom in", () => this.zoomBy(1 / ZOOM)),
      button("All", "All of the figure", () => this.showAll()));
    this.words = make("figcaption", {}, words);
    this.element = make("figure",
      {
        class: "figure",
        tabindex: 0,
        role: "application",
        "aria-label": `${title}. Arrow keys move the cursor, plus and minus zoom, page keys move the window, 0 shows all.`,
      },
      make("div", { class: "tools" }, make("h3", {}, title), this.place, tools), this.body, this.words);
    parent.append(this.element);
    // What its section is called it need not be called again.
    const heading = parent.closest("section")?.querySelector("h2");
    if (heading?.textContent === title) this.element.querySelector("h3").className = "unseen";
    this.redraw = () => this.drawIfDue();
    this.isOld = true;
    this.isSeen = false;
    this.element.addEventListener("keydown", (event) => press(event, {
      ArrowLeft: () => this.step(event.shiftKey ? -20 : -1),
      ArrowRight: () => this.step(event.shiftKey ? 20 : 1),
      Home: () => this.toEnd(false),
      End: () => this.toEnd(true),
      "+": () => this.zoomBy(1 / ZOOM),
      "=": () => this.zoomBy(1 / ZOOM),
      "-": () => this.zoomBy(ZOOM),
      PageUp: () => this.panBy(-0.5),
      PageDown: () => this.panBy(0.5),
      0: () => this.showAll(),
      Escape: () => this.showAll(),
    }));
    const seen = new IntersectionObserver(([entry]) => {
      this.isSeen = entry.isIntersecting;
      if (this.isSeen && this.isOld) nextFrame(this.redraw);
    }, { rootMargin: "200px" });
    seen.observe(this.element);
    const resized = new ResizeObserver(() => this.age());
    resized.observe(this.element);
    const forget = onChange(() => {
      this.isOld = true;
      // On paper all of them are seen.
      this.drawIfDue(true);
    });
    this.end = () => {
      seen.disconnect();
      resized.disconnect();
      forget();
      this.element.remove();
    };
  }

  /** What is drawn is no longer what is to be seen. */
  age() {
    this.isOld = true;
    nextFrame(this.redraw);
  }

  drawIfDue(evenUnseen = false) {
    if (!this.isOld || !(this.isSeen || evenUnseen)) return;
    this.isOld = false;
    this.measure();
    this.draw();
  }
}
