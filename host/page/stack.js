// Graphs one above the other, over a common axis, with one cursor on the places of their points.

import { Axes, CURVE_WIDTH, LIMIT_SHOWN_FROM } from "page/axes.js";
import { make } from "page/dom.js";
import { Figure } from "page/figure.js";
import { reading } from "page/format.js";
import { listen } from "page/input.js";
import { lastNotAbove } from "page/sorted.js";
import { Span } from "page/span.js";
import { dashes, ink, keyOf } from "page/theme.js";

/** The narrowest window, as a part of all. */
const LEAST = 1e-6;
/** Radius of a dot [px]. */
const DOT = 3;

/** A curve's points in the order of their places; those without a value are left out. */
class Curve {
  constructor({ name, ink: of, points, is_dots: isDots }, scaled) {
    Object.assign(this, { name, ink: of, isDots });
    const known = points.filter(([x, y]) => x !== null && y !== null).sort((a, b) => a[0] - b[0]);
    this.x = Float64Array.from(known, ([x]) => scaled(x));
    this.y = Float64Array.from(known, ([, y]) => y);
  }

  /** The value at x: that of a point, or on the line between two; NaN where there is none. */
  at(x) {
    const i = lastNotAbove(this.x, x);
    if (i >= 0 && this.x[i] === x) return this.y[i];
    if (this.isDots || i < 0 || i + 1 >= this.x.length) return NaN;
    const part = (x - this.x[i]) / (this.x[i + 1] - this.x[i]);
    return this.y[i] + part * (this.y[i + 1] - this.y[i]);
  }

  /** The first and behind the last point of a window, with one beyond each end. */
  within(from, to) {
    return [Math.max(0, lastNotAbove(this.x, from)), Math.min(this.x.length, lastNotAbove(this.x, to) + 2)];
  }
}

/** The window of the horizontal axis. */
class Window extends Span {
  constructor(home, all, changed) {
    super();
    Object.assign(this, { home, all, changed });
    [this.from, this.to] = home;
  }

  ends() {
    return this.all;
  }

  least() {
    return LEAST * (this.all[1] - this.all[0]);
  }

  /** What the figure showed first. */
  showAll() {
    this.show(...this.home);
  }
}

export class Stack extends Figure {
  constructor(parent, figure) {
    super(parent, figure);
    const { x, graphs, ends, is_logarithmic: isLogarithmic } = figure;
    this.x = x;
    const scaled = isLogarithmic ? Math.log10 : (value) => value;
    this.unscaled = isLogarithmic ? (value) => 10 ** value : (value) => value;
    this.graphs = graphs.map(({ y, ends: fixed, series, levels }) => ({
      fixed, levels, y, curves: series.map((of) => new Curve(of, scaled)),
    }));
    const places = new Map();
    for (const { series } of graphs) for (const { points } of series) for (const [at] of points) places.set(scaled(at), at);
    /** Where the cursor can be: scaled, and as it is told. */
    this.places = Float64Array.from([...places.keys()].filter(Number.isFinite)).sort();
    this.told = places;
    const home = ends.map(scaled);
    const all = [Math.min(home[0], this.places[0] ?? home[0]), Math.max(home[1], this.places.at(-1) ?? home[1])];
    this.span = new Window(home, all, () => this.age());
    this.cursor = this.nearest((home[0] + home[1]) / 2);
    this.placed = this.cursor;
    for (const graph of this.graphs) {
      const { name: title, unit } = graph.y;
      graph.axes = new Axes(this.body, this.span, { title, unit, isTall: graphs.length < 3, isLogarithmic });
      for (const curve of graph.curves) curve.output = graph.axes.addValue(curve.name, curve.ink, keyOf(curve.ink, curve.isDots));
      listen(graph.axes.area, {
        point: (px, _, isSet) => this.moveTo(this.nearest(graph.axes.xAt(px)), isSet),
        leave: () => this.moveTo(this.placed, false),
        pan: (px) => this.span.pan(-px / graph.axes.width),
        zoom: (px, _, factor) => this.span.zoom(graph.axes.xAt(px), factor),
        showAll: () => this.showAll(),
        isWhole: () => this.span.isWhole(),
      });
    }
    this.body.append(make("p", { class: "x" }, x.unit ? `${x.name} [${x.unit}]` : x.name));
    this.tell();
  }

  /** The place next to x. */
  nearest(x) {
    const before = Math.max(0, lastNotAbove(this.places, x));
    const after = Math.min(this.places.length - 1, before + 1);
    return Math.abs(this.places[after] - x) < Math.abs(this.places[before] - x) ? after : before;
  }

  moveTo(place, isSet) {
    this.cursor = Math.min(this.places.length - 1, Math.max(0, place));
    if (isSet) this.placed = this.cursor;
    this.tell();
  }

  /** Moves the cursor, and the window to show it. */
  visit(place) {
    this.moveTo(place, true);
    const x = this.places[this.cursor];
    const half = (this.span.to - this.span.from) / 2;
    if (x < this.span.from || x > this.span.to) this.span.show(x - half, x + half);
  }

  step(count) {
    this.visit(this.cursor + count);
  }

  toEnd(isLast) {
    this.visit(isLast ? this.places.length - 1 : 0);
  }

  zoomBy(factor) {
    const { from, to } = this.span;
    const x = this.places[this.cursor];
    this.span.zoom(x >= from && x <= to ? x : (from + to) / 2, factor);
  }

  panBy(part) {
    this.span.pan(part);
  }

  showAll() {
    this.span.showAll();
  }

  measure() {
    for (const { axes } of this.graphs) axes.sheet.measure();
  }

  draw() {
    for (const graph of this.graphs) {
      const { axes, curves } = graph;
      if (!axes.begin()) continue;
      const levels = this.fit(graph);
      const { context } = axes.sheet;
      axes.drawAxes(context);
      axes.clipped(context, () => {
        axes.drawLevels(context, levels);
        // The first one lies on top.
        for (const curve of [...curves].reverse()) this.drawCurve(axes, context, curve);
      });
    }
    this.tell();
  }

  /** The ends of the vertical axis: what is seen, zero, and levels that are not far off, which it returns. */
  fit({ axes, curves, fixed, levels }) {
    let [low, high] = [0, 0];
    for (const curve of curves) {
      const [first, end] = curve.within(this.span.from, this.span.to);
      for (let i = first; i < end; i += 1) {
        if (curve.x[i] < this.span.from || curve.x[i] > this.span.to) continue;
        low = Math.min(low, curve.y[i]);
        high = Math.max(high, curve.y[i]);
      }
      // Between two points, the line is seen and neither of them.
      for (const value of [curve.at(this.span.from), curve.at(this.span.to)]) {
        if (!Number.isNaN(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
      }
    }
    const magnitude = Math.max(-low, high);
    const shown = levels.filter((level) => magnitude >= LIMIT_SHOWN_FROM * Math.abs(level));
    for (const level of shown) [low, high] = [Math.min(low, level), Math.max(high, level)];
    if (low === high) [low, high] = [-1, 1];
    const air = 0.06 * (high - low);
    [axes.low, axes.high] = fixed ?? [low < 0 ? low - air : low, high > 0 ? high + air : high];
    return shown;
  }

  drawCurve(axes, context, curve) {
    const [first, end] = curve.within(this.span.from, this.span.to);
    context.strokeStyle = ink(curve.ink);
    context.fillStyle = ink(curve.ink);
    context.lineWidth = CURVE_WIDTH;
    context.lineJoin = "round";
    context.beginPath();
    for (let i = first; i < end; i += 1) {
      const [px, py] = [axes.px(curve.x[i]), axes.py(curve.y[i])];
      if (curve.isDots || end - first === 1) {
        context.moveTo(px + DOT, py);
        context.arc(px, py, DOT, 0, 7);
      } else if (i === first) {
        context.moveTo(px, py);
      } else {
        context.lineTo(px, py);
      }
    }
    if (curve.isDots || end - first === 1) {
      context.fill();
      return;
    }
    context.setLineDash(dashes(curve.ink));
    context.stroke();
    context.setLineDash([]);
  }

  /** The cursor's lines, its place, and the values there. */
  tell() {
    const x = this.places[this.cursor];
    const at = this.told.get(x);
    this.place.textContent = at === undefined ? "" : `${this.x.name} ${reading(at, 5)} ${this.x.unit}`.trim();
    for (const { axes, curves } of this.graphs) {
      if (axes.width) axes.placeLine(x);
      for (const curve of curves) {
        const value = curve.at(x);
        curve.output.textContent = Number.isNaN(value) ? "–" : reading(value, 5);
      }
    }
  }
}
