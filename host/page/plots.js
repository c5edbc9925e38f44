// The plots one above the other, with their common window, and what pointers, wheels and keys do to it.

import { Plot, MARGIN, Sheet, columnsOf } from "page/plot.js";
import { ink, onChange } from "page/theme.js";
import { nextFrame, work } from "page/work.js";

/** Time after a scroll of the page in which the wheel goes on scrolling it [ms]. */
const SCROLL_GOES_ON_MS = 350;
/** Zoom of a notch of the wheel, as a power of 2. */
const ZOOM_PER_NOTCH = 0.35;
/** Pixels of a notch. */
const NOTCH_PX = 100;

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
    this.scrolledAt = -Infinity;
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
      for (const plot of this.plots) plot.isOld = true;
      nextFrame(this.redraw);
    });
    state.on("cursor", () => nextFrame(this.retell));
    const all = () => {
      for (const plot of this.plots) plot.isOld = true;
      this.overview.isOld = true;
      nextFrame(this.redraw);
    };
    new ResizeObserver(all).observe(this.element);
    onChange(() => {
      // On paper all of them are seen.
      for (const plot of this.plots) plot.isOld = true;
      this.overview.isOld = true;
      this.draw(true);
    });
    this.element.addEventListener("keydown", (event) => this.key(event));
    all();
  }

  /** The columns of the window, which all plots have. */
  columns() {
    const width = this.plots[0].area.clientWidth - MARGIN.left - MARGIN.right;
    return columnsOf(this.state, width, window.devicePixelRatio || 1);
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
    const { area } = plot;
    const fingers = new Map();
    let drag = null;
    const x = (event) => plot.xAt(event.clientX - area.getBoundingClientRect().left);
    const tick = (event) => state.tickAt(state.run, x(event));
    area.addEventListener("pointerdown", (event) => {
      if (event.button > 1) return;
      area.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, event.clientX);
      if (fingers.size === 2) {
        drag = { pinch: spread(fingers), from: state.from, to: state.to, at: plot.xAt(middle(fingers) - area.getBoundingClientRect().left) };
      } else if (event.shiftKey || event.button === 1) {
        drag = { panFrom: event.clientX, from: state.from, to: state.to };
        event.preventDefault();
      } else {
        drag = { isCursor: true };
        state.place(tick(event));
      }
      this.element.focus({ preventScroll: true });
    });
    area.addEventListener("pointermove", (event) => {
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, event.clientX);
      if (drag?.pinch) {
        const factor = drag.pinch / Math.max(10, spread(fingers));
        const width = (drag.to - drag.from) * factor;
        const from = drag.at - ((drag.at - drag.from) / (drag.to - drag.from)) * width;
        state.show(from, from + width);
      } else if (drag?.panFrom !== undefined) {
        const by = ((drag.panFrom - event.clientX) / plot.width) * (drag.to - drag.from);
        state.show(drag.from + by, drag.to + by);
      } else if (drag?.isCursor) {
        state.place(tick(event));
      } else if (event.pointerType === "mouse") {
        state.hover(tick(event));
      }
    });
    const end = (event) => {
      fingers.delete(event.pointerId);
      drag = null;
    };
    area.addEventListener("pointerup", end);
    area.addEventListener("pointercancel", end);
    area.addEventListener("pointerleave", () => drag || state.leave());
    area.addEventListener("dblclick", () => state.showAll());
    area.addEventListener("wheel", (event) => this.wheel(event, x(event)), { passive: false });
  }

  /** Zooms, or moves the window where the wheel goes sideways. A page that scrolls already goes on scrolling. */
  wheel(event, x) {
    const { state } = this;
    const unit = event.deltaMode === 0 ? 1 : 33;
    const [dx, dy] = [event.deltaX * unit, event.deltaY * unit];
    const scrolls = performance.now() - this.scrolledAt < SCROLL_GOES_ON_MS || (dy > 0 && state.isWhole());
    if (!event.ctrlKey && scrolls && Math.abs(dx) <= Math.abs(dy)) {
      this.scrolledAt = performance.now();
      return;
    }
    event.preventDefault();
    if (Math.abs(dx) > Math.abs(dy)) state.pan(dx / 800);
    else state.zoom(x, 2 ** ((ZOOM_PER_NOTCH * dy) / NOTCH_PX));
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
    const actions = {
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
    };
    if (!(event.key in actions) || event.ctrlKey || event.metaKey || event.altKey) return;
    actions[event.key]();
    event.preventDefault();
  }
}

const spread = (fingers) => {
  const [a, b] = fingers.values();
  return Math.abs(a - b);
};
const middle = (fingers) => {
  const [a, b] = fingers.values();
  return (a + b) / 2;
};

/** The feed of the whole run, with the window of the plots on it. */
class Overview {
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
      state.zoom(at(event), 2 ** ((ZOOM_PER_NOTCH * event.deltaY) / NOTCH_PX));
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
