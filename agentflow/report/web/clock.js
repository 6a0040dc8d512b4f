// The time of a film: it stands, or runs at a speed until the end.

export class Clock {
  constructor() {
    this.time = 0; // seconds
    this.duration = 0; // seconds
    this.speed = 1;
    this.running = false;
  }

  get over() {
    return this.time >= this.duration;
  }

  /** Run, from the beginning if the film is over. */
  start() {
    if (this.over) this.time = 0;
    this.running = true;
    this.last = null;
  }

  stop() {
    this.running = false;
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
  }

  /** Run on to a frame, `now` milliseconds after the page was opened. Returns the milliseconds since the
   *  frame before; null for the first frame, which takes no time. */
  advance(now) {
    const passed = this.last === null ? null : now - this.last;
    this.last = now;
    this.time = Math.min(this.time + (this.speed * (passed ?? 0)) / 1000, this.duration);
    return passed;
  }
}
