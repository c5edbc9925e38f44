// The plots one above the other, with their common window, and what pointers, wheels and keys do to it.

import { MARGIN } from "page/axes.js";
import { Columns } from "page/columns.js";
import { listen, press } from "page/input.js";
import { Overview } from "page/overview.js";
import { Plot } from "page/plot.js";
import { onChange } from "page/theme.js";
import { nextFrame } from "page/work.js";

/** What there is to be drawn of a run. */
function plotsOf(run) {
  const { axes, limits } = run.header;
  const along = (title, unit, column, more = {}) => ({
    title, unit, curves: [{ name: "", ink: column, column }], ...more,
  });
  const list = [
    along("Feed", "mm/s", "feed", { hasCeilings: true, isTall: true }),
    along("Acceleration", "mm/s²", "acceleration", { limit: limits.accel_mm_s2 }),
    along("Jerk", "mm/s³", "jerk", { limit: limits.jerk_mm_s3 }),
    along("Snap", "mm/s⁴", "snap", { limit: limits.snap_mm_s4 }),
    along("Contour error", "µm", "contour"),
  ];
  // Axes that never moved have nothing to show, unless they failed.
  const moved = axes.map((axis, i) => ({ ...axis, i })).filter((axis) => axis.is_moved || run.header.faults.length);
  for (const [title, column, unitOf, limitOf] of [
    ["Following error", "error", (axis) => axis.thousandth, (axis) => axis.error_limit_um],
    ["Position", "position", (axis) => axis.unit, () => 0],
    ["Velocity", "velocity", (axis) => `${axis.unit}/s`, () => 0],
    ["Output", "volts", () => "V", () => 10],
  ]) {
    for (const unit of new Set(moved.map(unitOf))) {
      const of = moved.filter((axis) => unitOf(axis) === unit);
      list.push({
        title,
        unit,
        curves: of.map((axis) => ({ name: axis.name, ink: `series-${axis.i % 7}`, column: `${column} ${axis.i}` })),
        limit: Math.min(...of.map(limitOf)),
      });
    }
  }
  return list.filter((plot) => plot.curves.some((curve) => run.quantity(curve.column)));
}

export class Plots {
  constructor(state) {
    this.state = state;
    this.element = document.getElementById("plots");
    this.plots = plotsOf(state.run).map((plot) => new Plot(state, this.element, plot));
    this.overview = new Overview(state, document.getElementById("overview"));
    this.redraw = () => this.draw();
    this.retell = () => this.tell();
    const seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const plot = this.plots.find((each) => each.element === target);
        plot.isSeen = isIntersecting;
        if (isIntersecting && plot.isOld) nextFrame(this.redraw);
      }
    }, { rootMargin: "200px" });
    for (const plot of this.plots) {
      seen.observe(plot.element);
      this.listen(plot);
    }
    state.on("window", () => {
      this.age();
      nextFrame(this.redraw);
    });
    state.on("cursor", () => nextFrame(this.retell));
    const all = () => {
      this.age();
      this.overview.isOld = true;
    };
    const resized = new ResizeObserver(() => {
      all();
      nextFrame(this.redraw);
    });
    resized.observe(this.element);
    const forget = onChange(() => {
      all();
      // On paper all of them are seen.
      this.draw(true);
    });
    state.on("end", () => {
      seen.disconnect();
      resized.disconnect();
      forget();
    });
    this.element.addEventListener("keydown", (event) => this.key(event));
    this.age();
    nextFrame(this.redraw);
  }

  /** What is drawn is no longer what is to be seen. */
  age() {
    for (const plot of this.plots) plot.isOld = true;
  }

  /** The columns of the window, which all plots have. */
  columns() {
    const width = this.plots[0].area.clientWidth - MARGIN.left - MARGIN.right;
    return new Columns(this.state, width, window.devicePixelRatio || 1);
  }

  /** Draws what is old and seen. */
  draw(evenUnseen = false) {
    const due = this.plots.filter((plot) => plot.isOld && (plot.isSeen || evenUnseen));
    if (due.length) {
      for (const plot of due) plot.sheet.measure();
      const columns = this.columns();
      for (const plot of due) {
        plot.draw(columns);
        plot.isOld = false;
      }
    }
    this.overview.draw();
    this.tell();
  }

  /** The cursor's lines, and the values at it. */
  tell() {
    for (const plot of this.plots) {
      plot.place();
      plot.tell();
    }
    this.overview.place();
  }

  listen(plot) {
    const { state } = this;
    listen(plot.area, {
      point: (px, _, isSet) => {
        const tick = state.tickAt(state.run, plot.xAt(px));
        if (isSet) state.place(tick);
        else state.hover(tick);
      },
      leave: () => state.leave(),
      pan: (px) => state.pan(-px / plot.width),
      zoom: (px, _, factor) => state.zoom(plot.xAt(px), factor),
      showAll: () => state.showAll(),
      isWhole: () => state.isWhole(),
    });
  }

  key(event) {
    const { state } = this;
    const { run } = state;
    const far = Math.max(1, Math.round(Math.abs(state.tickAt(run, state.to) - state.tickAt(run, state.from)) / 50));
    const step = event.shiftKey ? far : run.ticksPerSample;
    const middle = () => {
      const at = state.xOf(run, state.cursor);
      return at >= state.from && at <= state.to ? at : (state.from + state.to) / 2;
    };
    press(event, {
      ArrowLeft: () => state.visit(state.cursor - step),
      ArrowRight: () => state.visit(state.cursor + step),
      Home: () => state.visit(0),
      End: () => state.visit(run.ticks - 1),
      "[": () => state.visit(run.tickOfNeighbour(state.cursor, -1)),
      "]": () => state.visit(run.tickOfNeighbour(state.cursor, 1)),
      "+": () => state.zoom(middle(), 0.5),
      "=": () => state.zoom(middle(), 0.5),
      "-": () => state.zoom(middle(), 2),
      PageUp: () => state.pan(-0.5),
      PageDown: () => state.pan(0.5),
      0: () => state.showAll(),
      Escape: () => state.showAll(),
    });
  }
}
