// What all parts of the page share: one cursor, one window of the run, and who wants to know of changes.
//
// The plots lie over time or over path length; x is a time [s] or a path position [mm] accordingly. The cursor is a tick of the
// page's own run.

import { Span } from "page/span.js";

export class State extends Span {
  constructor(runs) {
    super();
    this.runs = runs;
    this.run = runs[0];
    this.over = "time";
    this.cursor = 0;
    /** Where the cursor was set; it comes back when a pointer that it followed leaves. */
    this.placed = 0;
    this.listeners = { cursor: [], window: [], end: [] };
    this.showAll();
  }

  on(change, listener) {
    this.listeners[change].push(listener);
  }

  tell(change) {
    for (const listener of this.listeners[change]) listener();
  }

  /** Other runs are shown: nothing is to be drawn of these any more. */
  end() {
    this.tell("end");
    this.listeners = { cursor: [], window: [], end: [] };
  }

  /** What the reader chose of cursor and window. */
  kept() {
    return { over: this.over, window: this.isWhole() ? null : [this.from, this.to], placed: this.placed };
  }

  /** Chooses it again. */
  restore({ over, window, placed }) {
    this.layOver(over);
    if (window) this.show(...window);
    this.place(placed);
  }

  /** The tick of a run at x. */
  tickAt(run, x) {
    return this.over === "time" ? run.tickAtTime(x) : run.tickAtPath(x);
  }

  /** x of a tick of a run. */
  xOf(run, tick) {
    return this.over === "time" ? run.timeS(tick) : run.pathMm(tick);
  }

  /** The ends of x over all runs. */
  ends() {
    const from = Math.min(...this.runs.map((run) => this.xOf(run, 0)));
    const to = Math.max(...this.runs.map((run) => this.xOf(run, run.ticks - 1)));
    return to > from ? [from, to] : [from - 0.5, from + 0.5];
  }

  /** No narrower than ten samples. */
  least() {
    const [first, last] = this.ends();
    const { run } = this;
    return this.over === "time" ? 10 * run.ticksPerSample * run.tickS : (last - first) / run.samples;
  }

  changed() {
    this.tell("window");
  }

  /** Lies the plots over "time" or "path", with the same ticks in the window. */
  layOver(over) {
    const [from, to] = [this.tickAt(this.run, this.from), this.tickAt(this.run, this.to)];
    const whole = this.isWhole();
    this.over = over;
    if (whole) this.showAll();
    else this.show(this.xOf(this.run, from), this.xOf(this.run, to));
  }

  /** Moves the cursor to a tick for as long as a pointer is there. */
  hover(tick) {
    const last = Math.max(0, this.run.ticks - 1);
    this.cursor = Math.min(last, Math.max(0, Math.round(tick)));
    this.tell("cursor");
  }

  /** Sets the cursor. */
  place(tick) {
    this.hover(tick);
    this.placed = this.cursor;
  }

  /** Brings it back to where it was set. */
  leave() {
    if (this.cursor !== this.placed) this.hover(this.placed);
  }

  /** Sets the cursor, and moves the window to show it. */
  visit(tick) {
    this.place(tick);
    const x = this.xOf(this.run, this.cursor);
    if (x < this.from || x > this.to) {
      const half = (this.to - this.from) / 2;
      this.show(x - half, x + half);
    }
  }
}
