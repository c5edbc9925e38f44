// From where the path is seen: its axes, direction, place and scale on the screen.

/** The greatest distance of the drawn path from the true one, in pixels of the screen. */
const OFF_PX = 0.5;
/** Space around the path [px]. */
const AIR_PX = 28;
/** From the front, the right and above [rad]. */
const FROM_ABOVE = [-0.6, 0.6];

/** Least and greatest number of a list. */
function ends(values) {
  return values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}

export class Camera {
  constructor(runs) {
    this.runs = runs;
    this.size = [1, 1];
    this.lookFromAbove();
  }

  get isInSpace() {
    return this.axes.length === 3;
  }

  /** Pixels of the screen to one of the page. */
  get ratio() {
    return window.devicePixelRatio || 1;
  }

  /** How far from the path a drawn line may be [mm]. */
  get toleranceMm() {
    return OFF_PX / (this.ratio * this.scale);
  }

  /** Sees all of the path, in the plane or the space of these axes. */
  fit(axes, size) {
    this.isMoved = false;
    this.axes = axes;
    this.size = size;
    const spans = axes.map((axis) => ends(this.runs.flatMap((run) => {
      const values = run.outline.places[axis];
      return values ? ends(values) : [];
    })));
    this.pivot = spans.map(([low, high]) => (low + high) / 2);
    this.offset = [0, 0];
    const directions = this.directions();
    const [across, upright] = [0, 1].map((way) =>
      directions.reduce((sum, direction, i) => sum + Math.abs(direction[way]) * (spans[i][1] - spans[i][0]), 0));
    const [width, height] = size.map((length) => length - 2 * AIR_PX);
    const scale = Math.min(width / across, height / upright);
    // A point has no size; it gets a millimetre.
    this.scale = this.limited(Number.isFinite(scale) ? scale : Math.min(width, height));
  }

  /** From where it was moved to see the path. */
  pose() {
    const { yaw, pitch, pivot, offset, scale } = this;
    return { yaw, pitch, pivot, offset, scale };
  }

  /** Sees it from there. */
  take(pose) {
    Object.assign(this, pose, { isMoved: true });
    this.scale = this.limited(pose.scale);
  }

  /** Pixels to a millimetre: no more than the data resolve. */
  limited(scale) {
    return Math.min(scale, OFF_PX / (this.runs[0].outline.toleranceMm * this.ratio));
  }

  /** Directions on the screen, to the right and downwards, of the axes. */
  directions() {
    if (!this.isInSpace) return [[1, 0], [0, -1]];
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    return [[cy, sy * sp], [sy, -cy * sp], [0, -cp]];
  }

  /** What gives the place on the screen of places in the machine, as long as the camera does not move. */
  projection() {
    const { axes, pivot, scale } = this;
    const directions = this.directions();
    const [left, top] = [0, 1].map((way) => this.size[way] / 2 + this.offset[way]);
    return (place) => {
      let [x, y] = [left, top];
      for (let i = 0; i < axes.length; i += 1) {
        const px = (place[axes[i]] - pivot[i]) * scale;
        x += directions[i][0] * px;
        y += directions[i][1] * px;
      }
      return [x, y];
    };
  }

  /** Zooms; what is at x and y of the screen stays there. */
  zoom(x, y, factor) {
    const scale = this.limited(this.scale * factor);
    const by = scale / this.scale;
    this.offset = [x, y].map((at, way) => at - this.size[way] / 2 - (at - this.size[way] / 2 - this.offset[way]) * by);
    this.scale = scale;
    this.isMoved = true;
  }

  /** Looks from the front, the right and above again. */
  lookFromAbove() {
    [this.yaw, this.pitch] = FROM_ABOVE;
  }

  /** Turns in space, up to where it looks from straight above or below. */
  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.pitch + pitch));
    this.isMoved = true;
  }

  /** Moves the picture. */
  shift(x, y) {
    this.offset = [this.offset[0] + x, this.offset[1] + y];
    this.isMoved = true;
  }
}
