// Changes of the page by lines of a run (hil/live/lines.py). Text is only ever set as text.
import { clock, make } from './elements.js';
import { Hand } from './hand.js';
import { Intervals } from './intervals.js';
import { LiveAxes } from './live_axes.js';
import { LiveCurves } from './live_curves.js';
import { Recorded } from './recorded.js';
import { RobotView } from './robot_view.js';

const at = (id) => document.getElementById(id);
const SILENT = 2; // times after which samples, or all signs of life, count as missing [s]
const NOTICES = 200;
const AT_THE_TERMINAL = 'stop it with Ctrl-C at the terminal, or by the emergency stop';
const ENDS = {
  finished: ['the run is finished, the axes are off', ''],
  stopped: ['stopped, the axes are off', ''],
  failed: ['the run has ended with a fault, the axes are off', 'bad'],
  lost: ['the run has ended without a word: look at the robot', 'bad'],
};

/** Description of an event for observers of the robot, and the purpose of the motion. */
function seen({ name, doing, seen: motion, shows }) {
  if (name === 'Travelled' || name === 'Repeated') return [motion, shows];
  if (name === 'Recorded' || name === 'GaveUp') return ['On the way to the next motion', ''];
  return [doing.charAt(0).toUpperCase() + doing.slice(1), ''];
}

export class LivePage {
  constructor() {
    this.power = 'starting';
    this.ended = '';
    this.headline = at('headline').textContent; // as served
    this.heard = this.sampled = performance.now();
    at('stop').addEventListener('click', () => this.stop());
    setInterval(() => this._tick(), 250);
  }

  /** Take one line. */
  take(line) {
    this.heard = performance.now();
    this.lost = false;
    this[`_${line.kind}`]?.(line);
    if (line.kind !== 'sample') this._tick();
  }

  disconnected() {
    this.lost = true;
    this._tick();
  }

  /** Ask the run to stop all axes. */
  async stop() {
    at('stop').textContent = 'Stopping';
    try {
      const answer = await fetch('stop', { method: 'POST', headers: { 'X-Hil-Stop': '1' } });
      if (!answer.ok) throw new Error((await answer.text()).trim());
    } catch (error) {
      at('stop').textContent = 'Stop';
      if (!this.ended) at('fault').textContent = `The stop was not delivered (${error.message}); ${AT_THE_TERMINAL}.`;
    }
  }

  _start(line) {
    const text = JSON.stringify(line.robot);
    if (this.robot && this.text !== text) return location.reload();
    at('notices').replaceChildren();
    at('fault').textContent = '';
    if (!this.robot) this._open(line);
    this.text = text;
    [this.watched, this.rate, this.event, this.push] = [line.watched, undefined, undefined, undefined];
    this.recorded = Recorded.growing(line.robot.joints);
    this.curves.begin(this.recorded, line.watched);
    this.pushed = line.hand;
    this._hand({ closed: this.closed });
    this.measurements = line.measurements;
    const how = line.rehearsal ? `Rehearsal at ${Math.round(100 * line.rehearsal)} %` : 'Run';
    at('title').textContent = `${how} of ${line.robot.name}, live`;
    at('simulated').hidden = !line.simulated;
    document.title = `${line.simulated ? 'SIMULATED: ' : ''}${at('title').textContent}`;
    return undefined;
  }

  _open({ robot, workspace }) {
    this.robot = robot;
    this.axes = new LiveAxes(at('axes'), robot.joints);
    this.curves = new LiveCurves(at('torques'), { robot, prediction: 'predicted' }, (t) => this._look(t));
    this.intervals = new Intervals(at('intervals'));
    try {
      this.scene = new RobotView(at('scene'), { robot, workspace });
    } catch (error) {
      at('scene').textContent = `The robot cannot be drawn here: ${error.message}.`;
      return;
    }
    for (const from of ['oblique', 'front', 'side', 'top']) {
      at('views').append(make('button', { type: 'button', text: from, onclick: () => this.scene.look(from) }));
    }
    this.scene.orbit(0, 0, 1.15);
    this.hand = new Hand(this.scene, robot, at('hand'), (torque, lasts) => this._push(torque, lasts));
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const set = () => {
      this.scene.theme(scheme.matches);
      this.curves.draw();
    };
    scheme.addEventListener('change', set);
    set();
  }

  _armed({ axes }) {
    this.power = 'armed';
    this.sampled = performance.now();
    this.axes.narrow(axes);
  }

  _off() {
    this.power = 'off';
    this._release();
  }

  /** Let the arm go: nothing moves that could be pushed. */
  _release() {
    this.pushed = false;
    this._hand({});
  }

  /** Accept pushes of the arm, or give the reason against them. */
  _hand({ closed = '' }) {
    this.closed = closed;
    this.hand?.enable(this.pushed, closed);
  }

  _sample(line) {
    this._keepPace(line.t);
    this.sampled = performance.now();
    if (!this.sample) requestAnimationFrame(() => this._draw());
    this.sample = line;
    this.recorded.sample(line.t, line.q, this.watched ? [] : line.tau);
    this.curves.draw();
  }

  /** Ratio of the bus's time to the clock's time, averaged over a second. */
  _keepPace(t) {
    const now = performance.now() / 1000;
    if (!this.since || t < this.since.t) this.since = { t, now };
    if (now - this.since.now < 1) return;
    this.rate = (t - this.since.t) / (now - this.since.now);
    this.since = { t, now };
  }

  /** Show the robot at a past instant; without one, at present. */
  _look(t) {
    this.back = t !== undefined;
    this._stand(this.recorded.q(this.back ? t : this.recorded.duration));
  }

  async _push(torque, lasts) {
    try {
      const answer = await fetch('push', { method: 'POST', headers: { 'X-Hil-Push': '1' }, body: JSON.stringify({ torque, lasts }) });
      if (!answer.ok && lasts) this._note({ at: Date.now() / 1000, text: `push: ${(await answer.text()).trim()}` });
    } catch { /* the state says that there is no connection */ }
  }

  _draw() {
    const { q, tau, t } = this.sample;
    this.sample = undefined;
    this.axes.show(q, tau);
    if (!this.back) this._stand(q);
    if (this.event?.total) at('progress').value = Math.min(t / this.event.total, 1);
  }

  _stand(q) {
    this.q = q.map((each, j) => (Number.isFinite(each) ? each : this.q?.[j] ?? 0));
    this.scene?.show(this.q);
    this.scene?.contain();
  }

  _headline({ text, more }) {
    this.headline = text;
    if (more !== undefined) at('more').textContent = more;
  }

  /** End of the run: places of the report and of the run, and the next step. */
  _report({ folder, commands }) {
    const link = make('a', { href: 'report', target: '_blank', text: 'Open the report' });
    const next = commands.map((each) => make('li', {}, make('code', { text: each })));
    const kept = make('p', { text: `Both runs are in ${folder}. Go on in a terminal:` });
    at('ended').replaceChildren(make('p', {}, link), kept, make('ul', {}, ...next));
    at('ended').hidden = false;
  }

  _torque(line) {
    this.recorded.take(line);
    this.curves.draw();
  }

  _estimate(line) {
    this.intervals.take(line);
    at('estimated').hidden = false;
  }

  _alarm(line) {
    this.curves.alarm(line);
    if (this.push === line.push) return; // one push affects several axes
    this.push = line.push;
    this._note({ ...line, text: `push ${line.push}, axis ${line.axis + 1}: ${line.torque.toFixed(1)} ${line.unit} from outside, threshold ${line.threshold.toFixed(1)} ${line.unit}` });
  }

  _event(line) {
    this.event = line;
    this.due = performance.now() + 1000 * line.left;
    const [doing, shows] = seen(line);
    at('doing').textContent = line.number ? `${doing} (${line.number} of ${this.measurements})` : doing;
    at('shows').textContent = shows;
    if (line.total) at('progress').value = Math.min(line.t / line.total, 1);
    if (line.notice) this._note({ ...line, text: line.notice });
    const axes = line.axes ?? [];
    if (!this.watched && line.number) {
      const known = this.intervals.known ? `, ${this.intervals.known}` : '';
      this.headline = `Measuring: ${line.number} of ${this.measurements}${known}`;
    }
    this.scene?.highlight(this.watched ? [] : axes);
    this.axes.highlight(axes);
  }

  _level(line) {
    this.axes.friction(line);
  }

  /** A notice; with a known bus time, a click shows the robot at this time. */
  _note({ at: when, text, t }, kind = '') {
    const time = make('time', { text: new Date(1000 * when).toLocaleTimeString() });
    const shown = !Number.isFinite(t) ? time : make('button', { type: 'button', class: 'then', title: 'Look back at it', onclick: () => this.curves.look(t) }, time);
    at('notices').prepend(make('li', { class: kind || false }, shown, text));
    while (at('notices').childElementCount > NOTICES) at('notices').lastElementChild.remove();
  }

  _fault(line) {
    at('fault').textContent = line.text;
    this._note(line, 'fault');
  }

  _stopping() {
    this.stopping = true;
  }

  _end({ how, text, at: when }) {
    this.ended = how;
    this._release();
    if (how === 'failed' && at('fault').textContent !== text) this._fault({ text, at: when });
  }

  /** Show state, remaining time and button. */
  _tick() {
    const [text, look] = this._state();
    if (at('state').textContent !== text) at('state').textContent = text;
    at('state').className = look;
    if (at('headline').textContent !== this.headline) at('headline').textContent = this.headline ?? '';
    at('none').hidden = at('notices').childElementCount > 0;
    at('stop').disabled = Boolean(this.ended) || !at('ended').hidden;
    if (this.ended) at('stop').textContent = 'Stop';
    if (this.ended === 'finished') at('progress').value = 1;
    const left = Math.max(0, ((this.due ?? 0) - performance.now()) / 1000);
    // a virtual plant that runs in real time is about to be accelerated
    const unknown = this.pushed || (!at('simulated').hidden && !(this.rate > 1.5));
    const faster = this.rate > 1.5 ? `, ${this.rate.toFixed(0)} times real time` : '';
    at('left').textContent = this.event && !at('stop').disabled && !unknown ? `${clock(left)} left${faster}` : '';
  }

  _state() {
    if (this.ended && this.power === 'armed') return ['the run has ended, and whether the axes are off is not known: look at the robot', 'bad'];
    if (this.ended) return ENDS[this.ended];
    const silent = (performance.now() - this.heard) / 1000;
    if (this.lost || silent > SILENT) return [`no connection to the run, which may go on: ${AT_THE_TERMINAL}`, 'bad'];
    if (this.stopping) return ['stopping all axes', 'armed'];
    if (this.power === 'off') return ['the axes are off', ''];
    if (this.power === 'starting') return ['starting', ''];
    const missed = (performance.now() - this.sampled) / 1000;
    if (missed > SILENT) return [`armed, but no sample for ${missed.toFixed(0)} s`, 'bad'];
    return ['armed: the axes are under power', 'armed'];
  }
}
