// Measured torque of each axis beside the predicted one with its band: what is recorded, or what passes by.
import { Curve } from './curves.js';
import { make, shown } from './elements.js';

const KEPT = 4000; // instants of an axis
const EVERY = 80; // between two drawings, a dozen a second [ms]
const WINDOW = 10; // what is shown of torques that pass by [s]

/** The charts of all axes and the time that they share; `seek(t)` is called with an instant, or with nothing for now. */
export class TorqueCharts {
  constructor(host, joints, seek) {
    this.axes = joints.map((joint, j) => ({ chart: new TorqueCurve(host, joint, j, (t) => this.to(t)), t: [], measured: [], predicted: [], band: [] }));
    this.host = host;
    this.seek = seek;
    this.alarms = [];
    this.slider = make('input', { type: 'range', min: 0, max: 1, step: 'any', value: 1, 'aria-label': 'Instant shown, from the oldest to now' });
    this.slider.addEventListener('input', () => this.to(this.begin + this.slider.value * (this.end - this.begin)));
    this.live = make('button', { type: 'button', text: 'Now', onclick: () => this.to() });
    this.bar = make('div', { class: 'row time' }, this.slider, this.live);
    host.after(this.bar);
    new ResizeObserver(() => this.redraw()).observe(host);
    this.forget(false);
  }

  /** Begin anew, with a run whose torques pass by, or with one whose recordings come as a whole. */
  forget(passing) {
    for (const axis of this.axes) for (const name of ['t', 'measured', 'predicted', 'band']) axis[name] = [];
    [this.alarms, this.passing, this.cursor, this.begin, this.end] = [[], passing, undefined, 0, 0];
    this._hide(true);
  }

  take({ axes, t, measured, predicted, band }) {
    if (!t.length) return;
    this._hide(false);
    axes.forEach((number, column) => {
      const axis = this.axes[number];
      if (!this.passing) for (const name of ['t', 'measured', 'predicted', 'band']) axis[name] = [];
      axis.t.push(...t);
      for (const [name, rows] of Object.entries({ measured, predicted, band })) axis[name].push(...rows.map((row) => row[column]));
      const surplus = axis.t.length - KEPT;
      if (surplus > 0) for (const name of ['t', 'measured', 'predicted', 'band']) axis[name].splice(0, surplus);
    });
    if (!this.passing) this.fresh = new Set([...(this.due ? this.fresh ?? this.axes.keys() : []), ...axes]);
    this._draw();
  }

  alarm({ axis, t }) {
    this.alarms.push({ axis, t });
  }

  /** Look at an instant of what has passed; at none, go on with what comes. */
  to(t) {
    if (!this.passing) return;
    this.cursor = t === undefined || t >= this.end ? undefined : t;
    this.seek(this.cursor);
    this._draw();
  }

  /** Draw all anew, in other colours or another size. */
  redraw() {
    this.fresh = undefined;
    this._draw();
  }

  _hide(hidden) {
    this.host.hidden = hidden;
    this.bar.hidden = hidden || !this.passing;
  }

  _draw() {
    if (this.due) return;
    const wait = this.cursor === undefined ? EVERY : 0;
    this.due = setTimeout(() => requestAnimationFrame(() => {
      this.due = 0;
      this.bar.hidden = !this.passing;
      if (this.cursor === undefined && this.passing) {
        this.end = Math.max(...this.axes.map(({ t }) => t.at(-1) ?? 0));
        this.begin = Math.max(this.end - WINDOW, Math.min(...this.axes.map(({ t }) => t[0] ?? this.end)));
      }
      this.slider.value = this.cursor === undefined ? 1 : (this.cursor - this.begin) / (this.end - this.begin);
      for (const j of this.fresh ?? this.axes.keys()) this._one(this.axes[j], j);
      this.fresh = undefined;
    }), wait);
  }

  _one(axis, j) {
    if (!axis.t.length) return;
    const [begin, end] = this.passing ? [this.begin, this.end] : [axis.t[0], axis.t.at(-1)];
    const alarms = this.alarms.filter((each) => each.axis === j).map(({ t }) => t);
    axis.chart.show(axis, begin, end, this.passing, alarms);
    axis.chart.cursor(this.cursor ?? end, !this.passing);
  }
}

class TorqueCurve extends Curve {
  constructor(host, { torque_unit: unit, torque }, j, seek) {
    const lines = () => [
      { name: 'measured', colour: '--measured' },
      { name: 'predicted', colour: '--planned', dashed: true },
    ];
    super(host, { title: () => `axis ${j + 1}, ${unit}`, lines, seek });
    this.least = 0.02 * (torque ?? 1);
    this.caption.replaceChildren(...this._caption(0));
    this.canvas.setAttribute('aria-label', `axis ${j + 1}: measured and predicted torque over time; none yet`);
    if (new.target === TorqueCurve) this.left = new Difference(this.figure, { torque_unit: unit, torque }, j, seek);
  }

  show(axis, begin, end, passing, alarms) {
    const first = Math.max(axis.t.findIndex((each) => each >= begin), 0);
    const [t, measured, predicted, band] = ['t', 'measured', 'predicted', 'band'].map((name) => axis[name].slice(first));
    this.paint({ t, about: predicted, band, measured }, [begin, end], passing ? end : begin, alarms);
    const left = measured.map((each, i) => each - predicted[i]);
    this.left.paint({ t, about: t.map(() => 0), band, measured: left }, [begin, end], passing ? end : begin, alarms);
    const [one, other] = [measured.at(-1), predicted.at(-1)].map((each) => shown(each, 100));
    this.canvas.setAttribute('aria-label', `${this.title(0)}: torque over time; measured ${one}, predicted ${other} at its end`);
  }

  paint({ t, about, band, measured }, span, origin, alarms) {
    Object.assign(this, { span, origin, alarms });
    this.drawn = [{ t, y: about, band, colour: '--planned', dashed: true }, { t, y: measured, colour: '--measured' }];
    this._scale(0);
    this._paint();
  }

  cursor(t, hidden) {
    super.cursor(t);
    this.mark.hidden = hidden;
    this.left?.cursor(t, hidden);
  }

  _scale(joint) {
    super._scale(joint);
    const middle = (this.low + this.high) / 2;
    this.low = Math.min(this.low, middle - this.least);
    this.high = Math.max(this.high, middle + this.least);
  }

  _paintScale(pen, colour) {
    super._paintScale(pen, colour);
    pen.strokeStyle = colour('--bad');
    pen.lineWidth = 2;
    for (const t of this.alarms) if (t >= this.span[0] && t <= this.span[1]) this._line(pen, this._x(t), this._y(this.high), this._x(t), this._y(this.low));
  }
}

/** What measured torque has more than predicted, about which the band is seen. */
class Difference extends TorqueCurve {
  constructor(host, joint, j, seek) {
    super(host, joint, j, seek);
    this.caption.textContent = 'difference, with the 95 % band';
    this.canvas.setAttribute('aria-label', `axis ${j + 1}: difference of measured and predicted torque over time, with its 95 % band`);
    this.least = 0.01 * (joint.torque ?? 1);
  }
}
