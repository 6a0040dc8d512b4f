// The resolution of a 3D view: full at rest, lower while frames are slow.

const SLOW = 32; // milliseconds per frame above which the resolution is reduced
const COARSEST = 0.6; // lowest resolution, as a share of the canvas

export class Sharpness {
  /** @param draw asks for a frame */
  constructor(picture, canvas, draw) {
    this.picture = picture;
    this.canvas = canvas;
    this.draw = draw;
    new ResizeObserver(() => {
      this.share = null;
      this.rest();
    }).observe(canvas);
  }

  /** Nothing moves any more: take the full resolution. */
  rest() {
    this.pace = null;
    this.set(1);
  }

  /** A frame came some milliseconds after the one before. */
  note(passed) {
    this.pace = this.pace === null ? SLOW / 2 : 0.85 * this.pace + 0.15 * passed;
    if (this.pace > SLOW && this.share > COARSEST) {
      this.set(0.8 * this.share);
      this.pace = SLOW / 2;
    }
  }

  /** Set the resolution, as a share of the canvas's width and height. */
  set(share) {
    const { clientWidth, clientHeight } = this.canvas;
    if (share === this.share || !clientWidth || !clientHeight) return;
    this.share = share;
    this.picture.resize(clientWidth, clientHeight, share);
    this.draw();
  }
}
