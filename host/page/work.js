// Counts of the work that a frame takes. Tests compare counts, which are the same on every machine, and never times.

export const work = {
  /** Frames drawn. */
  frames: 0,
  /** Columns of plots drawn. */
  columns: 0,
  /** Samples looked at. */
  samples: 0,
  /** Parts of the path drawn. */
  parts: 0,
};

const waiting = new Set();

/** Calls `draw` in the next frame, once, however often it is asked for. */
export function nextFrame(draw) {
  if (waiting.size === 0) {
    requestAnimationFrame(() => {
      const due = [...waiting];
      waiting.clear();
      work.frames += 1;
      for (const each of due) each();
    });
  }
  waiting.add(draw);
}
