// Time of the player: an instant set by hand, or a running one.
export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 30, 60];

export class Player extends EventTarget {
  constructor(duration) {
    super();
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.dispatchEvent(new Event('time'));
  }

  setSpeed(speed) {
    this.speed = speed;
    this.dispatchEvent(new Event('state'));
  }

  /** The next faster (1) or slower (-1) of the usual speeds. */
  change(by) {
    const at = SPEEDS.indexOf(this.speed) + by;
    this.setSpeed(SPEEDS[Math.min(Math.max(at, 0), SPEEDS.length - 1)]);
  }

  play() {
    if (this.playing) return;
    if (this.time >= this.duration) this.seek(0);
    this.playing = true;
    this.dispatchEvent(new Event('state'));
    let last = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      this.seek(this.time + (this.speed * Math.max(now - last, 0)) / 1000);
      last = now;
      if (this.time >= this.duration) this.pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
    this.dispatchEvent(new Event('state'));
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }
}
