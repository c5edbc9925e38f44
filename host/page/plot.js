// A quantity of runs: its curves, limits and ceilings, what happened meanwhile, and the values at the cursor.

import { Axes, CURVE_WIDTH, LIMIT_SHOWN_FROM, MARGIN } from "page/axes.js";
import { make } from "page/dom.js";
import { figure } from "page/format.js";
import { clearText } from "page/sheet.js";
import { dashes, ink } from "page/theme.js";

/** How far above the highest feed a ceiling is drawn. */
const CEILING_TO_FEED = 1.3;
/** How much the range between lowest and highest values covers what lies below it. */
const RANGE_ALPHA = 0.6;
/** Height of a word above the feed [px]. */
const WORD_PX = 14;
/** How much the curves of another run stand out. */
const OTHER_ALPHA = 0.45;

export class Plot extends Axes {
  /**
   * `title` is what it shows, `unit` in which unit, and `curves` what is drawn: each with `name`, `ink` and the `column` of the
   * quantity. `limit` is drawn in both directions where the curves come near it. `hasCeilings`: those of the feed, too.
   */
  constructor(state, parent, { title, unit, curves, limit = 0, hasCeilings = false, isTall = false }) {
    super(parent, state, { title, unit, isTall });
    Object.assign(this, { state, curves, limit, hasCeilings });
    this.isSeen = true;
    for (const curve of curves) curve.output = this.addValue(curve.name, curve.ink);
    if (hasCeilings) {
      this.legend = make("ul", { class: "legend" });
      this.element.append(this.legend);
    }
  }

  draw(columns) {
    if (!this.begin()) return;
    const shapes = this.shapes(columns);
    const ceilings = this.hasCeilings ? columns.ceilings() : [];
    this.fit(shapes, ceilings);
    const { context } = this.sheet;
    this.drawRests(context);
    this.drawAxes(context);
    this.clipped(context, () => {
      if (this.showsLimit) this.drawLevels(context, [this.limit, -this.limit]);
      this.drawCeilings(context, ceilings);
      // The page's own run lies on top.
      for (const shape of shapes.reverse()) this.drawShape(context, shape);
      this.drawMarks(context);
    });
    this.place();
  }

  /** What is to be drawn of every curve of every run, the page's own first. */
  shapes(columns) {
    return this.state.runs.flatMap((run, number) => this.curves.flatMap((curve) => {
      const found = columns.curve(number, curve.column);
      return found ? [{ ...found, curve, isOther: number > 0 }] : [];
    }));
  }

  /** The ends of the vertical axis: all that is in the window, and zero. */
  fit(shapes, ceilings) {
    // Places on an axis have no zero that means anything.
    const isPosition = this.curves.some((curve) => curve.column.startsWith("position"));
    let [low, high] = isPosition ? [Infinity, -Infinity] : [0, 0];
    for (const { points } of shapes) {
      for (const [, least, most] of points) {
        if (least < low) low = least;
        if (most > high) high = most;
      }
    }
    const top = CEILING_TO_FEED * high;
    for (const step of ceilings) if (step.low <= top) high = Math.max(high, step.low);
    const magnitude = Math.max(-low, high);
    this.showsLimit = this.limit > 0 && magnitude >= LIMIT_SHOWN_FROM * this.limit;
    if (this.showsLimit) {
      if (high > 0) high = Math.max(high, this.limit);
      if (low < 0) low = Math.min(low, -this.limit);
    }
    if (low > high) [low, high] = [0, 0];
    if (low === high) [low, high] = [low - 1, high + 1];
    // Above the feed there is room for the words of commands and faults.
    const { commands, faults } = this.state.run.header;
    if (this.hasCeilings && commands.length + faults.length > 0) high += (WORD_PX / this.height) * (high - low);
    const air = 0.06 * (high - low);
    this.low = low < 0 || isPosition ? low - air : low;
    this.high = high > 0 || isPosition ? high + air : high;
  }

  drawRests(context) {
    const { state } = this;
    context.fillStyle = ink("rest");
    for (const { from_s, to_s } of state.run.header.rests) {
      const [from, to] = [from_s, to_s].map((s) => this.px(state.xOf(state.run, state.run.tickAtTime(s))));
      const left = Math.max(MARGIN.left, from);
      const right = Math.min(MARGIN.left + this.width, Math.max(to, from + 1));
      if (right > left) context.fillRect(left, MARGIN.top, right - left, this.height);
    }
  }

  drawCeilings(context, steps) {
    if (!this.hasCeilings) return;
    const inks = new Map();
    for (const { from, to, low, high, reason } of steps) {
      if (!(low <= this.high)) continue;
      const isReached = reason.ink !== "unreached";
      if (!inks.has(reason.ink)) {
        inks.set(reason.ink, { name: isReached ? reason.name : "not reached, the block is too short", bands: new Path2D(), lines: new Path2D() });
      }
      const { bands, lines } = inks.get(reason.ink);
      const y = this.py(low);
      // Columns of many blocks show the range of their ceilings, whose lowest holds the feed down.
      if (high > low) {
        const top = this.py(Math.min(high, this.high));
        bands.rect(from, top, to - from, y - top);
      }
      const thick = isReached ? 3 : 1.5;
      lines.rect(from, y - thick / 2, Math.max(to - from, 1 / this.scale), thick);
    }
    for (const [of, { bands, lines }] of inks) {
      context.fillStyle = ink(of);
      context.globalAlpha = 0.2;
      context.fill(bands);
      context.globalAlpha = 1;
      context.fill(lines);
    }
    const shown = [...inks.keys()].join();
    if (shown === this.shown) return;
    this.shown = shown;
    const keys = [...inks].map(([of, { name }]) => {
      const item = document.createElement("li");
      item.style.setProperty("--key", `var(--${of})`);
      item.textContent = `ceiling: ${name}`;
      return item;
    });
    this.legend.replaceChildren(...keys);
  }

  drawShape(context, { curve, points, starts, isOther }) {
    context.strokeStyle = ink(curve.ink);
    context.fillStyle = ink(curve.ink);
    context.globalAlpha = isOther ? OTHER_ALPHA : 1;
    context.lineWidth = CURVE_WIDTH;
    context.lineJoin = "round";
    if (isOther) context.setLineDash([4, 3]);
    starts.forEach((start, i) => this.drawPiece(context, points.slice(start, starts[i + 1])));
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  /** A piece of a curve: a line, or the range between two, or a dot. */
  drawPiece(context, points) {
    context.beginPath();
    points.forEach(([x, , high], i) => (i ? context.lineTo(x, this.py(high)) : context.moveTo(x, this.py(high))));
    if (points.some(([, low, high]) => low !== high)) {
      for (let i = points.length - 1; i >= 0; i -= 1) context.lineTo(points[i][0], this.py(points[i][1]));
      context.closePath();
      context.globalAlpha *= RANGE_ALPHA;
      context.fill();
      context.globalAlpha /= RANGE_ALPHA;
    }
    context.stroke();
    if (points.length > 1) return;
    context.beginPath();
    context.arc(points[0][0], this.py(points[0][2]), 2, 0, 7);
    context.fill();
  }

  /** Faults and commands. */
  drawMarks(context) {
    const { state } = this;
    const { commands, faults } = state.run.header;
    let free = -Infinity;
    for (const [name, list] of [["command", commands], ["fault", faults]]) {
      context.fillStyle = ink(name);
      for (const { tick, word } of list) {
        context.strokeStyle = ink(name);
        context.lineWidth = name === "fault" ? 1.6 : 1;
        context.setLineDash(dashes(name));
        const x = this.px(state.xOf(state.run, tick - state.run.firstTick));
        if (x < MARGIN.left - 1 || x > MARGIN.left + this.width + 1) continue;
        context.beginPath();
        context.moveTo(x, MARGIN.top);
        context.lineTo(x, MARGIN.top + this.height);
        context.stroke();
        const width = context.measureText(word).width;
        // A word that has no room is left out; its line stays, and the table has it.
        if (!this.hasCeilings || x < free || x + 4 + width > MARGIN.left + this.width) continue;
        context.textAlign = "left";
        clearText(context, word, x + 4, MARGIN.top + 9);
        free = x + width + 10;
      }
      context.setLineDash([]);
    }
  }

  /** Moves the cursor's line to the cursor. */
  place() {
    const { state } = this;
    this.placeLine(state.xOf(state.run, state.cursor));
  }

  /** Writes the values at the cursor. */
  tell() {
    const { state } = this;
    for (const curve of this.curves) {
      const texts = state.runs.map((run) => {
        const quantity = run.quantity(curve.column);
        if (!quantity) return null;
        const tick = run === state.run ? state.cursor : Math.round(state.tickAt(run, state.xOf(state.run, state.cursor)));
        const sample = run.sampleOf(tick);
        if (tick > run.ticks - 1 || !quantity.range(sample, sample + 1)) return "–";
        return quantity.low === quantity.high
          ? figure(quantity.low, 5)
          : `${figure(quantity.low, 4)} … ${figure(quantity.high, 4)}`;
      });
      curve.output.textContent = texts.filter((text) => text !== null).join(" | ");
    }
  }
}
