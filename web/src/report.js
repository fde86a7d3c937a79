// Additional functions of a saved page: recordings behind points and parameters, and one instant
// common to the robot and all curves. Without this script, the page shows the same content without
// these functions.
import { curvesOf } from './curves_of.js';
import { make, shown } from './elements.js';
import { inflate } from './packed.js';
import { Player } from './player.js';
import { Recorded } from './recorded.js';
import { RobotView } from './robot_view.js';

const NEAR = 12; // maximum distance from the pointer to the selected point [pixels]
const [TOP, BOTTOM] = [24, 38]; // margin of a panel outside its axes [pixels]
const NOTE = 'Blue: as recorded, after the low-pass where there is a prediction. Orange: as the model predicts it, with its interval of 95 %. A drag across a curve zooms all curves; a double click shows the whole.';

export async function report() {
  const data = await inflate(document.getElementById('carried').textContent);
  const saved = new Saved(data);
  saved.parameters();
  saved.points();
  saved.play();
  const hint = document.querySelector('.hint');
  if (hint) hint.hidden = false;
  window.report = saved;
}

class Saved {
  constructor(data) {
    this.data = data;
    this.recorded = new Recorded(data);
    this.player = new Player(this.recorded.duration);
    this.curves = [];
    this.tip = make('div', { id: 'tip', hidden: true });
    this.dialog = make('dialog', { 'aria-labelledby': 'recording' });
    document.body.append(this.tip, this.dialog);
    this.dialog.addEventListener('click', (event) => event.target === this.dialog && this.dialog.close());
    this.dialog.addEventListener('close', () => {
      this.curves = [];
      if (this.host) this.place.prepend(this.host);
    });
  }

  /** The segment of a recording; `shown` decides between runs with a segment of the same name. */
  segment(id, shown = false) {
    return this.data.segments[shown ? 'findLast' : 'find']((each) => each.id === id);
  }

  /** Open the curves of a recording, with the robot above them. */
  open(segment, t = segment.begin) {
    const { begin, end, words, axes } = segment;
    const body = make('div', { class: 'curves' });
    this._dialog(words, ...(this.host ? [this.host] : []), body, make('p', { class: 'small', text: NOTE }));
    const zoom = (span = [begin, end]) => {
      for (const each of this.curves) each.draw(each.joint, ...span, { origin: begin });
      this._show();
    };
    this.curves = axes.flatMap((joint) => {
      const own = curvesOf(body, this.data, this.recorded, (at) => this.player.seek(at), zoom);
      for (const each of own) each.draw(joint, begin, end);
      return own;
    });
    this.view?.highlight(axes);
    this.player.seek(t);
  }

  _dialog(title, ...content) {
    const close = make('button', { type: 'button', text: 'Close', onclick: () => this.dialog.close() });
    this.dialog.replaceChildren(make('div', { class: 'top' }, make('h2', { id: 'recording', text: title }), close), ...content);
    if (!this.dialog.open) this.dialog.showModal();
    this.dialog.scrollTop = 0;
  }

  /** Link parameters to the recordings that determine them. */
  parameters() {
    for (const cell of document.querySelectorAll('tbody th[scope="row"]')) {
      const each = this.data.parameters[cell.textContent.trim()];
      if (!each) continue;
      const button = make('button', { type: 'button', class: 'plain', title: `${each.title}, recordings that carry it`, onclick: () => this._parameter(each) });
      button.append(...cell.childNodes);
      cell.append(button);
    }
  }

  _parameter({ title, by }) {
    const items = by.map(([id, share]) => make('li', { style: `--share: ${share}%` },
      make('button', { type: 'button', text: id, onclick: () => this.open(this.segment(id)) }), ` ${share} %`));
    this._dialog(title, make('p', { text: 'Recordings that carry it, with their shares in its certainty:' }), make('ol', { class: 'carriers' }, ...items));
  }

  /** Show one instant: pose of the robot, and a cursor in all curves of that recording. */
  play() {
    this.panels = [...document.querySelectorAll('svg[data-r]')].map((svg) => {
      const [left, right, low, high] = svg.dataset.x.split(' ').map(Number);
      const segment = this.segment(svg.dataset.r, true);
      const line = draw('path', { class: 'cursor' });
      const end = { x: right, 'text-anchor': 'end', class: 'read' };
      const [values, instant] = [{ ...end, y: 14 }, { ...end, y: svg.viewBox.baseVal.height - 5 }].map((each) => draw('text', each));
      svg.append(line, values, instant);
      return { svg, line, values, instant, segment, left, right, low, high, read: segment && this._reader(svg.dataset.axis, segment) };
    }).filter(({ segment }) => segment);
    for (const panel of this.panels) {
      panel.svg.addEventListener('pointermove', (event) => this._point(panel, event));
      panel.svg.addEventListener('click', (event) => this._point(panel, event) && this.open(panel.segment, this.player.time));
      const title = panel.svg.querySelector('.title');
      button(title, title.textContent);
      title.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter') return;
        this.open(panel.segment);
        event.preventDefault();
      });
    }
    this.place = document.querySelector('.robot');
    if (this.place) this._robot();
    this.player.addEventListener('time', () => this._show());
    const [first] = this.panels;
    this.start = first ? first.segment.begin + Math.max(first.low, 0) : 0;
    this.player.seek(this.start);
  }

  _robot() {
    const host = make('div', { class: 'host' });
    this.place.append(host);
    try {
      this.view = new RobotView(host, this.data);
    } catch {
      host.remove(); // no WebGL here: the picture stays
      return;
    }
    this.host = host;
    for (const name of ['role', 'aria-label']) this.place.removeAttribute(name);
    this.place.classList.add('live');
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const theme = () => this.view.theme(scheme.matches);
    scheme.addEventListener('change', theme);
    theme();
    this.slider = make('input', {
      type: 'range', min: 0, max: this.player.duration, step: 'any', 'aria-label': 'Instant of the recordings',
      oninput: () => this.player.seek(Number(this.slider.value)),
    });
    const button = make('button', { type: 'button', text: 'Play', onclick: () => this.player.toggle() });
    this.player.addEventListener('state', () => { button.textContent = this.player.playing ? 'Pause' : 'Play'; });
    this.words = make('p', { class: 'small' });
    this.place.append(this.slider, make('div', { class: 'playing' }, button, this.words));
    this.view.look('oblique');
  }

  /** Go to an instant of a drawn recording [s]. */
  seek(id, t) {
    const { begin, end } = this.segment(id, true);
    this.player.seek(Math.min(begin + t, end));
  }

  _point({ svg, segment, left, right, low, high }, { clientX }) {
    const box = svg.getBoundingClientRect();
    const x = ((clientX - box.left) / box.width) * svg.viewBox.baseVal.width;
    const within = x >= left && x <= right;
    if (within) this.player.seek(segment.begin + low + ((x - left) / (right - left)) * (high - low));
    return within;
  }

  /** Function that returns the torques of an axis at an instant, as text in the colours of their curves. */
  _reader(axis, { begin, end }) {
    const [measured, predicted, band] = ['torque', 'predicted', 'band'].map((name) => this.recorded[name]?.[axis]);
    if (!measured) return () => [];
    const most = Math.max(...measured.instants(begin, end, 100).map((t) => Math.abs(measured.at(t)[0])).filter(Number.isFinite));
    return (t) => [[measured, 'measured'], [predicted, 'model', band]].map(([track, name, half]) => {
      const [value, reach] = [track?.at(t)[0], half?.at(t)[0]];
      if (!Number.isFinite(value)) return '';
      const text = draw('tspan', { class: name });
      text.textContent = `\u2002${shown(value, most)}${Number.isFinite(reach) ? ` ± ${shown(reach, most)}` : ''}`;
      return text;
    });
  }

  _show() {
    const { time } = this.player;
    const now = this.data.segments[this.recorded.segment(time)];
    for (const each of this.curves) each.cursor(time);
    for (const { svg, line, values, instant, segment, left, right, low, high, read } of this.panels) {
      const x = left + ((time - segment.begin - low) / (high - low)) * (right - left);
      const within = segment === now && x >= left && x <= right;
      line.setAttribute('d', within ? `M${x.toFixed(1)} ${TOP}V${svg.viewBox.baseVal.height - BOTTOM}` : '');
      const chosen = within && time !== this.start;
      values.replaceChildren(...(chosen ? read(time) : []));
      instant.textContent = chosen ? `${(time - segment.begin).toFixed(2)} s` : '';
    }
    if (!this.view) return;
    this.view.show(this.recorded.q(time));
    this.slider.value = time;
    this.words.textContent = `${now.words}, ${(time - now.begin).toFixed(2)} s`;
  }

  /** Highlight the points of a measurement together, and open the measurement by a click. */
  points() {
    this.alike = Map.groupBy(document.querySelectorAll('[data-m]'), (each) => each.dataset.m);
    this.marked = [];
    for (const panel of document.querySelectorAll('.panels svg')) {
      const own = [...panel.querySelectorAll('[data-m]')];
      if (own.length) this._panel(panel, own);
    }
  }

  /** One stop of the Tab key for each panel; the arrows go from point to point. */
  _panel(panel, points) {
    for (const point of points) button(point, point.dataset.m, point === points[0] ? 0 : -1);
    const on = (name, action) => panel.addEventListener(name, action);
    on('pointermove', (event) => {
      const point = nearest(points, event);
      panel.classList.toggle('pointed', Boolean(point));
      this._mark(point);
    });
    on('pointerleave', () => this._mark());
    on('click', (event) => {
      const point = nearest(points, event);
      if (point) this.open(this.segment(point.dataset.m));
    });
    on('focusin', ({ target }) => target.dataset.m && this._mark(target));
    on('focusout', () => this._mark());
    on('keydown', (event) => this._key(points, event));
  }

  _key(points, event) {
    const at = points.indexOf(event.target);
    const way = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (at < 0) return;
    if (event.key === 'Enter' || event.key === ' ') this.open(this.segment(event.target.dataset.m));
    else if (way) {
      const next = points[(at + way + points.length) % points.length];
      event.target.setAttribute('tabindex', '-1');
      next.setAttribute('tabindex', '0');
      next.focus();
    } else return;
    event.preventDefault();
  }

  /** Mark a point and all points of its measurement; without a point, remove the marks. */
  _mark(point) {
    for (const each of this.marked) each.classList.remove('same');
    this.marked = point ? this.alike.get(point.dataset.m) : [];
    for (const each of this.marked) each.classList.add('same');
    this.tip.hidden = !point;
    if (!point) return;
    const box = point.getBoundingClientRect();
    this.tip.textContent = point.dataset.m;
    const right = document.documentElement.clientWidth - this.tip.offsetWidth - 4;
    this.tip.style.left = `${scrollX + Math.max(4, Math.min(box.right + 6, right))}px`;
    this.tip.style.top = `${scrollY + box.top - this.tip.offsetHeight - 2}px`;
  }
}

function draw(tag, attributes) {
  return assign(document.createElementNS('http://www.w3.org/2000/svg', tag), attributes);
}

function assign(element, attributes) {
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

/** Make an element of a chart a button that opens a recording. */
function button(element, name, tabindex = 0) {
  element.closest('[role="img"]')?.setAttribute('role', 'group');
  assign(element, { role: 'button', 'aria-label': `${name}, open its recording`, tabindex });
}

function nearest(points, event) {
  let [found, least] = [undefined, NEAR];
  for (const point of points) {
    const box = point.getBoundingClientRect();
    const away = Math.hypot(event.clientX - (box.left + box.right) / 2, event.clientY - (box.top + box.bottom) / 2);
    if (away < least) [found, least] = [point, away];
  }
  return found;
}
