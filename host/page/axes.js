// One pair of axes on canvas, with the values at the cursor above it.

import { make } from "page/dom.js";
import { decades, fixed, marks, roundStep, scientific } from "page/format.js";
import { Sheet } from "page/sheet.js";
import { dashes, ink } from "page/theme.js";

/** Space around the area of a plot [px]. */
export const MARGIN = { left: 66, right: 10, top: 6, bottom: 20 };
/** Width of a curve [px]. */
export const CURVE_WIDTH = 1.4;
/** The part of its limit from which on a plot shows the limit; below it the curve would be flat. */
export const LIMIT_SHOWN_FROM = 0.2;
/** Steps of an axis from which on its marks have exponents. */
const [SMALL, LARGE] = [1e-4, 1e7];

export class Axes {
  /** `span` is the window of the horizontal axis: `from` and `to`, logarithms of what is marked if the axis `isLogarithmic`. */
  constructor(parent, span, { title, unit, isTall = false, isLogarithmic = false }) {
    Object.assign(this, { span, title, unit, isLogarithmic });
    this.values = make("span", { class: "values" });
    this.area = make("div", { class: "area" });
    this.element = make("figure", { class: isTall ? "plot tall" : "plot" },
      make("figcaption", {}, make("b", {}, `${title} `), unit ? `[${unit}]` : "", this.values), this.area);
    parent.append(this.element);
    this.sheet = new Sheet(this.area);
    this.line = make("i", { class: "cursor" });
    this.area.append(this.line);
  }

  /** Adds a place for the value of a curve, with its key: a line, "dashed", or "dots". */
  addValue(name, of, kind = "") {
    const key = make("i", { style: `--key:var(--${of})`, class: kind });
    const output = make("output");
    this.values.append(make("span", { class: "value" }, key, name ? `${name} ` : "", output));
    return output;
  }

  /** Where x lies, in pixels from the left. */
  px(x) {
    const { from, to } = this.span;
    return MARGIN.left + ((x - from) / (to - from)) * this.width;
  }

  /** x at so many pixels from the left of the plot's area. */
  xAt(px) {
    const { from, to } = this.span;
    return from + ((px - MARGIN.left) / Math.max(1, this.width)) * (to - from);
  }

  py(value) {
    return MARGIN.top + ((this.high - value) / (this.high - this.low)) * this.height;
  }

  /** Empties the sheet; false if there is no room to draw. */
  begin() {
    const { width, height, scale } = this.sheet.clear();
    this.width = width - MARGIN.left - MARGIN.right;
    this.height = height - MARGIN.top - MARGIN.bottom;
    this.scale = scale;
    return this.width >= 10 && this.height >= 10;
  }

  drawAxes(context) {
    const { from, to } = this.span;
    const bottom = MARGIN.top + this.height;
    const snap = (px) => (Math.round(px * this.scale) + 0.5) / this.scale;
    context.lineWidth = 1 / this.scale;
    context.textBaseline = "middle";
    context.textAlign = "right";
    const rows = marks(this.low, this.high, this.height / 24);
    for (const value of rows.values) {
      const y = snap(this.py(value));
      context.strokeStyle = ink(Math.abs(value) < 1e-9 * (this.high - this.low) ? "axis" : "grid");
      context.beginPath();
      context.moveTo(MARGIN.left, y);
      context.lineTo(MARGIN.left + this.width, y);
      context.stroke();
      context.fillStyle = ink("soft");
      context.fillText(label(value, rows), MARGIN.left - 6, y);
    }
    context.textAlign = "center";
    const columns = this.isLogarithmic ? decades(from, to, this.width / 45) : marks(from, to, this.width / 90);
    for (const value of columns.values) {
      const x = snap(this.px(this.isLogarithmic ? Math.log10(value) : value));
      context.strokeStyle = ink("grid");
      context.beginPath();
      context.moveTo(x, MARGIN.top);
      context.lineTo(x, bottom);
      context.stroke();
      const text = label(value, columns);
      const half = context.measureText(text).width / 2;
      const right = MARGIN.left + this.width + MARGIN.right - half - 1;
      context.fillStyle = ink("soft");
      context.fillText(text, Math.min(right, x), bottom + 12);
    }
    context.strokeStyle = ink("axis");
    context.strokeRect(snap(MARGIN.left), snap(MARGIN.top), this.width, this.height);
  }

  /** Draws within the axes. */
  clipped(context, draw) {
    context.save();
    context.beginPath();
    context.rect(MARGIN.left, MARGIN.top - 2, this.width, this.height + 4);
    context.clip();
    draw();
    context.restore();
  }

  /** Draws levels as limits. */
  drawLevels(context, levels) {
    context.strokeStyle = ink("limit");
    context.lineWidth = 1;
    context.setLineDash(dashes("limit"));
    for (const level of levels) {
      context.beginPath();
      context.moveTo(MARGIN.left, this.py(level));
      context.lineTo(MARGIN.left + this.width, this.py(level));
      context.stroke();
    }
    context.setLineDash([]);
  }

  /** Moves the cursor's line to x. */
  placeLine(x) {
    const px = this.px(x);
    const isIn = px >= MARGIN.left - 0.5 && px <= MARGIN.left + this.width + 0.5;
    this.line.hidden = !isIn;
    if (isIn) this.line.style.transform = `translateX(${px}px)`;
  }
}

function label(value, { decimals, values, isOwn }) {
  if (isOwn) return scientificOr(value, value, Math.max(0, -Math.floor(Math.log10(value) + 1e-9)));
  const step = values.length > 1 ? values[1] - values[0] : roundStep(Math.abs(value) || 1, 1);
  return Math.abs(value) < 1e-9 * step ? "0" : scientificOr(value, step, decimals);
}

const scientificOr = (value, step, decimals) => (step < SMALL || step >= LARGE ? scientific(value, 3) : fixed(value, decimals));
