// What the columns of pixels of a window show: all plots have the same ones.
//
// A column shows the lowest and the highest value of the ticks it spans. Where a tick is wider than a column, a curve goes
// straight from tick to tick.

import { MARGIN } from "page/axes.js";
import { work } from "page/work.js";

export class Columns {
  /** Of plots whose area has a width [px] on a screen with `scale` pixels to each. */
  constructor(state, width, scale) {
    Object.assign(this, { state, width, scale });
    this.count = Math.max(1, Math.round(width * scale));
    /** The ticks that columns begin at, for every run; and the one that the last column ends at. */
    this.edges = state.runs.map((run) => {
      const ticks = new Float64Array(this.count + 1);
      for (let i = 0; i <= this.count; i += 1) {
        const x = this.xAt(i);
        ticks[i] = state.over === "time" ? x / run.tickS - run.firstTick : run.tickAtPath(x);
      }
      return ticks;
    });
  }

  /** x at the beginning of a column. */
  xAt(column) {
    return this.state.from + ((this.state.to - this.state.from) * column) / this.count;
  }

  /** Whether a column is before a run or behind its end. */
  isOutside(run, ticks, column) {
    const [from, to] = [ticks[column], ticks[column + 1]];
    const last = run.ticks - 1;
    // Behind the end of its path every position has its last tick.
    return to < 0 || from > last || (this.state.over === "path" && from === to && from === last);
  }

  /** A run's curve: `points` with x [px], lowest and highest value, in pieces that begin at `starts`. */
  curve(number, column) {
    const { state, count, scale } = this;
    const run = state.runs[number];
    const quantity = run.quantity(column);
    if (!quantity) return null;
    const ticks = this.edges[number];
    const points = [];
    // There are gaps where ticks are missing.
    const starts = [];
    let isGap = true;
    const add = (px, isKnown) => {
      work.columns += 1;
      if (isKnown) {
        if (isGap) starts.push(points.length);
        points.push([px, quantity.low, quantity.high]);
      }
      isGap = !isKnown;
    };
    const ticksPerColumn = (ticks[count] - ticks[0]) / count;
    if (run.ticksPerSample === 1 && ticksPerColumn < 1) {
      const first = Math.max(0, Math.floor(ticks[0]) - 1);
      const last = Math.min(run.ticks - 1, Math.ceil(ticks[count]) + 1);
      const pxPerX = this.width / (state.to - state.from);
      for (let tick = first; tick <= last; tick += 1) {
        add(MARGIN.left + (state.xOf(run, tick) - state.from) * pxPerX, quantity.range(tick, tick + 1));
      }
    } else {
      for (let i = 0; i < count; i += 1) {
        if (this.isOutside(run, ticks, i)) continue;
        const from = run.sampleOf(ticks[i]);
        const to = Math.max(from + 1, Math.ceil(ticks[i + 1] / run.ticksPerSample));
        add(MARGIN.left + (i + 0.5) / scale, quantity.range(from, Math.min(run.samples, to)));
      }
    }
    return { points, starts };
  }

  /** The ceilings of the page's own run: where the same ones hold, the lowest with its reason, and the highest. */
  ceilings() {
    const { state, count, scale } = this;
    const { run } = state;
    const steps = [];
    if (run.blocks.count === 0) return steps;
    const [ticks] = this.edges;
    const pathMm = (column) => (state.over === "path" ? this.xAt(column) : run.pathMm(ticks[column]));
    let before = -1;
    for (let i = 0; i < count; i += 1) {
      if (this.isOutside(run, ticks, i)) continue;
      const first = run.blockAt(pathMm(i));
      const last = Math.max(first, run.blockAt(pathMm(i + 1)));
      const px = MARGIN.left + i / scale;
      if (first === last && first === before) {
        steps.at(-1).to = px + 1 / scale;
        continue;
      }
      before = first === last ? first : -1;
      run.ceilings.range(first, last + 1);
      const [low, high] = [run.ceilings.low * run.ceilingStep, run.ceilings.high * run.ceilingStep];
      const reason = run.reasonOf(run.ceilings.lowest(first, last + 1));
      steps.push({ from: px, to: px + 1 / scale, low, high, reason });
    }
    return steps;
  }
}
