// Position, velocity, torque and distance over a span of time, with a cursor.
import { shown } from './elements.js';

const HEIGHT = 132;
const LEFT = 58;
const BOTTOM = 18;
const RIGHT = 16;
const TOP = 8;
const DRAG = 8; // least drag that selects a span of time [pixels]

/** Round values for the labels of a scale. */
export function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  // neighbours differ by a factor of 2 at most, so that four parts of a scale have at least two
  // labels
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((each) => each >= raw);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  const digits = [0, 1, 2, 3, 4, 5, 6].find((each) => Math.abs(step * 10 ** each - Math.round(step * 10 ** each)) < 1e-6 * step * 10 ** each);
  return { values: found, digits: digits ?? 6 };
}

/** Visible part of a band: twice its median, unless its line is small beside the band. */
function usual({ y, band }) {
  const [there, known] = [band ?? [], y].map((values) => values.filter(Number.isFinite).sort((a, b) => a - b));
  const [reach, span] = [2 * (there[there.length >> 1] ?? 0), known.at(-1) - known[0]];
  return span > 0 ? Math.min(reach, span / 4) : reach;
}

/** Known values, a list for each stretch without a gap. */
function parts(values) {
  const found = [];
  values.forEach((v, i) => {
    if (!Number.isFinite(v)) return;
    if (i && Number.isFinite(values[i - 1])) found.at(-1).push(i);
    else found.push([i]);
  });
  return found;
}

export class Curve {
  /** `lines(joint)` gives {name, value(t), instants(begin, end, n), dashed, colour, band(t)}. */
  constructor(host, { title, lines, seek, zoom, bounds = () => [], least = () => 0, height = HEIGHT }) {
    Object.assign(this, { height, lines, title, bounds, least });
    this.figure = document.createElement('figure');
    this.figure.className = 'curve';
    this.caption = document.createElement('figcaption');
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('role', 'img');
    this.mark = document.createElement('div');
    this.mark.className = 'cursor';
    this.mark.hidden = true;
    this.canvas.style.height = `${height}px`;
    this.mark.style.height = `${height - TOP - BOTTOM}px`;
    this.values = document.createElement('span');
    this.values.className = 'values';
    this.values.setAttribute('aria-hidden', 'true'); // the canvas has a label of its own
    this.figure.append(this.caption, this.canvas, this.mark, this.values);
    host.append(this.figure);
    const on = (name, action) => this.canvas.addEventListener(name, (event) => this.span && action(this._instant(event), event));
    on('pointerdown', seek);
    on('pointermove', (t) => this._read(t));
    this.canvas.addEventListener('pointerleave', () => this.values.replaceChildren());
    if (zoom) this._select(on, zoom);
  }

  /** Zoom to the span of time passed by a drag; a double click shows the whole again. */
  _select(on, zoom) {
    const shade = document.createElement('div');
    shade.className = 'selection';
    this.figure.append(shade);
    let from = null;
    const wide = (t) => from !== null && Math.abs(this._x(t) - this._x(from)) > DRAG;
    const end = () => { from = null; shade.style.width = 0; };
    on('pointerdown', (t, { pointerId }) => { from = t; this.canvas.setPointerCapture(pointerId); });
    on('pointermove', (t) => {
      if (!wide(t)) return;
      const [left, right] = [from, t].map((each) => this._x(each)).sort((a, b) => a - b);
      Object.assign(shade.style, { left: `${left}px`, width: `${right - left}px`, top: `${this.canvas.offsetTop + TOP}px`, height: this.mark.style.height });
    });
    on('pointerup', (t) => {
      const span = wide(t) && [from, t].sort((a, b) => a - b);
      end();
      if (span) zoom(span);
    });
    on('pointercancel', end);
    on('dblclick', () => zoom());
  }

  /** Instant under the pointer. */
  _instant({ clientX }) {
    const { left, width } = this.canvas.getBoundingClientRect();
    const share = (clientX - left - LEFT) / (width - LEFT - RIGHT);
    return this.span[0] + Math.min(Math.max(share, 0), 1) * (this.span[1] - this.span[0]);
  }

  /** Show the values of all lines at an instant. */
  _read(t) {
    const scale = (this.high - this.low) / 2;
    const found = this.drawn.filter(({ name }) => name).map(({ name, value, half }) => {
      const [known, reach] = [value(t), half?.(t)];
      if (!Number.isFinite(known)) return '';
      return `${name} ${shown(known, scale)}${Number.isFinite(reach) ? ` ± ${shown(reach, scale)}` : ''}`;
    });
    this.values.textContent = [`${shown(t - this.origin, 10)} s`, ...found.filter(Boolean)].join(', ');
  }

  /**
   * Redraw for a joint and a span of time counted from `origin`, with a rule at each of `marks`.
   */
  draw(joint, begin, end, { origin = begin, marks = [] } = {}) {
    Object.assign(this, { joint, span: [begin, end], origin, marks });
    this.caption.replaceChildren(...this._caption(joint));
    this.drawn = this.lines(joint).map((line) => {
      const t = line.instants(begin, end, 300);
      return { ...line, half: line.band, t, y: t.map((each) => line.value(each)), band: line.band && t.map((each) => line.band(each)) };
    });
    this.canvas.setAttribute('aria-label', `${this.title(joint)}, over time; ${this._ends()}`);
    this._scale(joint);
    this._paint();
  }

  /** Values at the end of the curves, as text for screen readers. */
  _ends() {
    const ends = this.drawn.map(({ name, y }) => [name, y.findLast(Number.isFinite)]);
    const known = ends.filter(([name, value]) => name && value !== undefined);
    return known.length ? `at its end ${known.map(([name, value]) => `${name} ${shown(value, 100)}`).join(', ')}` : 'none yet';
  }

  /** Mark an instant. */
  cursor(t) {
    this.mark.hidden = t < this.span[0] || t > this.span[1];
    this.mark.style.left = `${this._x(t)}px`;
    this.mark.style.top = `${this.canvas.offsetTop + TOP}px`;
  }

  _caption(joint) {
    const words = [document.createTextNode(this.title(joint))];
    for (const { name, colour, dashed } of this.lines(joint).filter((each) => each.name)) {
      const key = document.createElement('span');
      key.className = dashed ? 'key dashed' : 'key';
      key.style.setProperty('--colour', `var(${colour})`);
      key.textContent = name;
      words.push(key);
    }
    return words;
  }

  _scale(joint) {
    let [low, high] = [Infinity, -Infinity];
    for (const each of this.drawn) {
      const reach = usual(each);
      for (const v of each.y) if (Number.isFinite(v)) { low = Math.min(low, v - reach); high = Math.max(high, v + reach); }
    }
    if (!(low <= high)) [low, high] = [-1, 1];
    const lacking = Math.max(this.least(joint) - (high - low), 0) / 2;
    [low, high] = [low - lacking, high + lacking];
    const room = Math.max(0.08 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high)), 1e-3);
    this.low = low - room;
    this.high = high + room;
    this.limits = this.bounds(joint).filter((v) => v > this.low && v < this.high);
  }

  _x(t) {
    const [begin, end] = this.span;
    return LEFT + ((t - begin) / (end - begin || 1)) * (this.width - LEFT - RIGHT);
  }

  _y(v) {
    return TOP + ((this.high - v) / (this.high - this.low)) * (this.height - TOP - BOTTOM);
  }

  _paint() {
    const ratio = Math.min(window.devicePixelRatio, 2);
    this.width = this.canvas.clientWidth || 360;
    this.canvas.width = this.width * ratio;
    this.canvas.height = this.height * ratio;
    const pen = this.canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    const style = getComputedStyle(this.canvas);
    const colour = (name) => style.getPropertyValue(name);
    for (const each of this.drawn) if (each.band) this._paintBand(pen, colour, each); // below the curves
    this._paintScale(pen, colour);
    for (const { t, y, colour: name, dashed } of this.drawn) {
      pen.strokeStyle = colour(name);
      pen.lineWidth = 1.6;
      pen.setLineDash(dashed ? [5, 4] : []);
      pen.beginPath();
      for (const part of parts(y)) part.forEach((i, k) => pen[k ? 'lineTo' : 'moveTo'](this._x(t[i]), this._y(y[i])));
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  _paintBand(pen, colour, { t, y, band }) {
    pen.fillStyle = colour('--band');
    for (const part of parts(band.map((each, i) => (each === null ? NaN : each + y[i])))) {
      const edge = (side) => (i) => pen.lineTo(this._x(t[i]), this._within(y[i] + side * band[i]));
      pen.beginPath();
      part.forEach(edge(1));
      part.toReversed().forEach(edge(-1));
      pen.fill();
    }
  }

  _within(v) {
    return this._y(Math.min(Math.max(v, this.low), this.high));
  }

  _paintScale(pen, colour) {
    pen.font = '12px system-ui, sans-serif';
    pen.lineWidth = 1;
    pen.textBaseline = 'middle';
    pen.textAlign = 'right';
    const { values, digits } = ticks(this.low, this.high, 4);
    for (const v of values) {
      pen.strokeStyle = colour('--line');
      this._line(pen, LEFT, this._y(v), this.width - RIGHT, this._y(v));
      pen.fillStyle = colour('--muted');
      pen.fillText(v.toFixed(digits).replace('-', '−'), LEFT - 6, this._y(v));
    }
    pen.strokeStyle = colour('--warn');
    for (const v of this.limits) this._line(pen, LEFT, this._y(v), this.width - RIGHT, this._y(v));
    pen.strokeStyle = colour('--bad');
    pen.lineWidth = 2;
    for (const t of this.marks) if (t >= this.span[0] && t <= this.span[1]) this._line(pen, this._x(t), this._y(this.high), this._x(t), this._y(this.low));
    const [begin, end] = this.span;
    const wide = this.width < 340 ? 3 : 5;
    const from = this.origin;
    const { values: instants, digits: places } = ticks(begin - from, Math.max(end - from, begin - from + 1e-3), wide);
    pen.textAlign = 'center';
    pen.textBaseline = 'alphabetic';
    pen.fillStyle = colour('--muted');
    instants.forEach((t, i) => {
      const unit = i === instants.length - 1 ? ' s' : '';
      const text = `${t.toFixed(places).replace('-', '−')}${unit}`;
      // the last label stays within the canvas
      pen.fillText(text, Math.min(this._x(from + t), this.width - pen.measureText(text).width / 2), this.height - 4);
    });
  }

  _line(pen, ...[a, b, c, d]) {
    pen.beginPath();
    pen.moveTo(a, b);
    pen.lineTo(c, d);
    pen.stroke();
  }
}
