// A run: its quantities by tick, and what is where by time, path position and line.
//
// Ticks are counted from the run's first one. A quantity is known sample by sample, of `ticksPerSample` ticks each.

import { Pyramid } from "page/pyramid.js";
import { lastNotAbove } from "page/sorted.js";

/** A quantity over time. */
class Quantity {
  constructor(data, name) {
    const low = data.numbers(name);
    const high = data.has(`${name}+`) ? data.numbers(`${name}+`) : low;
    this.isExact = high === low;
    if (this.isExact) {
      // A tick without a value has a low above its high, too.
      const none = 0x7fffffff;
      this.pyramid = new Pyramid(low, low.includes(none) ? low.map((n) => (n === none ? -none - 1 : n)) : low);
    } else {
      this.pyramid = new Pyramid(low, high);
    }
    this.step = data.step(name);
    this.low = NaN;
    this.high = NaN;
  }

  /** Sets `low` and `high` to the extremes of the samples from `from` to before `to`; false if they have no value. */
  range(from, to) {
    const found = this.pyramid.range(from, to);
    this.low = found ? this.pyramid.low * this.step : NaN;
    this.high = found ? this.pyramid.high * this.step : NaN;
    return found;
  }
}

/** The path's corners. */
class Outline {
  constructor(data) {
    this.ticks = data.numbers("vertex tick");
    this.ranks = data.numbers("vertex rank");
    this.places = data.header.axes.map((axis, i) => (data.has(`vertex ${i}`) ? data.values(`vertex ${i}`) : null));
    this.toleranceMm = data.header.tolerance_mm;
    this.levels = [];
  }

  /** The corners of the coarsest picture that is within `toleranceMm`; the finest one there is, if none is. */
  within(toleranceMm) {
    const level = Math.max(0, Math.floor(Math.log2(toleranceMm / this.toleranceMm)));
    const known = Math.min(level, 47);
    this.levels[known] ??= Int32Array.from(this.ranks.keys()).filter((i) => this.ranks[i] > known);
    return this.levels[known];
  }
}

export class Run {
  constructor(data, program) {
    const { header } = data;
    this.header = header;
    this.program = program;
    this.tickS = header.tick_s;
    this.firstTick = header.first_tick;
    this.ticks = header.ticks;
    this.ticksPerSample = header.ticks_per_sample;
    this.samples = Math.ceil(this.ticks / this.ticksPerSample);
    this.quantities = new Map();
    this.data = data;
    this.visitTicks = data.numbers("visit tick");
    this.visitLines = data.numbers("visit line");
    this.outline = new Outline(data);
    const block = (name) => data.values(`block ${name}`);
    this.blocks = {
      start: block("start"), ceiling: block("ceiling"), enter: block("enter"), peak: block("peak"), exit: block("exit"),
      time: block("time"), line: block("line"), isRapid: block("rapid"), reason: block("reason"), kind: block("kind"),
      count: Math.max(0, block("start").length - 1),
    };
    const ceilings = data.numbers("block ceiling");
    this.ceilings = new Pyramid(ceilings, ceilings);
    this.ceilingStep = data.step("block ceiling");
  }

  /** Numbers its axes as another run does, so that axes of one name lie on each other. */
  matchAxes(other) {
    const own = this.header.axes;
    this.axes = other.header.axes.map(({ name }) => own.findIndex((axis) => axis.name === name));
    this.outline.places = this.axes.map((axis) => this.outline.places[axis] ?? null);
  }

  /** A quantity by the name of its column; null if the run has none. */
  quantity(name) {
    if (!this.quantities.has(name)) {
      const [of, axis] = name.split(" ");
      const column = this.axes && axis ? `${of} ${this.axes[axis]}` : name;
      this.quantities.set(name, this.data.has(column) ? new Quantity(this.data, column) : null);
    }
    return this.quantities.get(name);
  }

  /** The sample of a tick. */
  sampleOf(tick) {
    return Math.min(this.samples - 1, Math.max(0, Math.floor(tick / this.ticksPerSample)));
  }

  /** Path position at a tick [mm]. */
  pathMm(tick) {
    const s = this.quantity("s");
    const sample = this.sampleOf(tick);
    if (!s.range(sample, sample + 1)) return NaN;
    // Within a sample the path is taken to go on evenly.
    const part = this.ticksPerSample === 1 ? 0 : tick / this.ticksPerSample - sample;
    return s.low + (s.high - s.low) * Math.min(1, Math.max(0, part));
  }

  /** The first tick at which the path has come to a position. */
  tickAtPath(mm) {
    const s = this.quantity("s");
    const { low, high } = s.pyramid.levels[0];
    let [from, to] = [0, this.samples];
    while (from < to) {
      const middle = (from + to) >> 1;
      if (high[middle] * s.step < mm) from = middle + 1;
      else to = middle;
    }
    if (from >= this.samples) return this.ticks - 1;
    const [start, end] = [low[from] * s.step, high[from] * s.step];
    const part = end > start ? Math.max(0, (mm - start) / (end - start)) : 0;
    return Math.min(this.ticks - 1, (from + part) * this.ticksPerSample);
  }

  timeS(tick) {
    return (this.firstTick + tick) * this.tickS;
  }

  tickAtTime(s) {
    return Math.round(s / this.tickS) - this.firstTick;
  }

  /** The line of the program at a tick; 0 before the first one. */
  lineAt(tick) {
    const visit = lastNotAbove(this.visitTicks, tick);
    return visit < 0 ? 0 : this.visitLines[visit];
  }

  /** The tick at which the path first comes to a line; undefined if it never does. */
  tickOfLine(line) {
    const visit = this.visitLines.indexOf(line);
    return visit < 0 ? undefined : this.visitTicks[visit];
  }

  /** The tick at which the path comes to the next line, or the one before. */
  tickOfNeighbour(tick, direction) {
    const visit = lastNotAbove(this.visitTicks, tick) + direction;
    return this.visitTicks[Math.min(this.visitTicks.length - 1, Math.max(0, visit))] ?? tick;
  }

  /** The block at a path position; −1 if there are none. */
  blockAt(mm) {
    return Math.min(this.blocks.count - 1, Math.max(0, lastNotAbove(this.blocks.start, mm)));
  }

  /** The reason of a block's ceiling: its name and its ink. */
  reasonOf(block) {
    const [name, ink] = this.header.reasons[this.blocks.reason[block]];
    return { name, ink };
  }

  /** Set position of the path's axes at a tick, by axis; null for axes that are not on it. */
  placeAt(tick) {
    const { ticks, places } = this.outline;
    if (ticks.length === 0) return places.map(() => null);
    const before = Math.min(ticks.length - 1, Math.max(0, lastNotAbove(ticks, tick)));
    const after = Math.min(ticks.length - 1, before + 1);
    const part = this.partBetween(ticks[before], ticks[after], tick);
    return places.map((values) => values && values[before] + (values[after] - values[before]) * part);
  }

  /** How far along the path between two ticks a third one is, 0 to 1. */
  partBetween(from, to, tick) {
    if (to <= from) return 0;
    const [start, end] = [this.pathMm(from), this.pathMm(to)];
    const part = end > start ? (this.pathMm(tick) - start) / (end - start) : (tick - from) / (to - from);
    return Math.min(1, Math.max(0, part));
  }

  /** The tick between two others that has come so far along the path between them, 0 to 1. */
  tickBetween(from, to, part) {
    const [start, end] = [this.pathMm(from), this.pathMm(to)];
    if (!(end > start)) return from + part * (to - from);
    return Math.min(to, Math.max(from, this.tickAtPath(start + part * (end - start))));
  }
}
