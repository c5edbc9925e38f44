// A window of a horizontal axis: it is moved and zoomed within the ends of what there is.

/** Zoom of a notch of the wheel, as a power of 2, and pixels of a notch. */
const ZOOM_PER_NOTCH = 0.35;
const NOTCH_PX = 100;

/** By how much a turn of the wheel widens the window. */
export function wheelFactor(deltaPx) {
  return 2 ** ((ZOOM_PER_NOTCH * deltaPx) / NOTCH_PX);
}

/** Has `from` and `to`. What extends it says the `ends()` of what there is and the `least()` width of a window, and is told of
 * changes by `changed()`. */
export class Span {
  isWhole() {
    const [from, to] = this.ends();
    return this.from <= from && this.to >= to;
  }

  showAll() {
    [this.from, this.to] = this.ends();
    this.changed();
  }

  /** Shows a window, moved to within the ends, and not too narrow. */
  show(from, to) {
    const [first, last] = this.ends();
    const width = Math.min(last - first, Math.max(this.least(), to - from));
    const start = Math.min(last - width, Math.max(first, (from + to - width) / 2));
    [this.from, this.to] = [start, start + width];
    this.changed();
  }

  /** Zooms around x. */
  zoom(x, factor) {
    const width = (this.to - this.from) * factor;
    const start = x - ((x - this.from) / (this.to - this.from)) * width;
    this.show(start, start + width);
  }

  /** Moves the window by a part of its width. */
  pan(part) {
    const by = part * (this.to - this.from);
    this.show(this.from + by, this.to + by);
  }
}
