// The path: in space or in a plane, coloured by what holds there, with the actual path beside the set one.
//
// What is drawn are the corners of the coarsest picture that is within half a pixel of the path. A straight part between two
// corners may be driven at many feeds, so it is drawn in parts of some pixels, each with its own colour.

import { Camera } from "page/camera.js";
import { coloursOf } from "page/colours.js";
import { figure, marks, roundStep } from "page/format.js";
import { listen } from "page/path-input.js";
import { Sheet, clearText } from "page/sheet.js";
import { ink, onChange, shade } from "page/theme.js";
import { nextFrame, work } from "page/work.js";

/** Length of a part of one colour [px]; while the view moves, longer ones do. */
const PART_PX = 4;
const PART_MOVING_PX = 16;
/** How far parts of different colours overlap [px]: less than the distance that the path may be off. */
const SEAM_PX = 0.4;
/** A pointer finds the path from this near [px]. */
const NEAR_PX = 14;
/** Exaggerations of the error. */
const FACTORS = [0, 10, 30, 100, 300, 1000, 3000, 10000];

export class PathView {
  /** `kept` is what the reader chose of the path that was shown before, if there was one. */
  constructor(state, kept) {
    this.state = state;
    this.figure = document.getElementById("path");
    const { views } = state.run.header;
    if (views.length === 0 || state.run.outline.ticks.length === 0) {
      this.figure.hidden = true;
      return;
    }
    this.stage = this.figure.querySelector(".stage");
    this.sheet = new Sheet(this.stage);
    this.dot = this.stage.appendChild(document.createElement("i"));
    this.dot.className = "dot";
    this.colours = coloursOf(state.run);
    this.colour = this.colours.find(({ name }) => name === kept?.colour) ?? this.colours[0];
    this.factor = kept?.factor ?? 0;
    this.view = views.find(([name]) => name === kept?.view) ?? views[0];
    this.camera = new Camera(state.runs);
    this.makeTools(views);
    this.fit();
    if (kept?.pose && kept.view === this.view[0]) this.camera.take(kept.pose);
    listen(this);
    this.redraw = () => this.draw();
    state.on("cursor", () => nextFrame(() => this.place()));
    const resized = new ResizeObserver(() => {
      if (!this.camera.isMoved) this.fit();
      nextFrame(this.redraw);
    });
    resized.observe(this.stage);
    const forget = onChange(() => this.draw());
    state.on("end", () => {
      resized.disconnect();
      forget();
      clearTimeout(this.later);
    });
    nextFrame(this.redraw);
  }

  /** What the reader chose. */
  kept() {
    if (!this.camera) return null;
    const pose = this.camera.isMoved ? this.camera.pose() : null;
    return { colour: this.colour.name, factor: this.factor, view: this.view[0], pose };
  }

  makeTools(views) {
    const tools = this.figure.querySelector(".tools");
    const group = (name, items, chosen, choose) => {
      const box = tools.appendChild(document.createElement("div"));
      box.className = "choice";
      box.setAttribute("role", "group");
      box.setAttribute("aria-label", name);
      const buttons = items.map((item, i) => {
        const button = box.appendChild(document.createElement("button"));
        button.type = "button";
        button.textContent = item;
        button.setAttribute("aria-pressed", String(i === chosen));
        button.addEventListener("click", () => {
          for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
          choose(i);
        });
        return button;
      });
    };
    if (views.length > 1) {
      group("View", views.map(([name]) => name), views.indexOf(this.view), (i) => {
        this.view = views[i];
        this.camera.lookFromAbove();
        this.fit();
        nextFrame(this.redraw);
      });
    }
    group("Colour", this.colours.map((colour) => colour.name), this.colours.indexOf(this.colour), (i) => {
      this.colour = this.colours[i];
      nextFrame(this.redraw);
    });
    const label = tools.appendChild(document.createElement("label"));
    label.append("Actual path ");
    const select = label.appendChild(document.createElement("select"));
    for (const factor of FACTORS) select.append(new Option(factor ? `error × ${factor}` : "not shown", factor));
    select.value = this.factor;
    select.addEventListener("change", () => {
      this.factor = Number(select.value);
      nextFrame(this.redraw);
    });
    const whole = tools.appendChild(document.createElement("button"));
    whole.type = "button";
    whole.className = "whole";
    whole.textContent = "Fit";
    whole.addEventListener("click", () => this.showAll());
  }

  fit() {
    this.camera.fit(this.view[1], [this.stage.clientWidth, this.stage.clientHeight]);
  }

  showAll() {
    this.fit();
    nextFrame(this.redraw);
  }

  /** Draws all. While the view moves, coarser colours do. */
  draw(isMoving = false) {
    this.sheet.measure();
    const { width, height } = this.sheet.clear();
    if (width < 10) return;
    const { context } = this.sheet;
    const { state } = this;
    this.camera.size = [width, height];
    this.project = this.camera.projection();
    if (this.camera.isInSpace) this.drawTriad(context);
    else this.drawGrid(context);
    this.parts = [];
    for (const run of state.runs.slice(1)) this.drawPlain(context, run, "axis", 0);
    this.drawColoured(context, isMoving ? PART_MOVING_PX : PART_PX);
    if (this.factor) this.drawPlain(context, state.run, "error", this.factor);
    this.drawEnds(context);
    this.tellLegend();
    this.place();
    // Colours in full when the view has come to rest.
    clearTimeout(this.later);
    if (isMoving) this.later = setTimeout(() => nextFrame(this.redraw), 120);
  }

  /** Calls `part` with ends on the screen and ticks of every part of the path that may be seen, in order. */
  walk(run, partPx, part) {
    const { outline } = run;
    const { axes, size: [width, height] } = this.camera;
    const corners = outline.within(this.camera.toleranceMm);
    // Another machine may lack an axis.
    if (corners.length === 0 || axes.some((axis) => outline.places[axis] === null)) return;
    const place = [];
    const at = (i) => {
      for (const axis of axes) place[axis] = outline.places[axis][i];
      return this.project(place);
    };
    let from = at(corners[0]);
    for (let n = 1; n < corners.length; n += 1) {
      const [i, j] = [corners[n - 1], corners[n]];
      const to = at(j);
      const isSeen = Math.max(from[0], to[0]) > -9 && Math.min(from[0], to[0]) < width + 9 &&
        Math.max(from[1], to[1]) > -9 && Math.min(from[1], to[1]) < height + 9;
      if (isSeen) {
        const [start, end] = [outline.ticks[i], outline.ticks[j]];
        const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
        const count = Math.max(1, Math.min(Math.ceil(length / partPx), Math.ceil((end - start) / run.ticksPerSample), 4000));
        let [x, y, tick] = [from[0], from[1], start];
        for (let k = 1; k <= count; k += 1) {
          work.parts += 1;
          const next = k === count ? end : start + ((end - start) * k) / count;
          const share = k === count ? 1 : run.partBetween(start, end, next);
          const [px, py] = [from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share];
          part(x, y, px, py, tick, next);
          [x, y, tick] = [px, py, next];
        }
      }
      from = to;
    }
  }

  drawColoured(context, partPx) {
    const { run } = this.state;
    const { blocks } = run;
    const lines = new Map();
    let [last, lastX, lastY] = [null, NaN, NaN];
    this.hasRapids = false;
    this.walk(run, partPx, (x0, y0, x1, y1, from, to) => {
      this.parts.push(x0, y0, x1, y1, from, to);
      const isRapid = blocks.count > 0 && blocks.isRapid[run.blockAt(run.pathMm((from + to) / 2))] === 1;
      const number = isRapid ? "rapid" : Math.max(0, this.colour.classOf(from, to) || 0);
      if (!lines.has(number)) lines.set(number, new Path2D());
      const line = lines.get(number);
      if (number !== last || x0 !== lastX || y0 !== lastY) {
        // A little into the part before, or the paper shows between them.
        const overlap = SEAM_PX / Math.max(SEAM_PX, Math.hypot(x1 - x0, y1 - y0));
        line.moveTo(x0 - (x1 - x0) * overlap, y0 - (y1 - y0) * overlap);
      }
      line.lineTo(x1, y1);
      [last, lastX, lastY] = [number, x1, y1];
    });
    // Round ends would reach into parts of another colour.
    context.lineCap = "butt";
    context.lineJoin = "round";
    const rapid = lines.get("rapid");
    if (rapid) {
      this.hasRapids = true;
      lines.delete("rapid");
      context.strokeStyle = ink("axis");
      context.lineWidth = 1;
      context.setLineDash([5, 4]);
      context.stroke(rapid);
      context.setLineDash([]);
    }
    context.lineWidth = 2.2;
    for (const [number, line] of [...lines].sort((a, b) => a[0] - b[0])) {
      context.strokeStyle = this.colour.inkOf(number);
      context.stroke(line);
    }
  }

  /** A path in one colour; the actual one with its error times `factor`, or the set one. */
  drawPlain(context, run, name, factor) {
    const { axes, scale } = this.camera;
    const errors = axes.map((axis) => run.quantity(`error ${axis}`));
    const directions = this.camera.directions();
    const off = (tick) => {
      let [dx, dy] = [0, 0];
      const sample = run.sampleOf(tick);
      errors.forEach((error, i) => {
        if (!factor || !error?.range(sample, sample + 1)) return;
        // Set minus actual; a sample of several ticks is drawn in the middle of its range.
        const px = ((error.low + error.high) / -2) * 1e-3 * factor * scale;
        dx += directions[i][0] * px;
        dy += directions[i][1] * px;
      });
      return [dx, dy];
    };
    const line = new Path2D();
    let [lastX, lastY] = [NaN, NaN];
    this.walk(run, factor ? PART_PX : 1e9, (x0, y0, x1, y1, from, to) => {
      if (x0 !== lastX || y0 !== lastY) {
        const [dx, dy] = off(from);
        line.moveTo(x0 + dx, y0 + dy);
      }
      const [dx, dy] = off(to);
      line.lineTo(x1 + dx, y1 + dy);
      [lastX, lastY] = [x1, y1];
    });
    context.strokeStyle = ink(name);
    context.lineWidth = factor ? 1.2 : 1.6;
    context.stroke(line);
  }

  /** Round places of the plane, and their coordinates. */
  drawGrid(context) {
    const { axes, pivot, offset, scale, size: [width, height] } = this.camera;
    const { header } = this.state.run;
    const low = [pivot[0] - (width / 2 + offset[0]) / scale, pivot[1] - (height / 2 - offset[1]) / scale];
    const high = [low[0] + width / scale, low[1] + height / scale];
    const text = (value, decimals) => (Math.abs(value) < 1e-9 ? "0" : value.toFixed(decimals).replace("-", "−"));
    context.lineWidth = 1;
    context.strokeStyle = ink("grid");
    const step = roundStep(width / scale, width / 80);
    for (const [way, size] of [[0, width], [1, height]]) {
      const { values, decimals } = marks(low[way], high[way], (high[way] - low[way]) / step);
      for (const value of values) {
        const px = way === 0 ? (value - low[0]) * scale : height - (value - low[1]) * scale;
        const at = Math.round(px) + 0.5;
        context.beginPath();
        context.moveTo(way ? 0 : at, way ? at : 0);
        context.lineTo(way ? width : at, way ? at : height);
        context.stroke();
        context.fillStyle = ink("soft");
        context.textAlign = way ? "left" : "center";
        context.textBaseline = way ? "middle" : "alphabetic";
        // Corners are for the names of the axes.
        if (px > 24 && px < size - (way ? 24 : 60)) {
          clearText(context, text(value, decimals), way ? 4 : at, way ? at - 7 : height - 5);
        }
      }
    }
    context.fillStyle = ink("text");
    context.textBaseline = "alphabetic";
    context.textAlign = "right";
    clearText(context, `${header.axes[axes[0]].name} [mm]`, width - 5, height - 5);
    context.textAlign = "left";
    clearText(context, `${header.axes[axes[1]].name} [mm]`, 4, 14);
  }

  /** Where the axes point, and how long a round length is. */
  drawTriad(context) {
    const { axes, scale, size: [width, height] } = this.camera;
    const directions = this.camera.directions();
    const { header } = this.state.run;
    const [x, y, length] = [42, height - 42, 28];
    context.lineWidth = 1.5;
    context.textAlign = "center";
    context.textBaseline = "middle";
    axes.forEach((axis, i) => {
      const [dx, dy] = directions[i];
      context.strokeStyle = ink("axis");
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + length * dx, y + length * dy);
      context.stroke();
      context.fillStyle = ink("text");
      context.fillText(header.axes[axis].name, x + (length + 9) * dx, y + (length + 9) * dy);
    });
    const bar = roundStep(90 / scale, 1);
    const long = Math.min(bar, bar / Math.ceil((bar * scale) / 160)) * scale;
    const mm = long / scale;
    const right = width - 14;
    context.strokeStyle = ink("axis");
    context.beginPath();
    context.moveTo(right - long, height - 20);
    context.lineTo(right - long, height - 14);
    context.lineTo(right, height - 14);
    context.lineTo(right, height - 20);
    context.stroke();
    context.fillStyle = ink("soft");
    context.textAlign = "right";
    context.fillText(`${figure(mm, 3)} mm`, right, height - 28);
  }

  /** Start: a ring; end: a square; faults: crosses. */
  drawEnds(context) {
    const { run } = this.state;
    const at = (tick) => this.project(run.placeAt(tick));
    context.strokeStyle = ink("text");
    context.fillStyle = ink("text");
    context.lineWidth = 1.6;
    const [sx, sy] = at(0);
    context.beginPath();
    context.arc(sx, sy, 5, 0, 7);
    context.stroke();
    const [ex, ey] = at(run.ticks - 1);
    context.fillRect(ex - 3, ey - 3, 6, 6);
    context.strokeStyle = ink("fault");
    context.lineWidth = 2.4;
    for (const { tick } of run.header.faults) {
      const [x, y] = at(tick - run.firstTick);
      context.beginPath();
      context.moveTo(x - 7, y - 7);
      context.lineTo(x + 7, y + 7);
      context.moveTo(x - 7, y + 7);
      context.lineTo(x + 7, y - 7);
      context.stroke();
    }
  }

  tellLegend() {
    const { run, runs } = this.state;
    const entries = this.colour.legend();
    if (this.hasRapids) entries.push({ ink: "axis", name: "rapid", isDashed: true });
    if (this.factor) entries.push({ ink: "error", name: `actual, error × ${this.factor}` });
    if (runs.length > 1) entries.push({ ink: "axis", name: runs[1].header.program });
    const items = entries.map((entry) => {
      const item = document.createElement("li");
      if (entry.isScale) {
        item.className = "scale";
        const bar = document.createElement("i");
        bar.style.background = `linear-gradient(90deg,${[0, 0.2, 0.4, 0.6, 0.8, 1].map(shade).join(",")})`;
        item.append(entry.from, bar, entry.to);
      } else {
        item.style.setProperty("--key", `var(--${entry.ink})`);
        if (entry.isDashed) item.className = "dashed";
        item.textContent = entry.name;
      }
      return item;
    });
    this.figure.querySelector(".legend").replaceChildren(...items);
    const finest = figure(run.outline.toleranceMm * 1e3, 2);
    const words = `${this.colour.words} Ring: start; square: end${run.header.faults.length ? "; cross: fault" : ""}.`;
    this.figure.querySelector("figcaption").textContent =
      `${words} Drawn within half a pixel; the data hold the path within ${finest} µm, where zooming ends.`;
  }

  /** Moves the dot to the cursor. */
  place() {
    if (!this.project) return;
    const { run, cursor } = this.state;
    const [x, y] = this.project(run.placeAt(cursor));
    const [width, height] = this.camera.size;
    this.dot.hidden = !(x > -6 && y > -6 && x < width + 6 && y < height + 6);
    if (!this.dot.hidden) this.dot.style.transform = `translate(${x}px,${y}px)`;
  }

  /** The tick of the path nearest to a place of the stage; undefined if none is near. */
  tickNear(x, y) {
    const { run } = this.state;
    const { parts } = this;
    let [nearest, found] = [NEAR_PX ** 2, null];
    for (let i = 0; i < parts.length; i += 6) {
      const [dx, dy] = [parts[i + 2] - parts[i], parts[i + 3] - parts[i + 1]];
      const square = dx * dx + dy * dy;
      const along = (x - parts[i]) * dx + (y - parts[i + 1]) * dy;
      const share = square > 0 ? Math.min(1, Math.max(0, along / square)) : 0;
      const away = (x - parts[i] - share * dx) ** 2 + (y - parts[i + 1] - share * dy) ** 2;
      if (away < nearest) [nearest, found] = [away, { share, from: parts[i + 4], to: parts[i + 5] }];
    }
    return found ? run.tickBetween(found.from, found.to, found.share) : undefined;
  }

  /** Draws what the camera sees now, in full when it has come to rest. */
  move() {
    this.redrawMoving ??= () => this.draw(true);
    nextFrame(this.redrawMoving);
  }
}
