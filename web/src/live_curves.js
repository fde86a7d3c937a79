// Torques of a running measurement beside their prediction, and the instant shared with the robot:
// now, or in the past.
import { curvesOf } from './curves_of.js';
import { clock, make } from './elements.js';
import { Player } from './player.js';

const EVERY = 80; // time between two drawings, a dozen per second [ms]
const WINDOW = 10; // shown duration of passing torques [s]

export class LiveCurves {
  /** `stand(t)` is called with an instant, or without argument for the present. */
  constructor(host, data, stand) {
    Object.assign(this, { host, data, stand, player: new Player(0) });
    this.slider = make('input', { type: 'range', step: 'any', 'aria-label': 'Instant shown, from the oldest to now', oninput: () => this.look(Number(this.slider.value)) });
    this.button = make('button', { type: 'button', text: 'Play', onclick: () => this._toggle() });
    this.label = make('span', { class: 'small' });
    this.bar = make('div', { class: 'row time' }, this.button, this.slider, this.label, make('button', { type: 'button', text: 'Now', onclick: () => this.look() }));
    host.after(this.bar);
    const keys = ['measured', 'predicted', '95 % band'].map((text, k) => make('span', { class: `key of-${['measured', 'predicted', 'band'][k]}`, text }));
    this.legend = make('p', { class: 'small legend' }, ...keys); // once, in place of one for each axis
    host.before(this.legend);
    this.player.addEventListener('time', () => this._follow());
    this.player.addEventListener('state', () => { this.button.textContent = this.player.playing ? 'Pause' : 'Play'; });
    new ResizeObserver(() => this.draw()).observe(host);
  }

  /** Restart with a run without data; torques arrive continuously or by recording. */
  begin(recorded, passing) {
    const { torque, predicted, band } = recorded;
    Object.assign(this, { recorded, passing, alarms: [], back: false, span: [0, WINDOW] });
    this.player.pause();
    this.host.replaceChildren();
    this.curves = this.data.robot.joints.map(() => {
      const cell = make('div');
      this.host.append(cell);
      return curvesOf(cell, this.data, { torque, predicted, band }, (t) => this.look(t));
    });
    this.host.hidden = this.legend.hidden = this.bar.hidden = true;
  }

  /** Mark the begin of a push in the curves of an axis. */
  alarm(alarm) {
    if (this.alarms.some(({ push, axis }) => push === alarm.push && axis === alarm.axis)) return;
    this.alarms.push(alarm);
  }

  /** Show a past instant; without one, follow new data. */
  look(t) {
    this.back = t !== undefined && t < this.recorded.duration;
    if (this.back) this.player.seek(t);
    else {
      this.player.pause();
      this.stand();
    }
    this.draw();
  }

  _toggle() {
    if (!this.back) this.look(this.first);
    this.player.toggle();
  }

  _follow() {
    if (this.back) this.stand(this.player.time);
    this.draw();
  }

  get first() {
    return this.recorded.measured[0].time[0] ?? 0;
  }

  /** Redraw at the next frame, after new data, another instant or another size. */
  draw() {
    if (this.due || !this.recorded) return;
    this.due = setTimeout(() => requestAnimationFrame(() => {
      this.due = 0;
      this._draw();
    }), this.back ? 0 : EVERY);
  }

  _draw() {
    const { recorded, player } = this;
    player.duration = recorded.duration;
    const t = this.back ? player.time : recorded.duration;
    this.bar.hidden = !recorded.duration;
    this.host.hidden = this.legend.hidden = !recorded.segments.length && !recorded.sampled;
    [this.slider.min, this.slider.max, this.slider.value] = [this.first, recorded.duration, t];
    this.label.textContent = this.back ? `${clock(recorded.duration - t)} ago` : '';
    if (this.host.hidden) return;
    const passing = this.passing || recorded.sampled;
    if (passing) this._slide(t);
    this.curves.forEach((curves, j) => {
      const [begin, end] = passing ? this.span : this._recording(j, t);
      curves[1].figure.hidden = Boolean(recorded.sampled);
      const marks = this.alarms.filter(({ axis }) => axis === j).map((each) => each.t);
      for (const each of curves) {
        each.draw(j, begin, end, { origin: passing ? recorded.duration : begin, marks });
        if (this.back) each.cursor(t);
        else each.mark.hidden = true;
      }
    });
  }

  /** Move the window over an instant; the window ends at the present if no instant is selected. */
  _slide(t) {
    if (this.back && t >= this.span[0] && t <= this.span[1]) return;
    const end = Math.min(this.back ? t + WINDOW / 2 : t, this.recorded.duration);
    this.span = [Math.max(end - WINDOW, this.first), end];
  }

  /** Span of the last recording of an axis at an instant, or of the first recording. */
  _recording(j, t) {
    const own = this.recorded.segments.filter(({ axes }) => axes.includes(j));
    const { begin, end } = own.findLast((each) => each.begin <= t) ?? own[0] ?? { begin: 0, end: 1 };
    return [begin, end];
  }
}
