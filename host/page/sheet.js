// A canvas that fills its element at the screen's resolution.

import { ink } from "page/theme.js";

/** Text that stands out from lines below it. */
export function clearText(context, text, x, y) {
  context.save();
  context.setLineDash([]);
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = ink("paper");
  context.strokeText(text, x, y);
  context.restore();
  context.fillText(text, x, y);
}

/** The page's, for what is drawn. */
let font;

export class Sheet {
  constructor(parent) {
    this.canvas = parent.appendChild(document.createElement("canvas"));
    this.context = this.canvas.getContext("2d");
  }

  /** Looks how large it is. What was written into the page before is laid out for it, so sheets are measured together. */
  measure() {
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    font ??= `12px ${getComputedStyle(document.body).fontFamily}`;
  }

  /** Empties it; its size in CSS pixels. */
  clear() {
    const scale = window.devicePixelRatio || 1;
    const { width, height } = this;
    const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
    if (this.canvas.width !== w || this.canvas.height !== h) [this.canvas.width, this.canvas.height] = [w, h];
    this.context.setTransform(scale, 0, 0, scale, 0, 0);
    this.context.clearRect(0, 0, width, height);
    this.context.font = font;
    return { width, height, scale };
  }
}
