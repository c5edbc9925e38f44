// Where a machine is on a run that was planned: its tick there, by the machine's position.

/** A machine that is this near is on the path [mm]. */
const NEAR_MM = 0.05;
/** Corners to look through from where it was, before all of them, and how often all of them [ms]. */
const AHEAD = 400;
const ALL_EVERY_MS = 500;

export class Follower {
  constructor(run) {
    this.run = run;
    this.at = 0;
    this.lookedMs = 0;
  }

  /** The tick of the place of `line` that is nearest to `position`, by axis; undefined where it is off the path. */
  tick(position, line) {
    const { ticks } = this.run.outline;
    const last = ticks.length - 1;
    if (last < 1) return undefined;
    let found = this.nearest(position, line, this.at, Math.min(last, this.at + AHEAD));
    if (found.mm > NEAR_MM && performance.now() - this.lookedMs > ALL_EVERY_MS) {
      this.lookedMs = performance.now();
      found = this.nearest(position, line, 0, last);
    }
    if (found.mm > NEAR_MM) return undefined;
    this.at = found.corner;
    return this.run.tickBetween(ticks[found.corner], ticks[found.corner + 1], found.part);
  }

  /** The nearest place between two corners. A path that comes back on itself is told apart by its lines. */
  nearest(position, line, from, to) {
    const { places, ticks } = this.run.outline;
    const axes = places.map((_, axis) => axis).filter((axis) => places[axis]);
    let best = { mm: Infinity, corner: from, part: 0 };
    for (let corner = from; corner < to; corner += 1) {
      if (line && this.run.lineAt((ticks[corner] + ticks[corner + 1]) / 2) !== line) continue;
      let along = 0;
      let length = 0;
      for (const axis of axes) {
        const step = places[axis][corner + 1] - places[axis][corner];
        along += step * (position[axis] - places[axis][corner]);
        length += step * step;
      }
      const part = length > 0 ? Math.min(1, Math.max(0, along / length)) : 0;
      let square = 0;
      for (const axis of axes) {
        const start = places[axis][corner];
        square += (start + part * (places[axis][corner + 1] - start) - position[axis]) ** 2;
      }
      const mm = Math.sqrt(square);
      if (mm < best.mm) best = { mm, corner, part };
    }
    return best;
  }
}
