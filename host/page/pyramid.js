// The lowest and highest number of any range, from few looks.
//
// Each level has a quarter of the numbers of the one below: the lowest and the highest of four. A range is made of whole
// quarters as far as it can be, so it has the extremes of its numbers, no peak is lost and none is invented.

import { work } from "page/work.js";

const PARTS = 4;

export class Pyramid {
  /** `low` and `high` may be one array. A number without a value has a low above its high. */
  constructor(low, high) {
    this.length = low.length;
    this.levels = [{ low, high }];
    for (let below = this.levels[0]; below.low.length >= PARTS; below = this.levels.at(-1)) {
      // What is left over at the end belongs to no quarter, and is never asked for as one.
      const count = Math.floor(below.low.length / PARTS);
      const level = { low: new Int32Array(count), high: new Int32Array(count) };
      for (let i = 0; i < count; i += 1) {
        let [least, most] = [below.low[PARTS * i], below.high[PARTS * i]];
        for (let j = PARTS * i + 1; j < PARTS * (i + 1); j += 1) {
          if (below.low[j] < least) least = below.low[j];
          if (below.high[j] > most) most = below.high[j];
        }
        level.low[i] = least;
        level.high[i] = most;
      }
      this.levels.push(level);
    }
    this.low = 0;
    this.high = 0;
  }

  /** Sets `low` and `high` to the extremes from `from` to before `to`; false if there is no value. */
  range(from, to) {
    let [least, most] = [0x7fffffff, -0x80000000];
    for (let level = 0; from < to; level += 1) {
      const { low, high } = this.levels[level];
      const isTop = level + 1 === this.levels.length;
      const take = (i) => {
        work.samples += 1;
        if (low[i] < least) least = low[i];
        if (high[i] > most) most = high[i];
      };
      while (from < to && (isTop || from % PARTS !== 0)) take(from++);
      while (from < to && to % PARTS !== 0) take(--to);
      from /= PARTS;
      to /= PARTS;
    }
    this.low = least;
    this.high = most;
    return least <= most;
  }

  /** The first place from `from` to before `to` with the lowest number. */
  lowest(from, to) {
    if (to - from <= 1 || !this.range(from, to)) return from;
    const wanted = this.low;
    while (to - from > 1) {
      const middle = (from + to) >> 1;
      if (this.range(from, middle) && this.low === wanted) to = middle;
      else from = middle;
    }
    return from;
  }
}
