// Figures in a plane with equal scales: deviations around a circle, and points beside a curve.

import { Axes, CURVE_WIDTH, MARGIN } from "page/axes.js";
import { make } from "page/dom.js";
import { Figure } from "page/figure.js";
import { figure as digits, reading } from "page/format.js";
import { listen } from "page/input.js";
import { clearText } from "page/sheet.js";
import { dashes, ink, keyOf } from "page/theme.js";

/** How far it is zoomed in at most. */
const ZOOM_MAX = 1e6;
/** Radius of the programmed circle, as a part of the largest that fits. */
const CIRCLE = 0.62;
/** The part of the picture that the greatest deviation takes, and the magnification up to which it is one to be seen. */
const DEVIATION = 0.05;
const MAGNIFIED_MAX = 1e6;
/** Radius of a dot [px]. */
const DOT = 2.5;

/** A view of a plane. What extends it gives `bounds()`, the least and most of both directions; `paint(context)`; `pick(x, y)`, the
 * cursor's number at a place; `places()`, how many there are; `spot()`, where the cursor is; and `tell()`. */
class Flat extends Figure {
  constructor(parent, figure, { title, unit }) {
    super(parent, figure);
    this.figure = figure;
    this.view = { from: 0, to: 1 };
    this.axes = new Axes(this.body, this.view, { title, unit });
    this.axes.element.classList.add("flat");
    this.axes.line.classList.replace("cursor", "dot");
    this.cursor = 0;
    this.placed = 0;
    this.isMoved = false;
    const at = (px, py) => [this.axes.xAt(px), this.yAt(py)];
    listen(this.axes.area, {
      point: (px, py, isSet) => this.moveTo(this.pick(...at(px, py)), isSet),
      leave: () => this.moveTo(this.placed, false),
      pan: (dx, dy) => this.shift(-dx / this.pxPerUnit, dy / this.pxPerUnit),
      zoom: (px, py, factor) => this.zoom(...at(px, py), factor),
      showAll: () => this.showAll(),
      isWhole: () => !this.isMoved,
    });
  }

  yAt(py) {
    const { axes } = this;
    return axes.high - ((py - MARGIN.top) / axes.height) * (axes.high - axes.low);
  }

  moveTo(place, isSet) {
    this.cursor = Math.min(this.places() - 1, Math.max(0, place));
    if (isSet) this.placed = this.cursor;
    this.mark();
  }

  /** Moves the cursor, and the view to show it. */
  visit(place) {
    this.moveTo(place, true);
    const { axes, view } = this;
    const spot = this.spot();
    if (!spot || this.contains(spot)) return;
    this.shift(spot[0] - (view.from + view.to) / 2, spot[1] - (axes.low + axes.high) / 2);
  }

  /** Whether a place is within the view. */
  contains([x, y]) {
    const { axes, view } = this;
    return x >= view.from && x <= view.to && y >= axes.low && y <= axes.high;
  }

  step(count) {
    this.visit(this.cursor + count);
  }

  toEnd(isLast) {
    this.visit(isLast ? this.places() - 1 : 0);
  }

  shift(x, y) {
    Object.assign(this.view, { from: this.view.from + x, to: this.view.to + x });
    Object.assign(this.axes, { low: this.axes.low + y, high: this.axes.high + y });
    this.isMoved = true;
    this.age();
  }

  /** Zooms around a place. */
  zoom(x, y, wanted) {
    const { view, axes } = this;
    const width = view.to - view.from;
    const factor = Math.min(this.home / width, Math.max(this.home / ZOOM_MAX / width, wanted));
    const around = (middle, end) => middle + (end - middle) * factor;
    Object.assign(view, { from: around(x, view.from), to: around(x, view.to) });
    Object.assign(axes, { low: around(y, axes.low), high: around(y, axes.high) });
    this.isMoved = true;
    this.age();
    if (factor >= 1 && view.to - view.from >= 0.999 * this.home) this.showAll();
  }

  zoomBy(factor) {
    this.zoom((this.view.from + this.view.to) / 2, (this.axes.low + this.axes.high) / 2, factor);
  }

  panBy(part) {
    this.shift(part * (this.view.to - this.view.from), 0);
  }

  showAll() {
    this.isMoved = false;
    this.age();
  }

  measure() {
    this.axes.sheet.measure();
  }

  draw() {
    const { axes, view } = this;
    if (!axes.begin()) return;
    const [left, right, low, high] = this.bounds();
    const unitsPerPx = Math.max((right - left) / axes.width, (high - low) / axes.height) * 1.04 || 1;
    this.home = unitsPerPx * axes.width;
    if (!this.isMoved) {
      const [x, y] = [(left + right) / 2, (low + high) / 2];
      Object.assign(view, { from: x - this.home / 2, to: x + this.home / 2 });
      Object.assign(axes, { low: y - (unitsPerPx * axes.height) / 2, high: y + (unitsPerPx * axes.height) / 2 });
    } else {
      // What was seen of another width is seen of this one.
      const half = ((view.to - view.from) / axes.width) * axes.height * 0.5;
      const middle = (axes.low + axes.high) / 2;
      Object.assign(axes, { low: middle - half, high: middle + half });
    }
    this.pxPerUnit = axes.width / (view.to - view.from);
    this.paint(axes.sheet.context);
    this.mark();
  }

  /** Marks the cursor, and tells what is there. */
  mark() {
    this.tell();
    const { axes } = this;
    const spot = axes.width ? this.spot() : null;
    const isInside = spot !== null && this.contains(spot);
    axes.line.hidden = !isInside;
    if (isInside) axes.line.style.transform = `translate(${axes.px(spot[0])}px,${axes.py(spot[1])}px)`;
  }

  /** A line through places, or dots. */
  trace(context, points, of, isDots = false) {
    const { axes } = this;
    context.strokeStyle = ink(of);
    context.fillStyle = ink(of);
    context.lineWidth = CURVE_WIDTH;
    context.lineJoin = "round";
    context.beginPath();
    points.forEach(([x, y], i) => {
      const [px, py] = [axes.px(x), axes.py(y)];
      if (isDots) {
        context.moveTo(px + DOT, py);
        context.arc(px, py, DOT, 0, 7);
      } else if (i) {
        context.lineTo(px, py);
      } else {
        context.moveTo(px, py);
      }
    });
    if (isDots) {
      context.fill();
      return;
    }
    context.setLineDash(dashes(of));
    context.stroke();
    context.setLineDash([]);
  }
}

/** Deviations around a circle: one is the largest circle that fits, and the deviations fill what the programmed one leaves. */
export class Polar extends Flat {
  constructor(parent, figure) {
    super(parent, figure, { title: "Deviation from the radius", unit: "µm" });
    const all = figure.series.flatMap(({ points }) => points.map(([, um]) => Math.abs(um)));
    const greatest = all.reduce((most, um) => Math.max(most, um), 0);
    // Rings far beyond the deviations would flatten them.
    this.ring = figure.ring_um <= 5 * greatest ? figure.ring_um : 0;
    this.most = Math.max(greatest, this.ring) || 1;
    this.curves = figure.series.map(({ name, ink: of, points }) => ({
      ink: of,
      points: [...points].sort((a, b) => a[0] - b[0]),
      drawn: points.map(([degrees, um]) => this.at(degrees, um)),
      output: this.axes.addValue(name, of, keyOf(of)),
    }));
    const times = (((1 - CIRCLE) / this.most) * 1e3) / (CIRCLE / figure.radius_mm);
    this.words.append(` The deviation is drawn ${digits(times, 3)} times as large as the circle.`);
    this.tell();
  }

  /** The place of a deviation. */
  at(degrees, um) {
    const radius = CIRCLE + ((1 - CIRCLE) * um) / this.most;
    const angle = (degrees * Math.PI) / 180;
    return [radius * Math.cos(angle), radius * Math.sin(angle)];
  }

  bounds() {
    return [-1, 1, -1, 1];
  }

  circle(um) {
    return Array.from({ length: 361 }, (_, degrees) => this.at(degrees, um));
  }

  paint(context) {
    const { axes } = this;
    this.axes.clipped(context, () => {
      context.strokeStyle = ink("grid");
      context.lineWidth = 1;
      for (const [x, y] of [[1, 0], [0, 1]]) {
        context.beginPath();
        context.moveTo(axes.px(-x), axes.py(-y));
        context.lineTo(axes.px(x), axes.py(y));
        context.stroke();
      }
      this.trace(context, this.circle(0), "axis");
      if (this.ring) for (const um of [this.ring, -this.ring]) this.trace(context, this.circle(um), "limit");
      for (const { ink: of, drawn } of [...this.curves].reverse()) this.trace(context, drawn, of);
      context.fillStyle = ink("soft");
      context.textAlign = "center";
      context.textBaseline = "middle";
      const write = (text, [x, y]) => clearText(context, text, axes.px(x), axes.py(y));
      const um = this.ring || this.most;
      write(`+${digits(um, 3)} µm`, this.at(45, um));
      write(`−${digits(um, 3)} µm`, this.at(45, -um));
      const [right, up] = this.figure.axes;
      write(right, [0.98, 0.04]);
      write(up, [0.04, 0.98]);
    });
  }

  places() {
    return this.curves[0]?.points.length ?? 0;
  }

  /** The angle of the cursor [°]. */
  degrees() {
    return this.curves[0]?.points[this.cursor]?.[0];
  }

  /** The point of a curve next to an angle. */
  nearest(points, degrees) {
    const off = ([at]) => Math.abs(((at - degrees + 540) % 360) - 180);
    return points.reduce((best, point, i) => (off(point) < off(points[best]) ? i : best), 0);
  }

  pick(x, y) {
    return this.places() ? this.nearest(this.curves[0].points, (Math.atan2(y, x) * 180) / Math.PI) : 0;
  }

  spot() {
    return this.places() ? this.at(...this.curves[0].points[this.cursor]) : null;
  }

  tell() {
    if (!this.curves || !this.places()) return;
    const degrees = this.degrees();
    this.place.textContent = `Angle ${digits(degrees, 4)}°`;
    for (const { points, output } of this.curves) {
      output.textContent = points.length ? reading(points[this.nearest(points, degrees)][1], 5) : "–";
    }
  }
}

/** Points beside a curve, with what parts them magnified. */
export class Plane extends Flat {
  constructor(parent, figure) {
    super(parent, figure, { title: `${figure.axes[1]} over ${figure.axes[0]}`, unit: "mm" });
    const { curve, points, deviations, told } = figure;
    for (const { name, ink: of, is_dots: isDots } of [curve, points]) this.axes.addValue(name, of, keyOf(of, isDots));
    const values = make("p", { class: "told" });
    this.body.append(values);
    this.outputs = told.map(({ quantity: { name, unit } }) => {
      const output = make("output", { "data-of": name });
      values.append(make("span", {}, make("small", {}, name), output, unit ? ` ${unit}` : ""));
      return output;
    });
    const [left, right, low, high] = this.bounds();
    const most = deviations.reduce((found, [x, y]) => Math.max(found, Math.hypot(x, y)), 0);
    const times = most > 0 ? (DEVIATION * Math.max(right - left, high - low)) / most : Infinity;
    this.times = times <= MAGNIFIED_MAX ? Math.max(1, Number(times.toPrecision(1))) : 0;
    this.words.append(this.times
      ? `Lines from the curve to its points are drawn ${digits(this.times, 3)} times as long.`
      : "The points lie on the curve as closely as can be drawn.");
    this.tell();
  }

  bounds() {
    const [x, y] = [0, 1].map((way) => {
      const values = [this.figure.curve, this.figure.points].flatMap(({ points }) => points.map((place) => place[way]));
      return values.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity]);
    });
    return [...x, ...y];
  }

  paint(context) {
    const { axes, figure } = this;
    axes.drawAxes(context);
    axes.clipped(context, () => {
      this.trace(context, figure.curve.points, figure.curve.ink);
      if (this.times) {
        context.strokeStyle = ink("error");
        context.beginPath();
        figure.points.points.forEach(([x, y], i) => {
          const [dx, dy] = figure.deviations[i];
          context.moveTo(axes.px(x + dx), axes.py(y + dy));
          context.lineTo(axes.px(x + dx - this.times * dx), axes.py(y + dy - this.times * dy));
        });
        context.stroke();
      }
      this.trace(context, figure.points.points, figure.points.ink, true);
    });
  }

  places() {
    return this.figure.points.points.length;
  }

  pick(x, y) {
    const { points } = this.figure.points;
    const off = ([a, b]) => (a - x) ** 2 + (b - y) ** 2;
    return points.reduce((best, point, i) => (off(point) < off(points[best]) ? i : best), 0);
  }

  spot() {
    return this.figure.points.points[this.cursor] ?? null;
  }

  tell() {
    if (!this.outputs) return;
    this.place.textContent = `Point ${this.cursor + 1}`;
    this.figure.told.forEach(({ values }, i) => {
      this.outputs[i].textContent = reading(values[this.cursor], 6);
    });
  }
}
