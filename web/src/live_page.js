// What a run's lines (hil/live/lines.py) change on the page. Text is only ever set as text.
import { clock, make } from './elements.js';
import { LiveAxes } from './live_axes.js';
import { RobotView } from './robot_view.js';

const at = (id) => document.getElementById(id);
const SILENT = 2; // after which samples, or all signs of life, are missed [s]
const NOTICES = 200;
const AT_THE_TERMINAL = 'stop it with Ctrl-C at the terminal, or by the emergency stop';
const ENDS = {
  finished: ['the run is finished, the axes are off', ''],
  stopped: ['stopped, the axes are off', ''],
  failed: ['the run has ended with a fault, the axes are off', 'bad'],
  lost: ['the run has ended without a word: look at the robot', 'bad'],
};

export class LivePage {
  constructor() {
    this.power = 'starting';
    this.ended = '';
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
    try {
      this.scene = new RobotView(at('scene'), { robot, workspace });
    } catch (error) {
      at('scene').textContent = `The robot cannot be drawn here: ${error.message}.`;
      return;
    }
    for (const from of ['oblique', 'front', 'side', 'top']) {
      at('views').append(make('button', { type: 'button', text: from, onclick: () => this.scene.look(from) }));
    }
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const set = () => this.scene.theme(scheme.matches);
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
  }

  _sample(line) {
    this.sampled = performance.now();
    if (!this.sample) requestAnimationFrame(() => this._draw());
    this.sample = line;
  }

  _draw() {
    const { q, tau, t } = this.sample;
    this.sample = undefined;
    this.q = q.map((each, j) => each ?? this.q?.[j] ?? 0);
    this.scene?.show(this.q);
    this.axes.show(q, tau);
    if (this.event?.total) at('progress').value = Math.min(t / this.event.total, 1);
  }

  _event(line) {
    this.event = line;
    this.due = performance.now() + 1000 * line.left;
    at('doing').textContent = line.number ? `${line.doing}, ${line.number} of ${this.measurements}` : line.doing;
    if (line.total) at('progress').value = Math.min(line.t / line.total, 1);
    if (line.notice) this._note({ ...line, text: line.notice });
    const axes = line.axes ?? [];
    this.scene?.highlight(axes);
    this.axes.highlight(axes);
  }

  _level(line) {
    this.axes.friction(line);
  }

  _note({ at: when, text }, kind = '') {
    const time = make('time', { text: new Date(1000 * when).toLocaleTimeString() });
    at('notices').prepend(make('li', { class: kind || false }, time, text));
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
    if (how === 'failed' && at('fault').textContent !== text) this._fault({ text, at: when });
  }

  /** State, time left and the button, as they are now. */
  _tick() {
    const [text, look] = this._state();
    if (at('state').textContent !== text) at('state').textContent = text;
    at('state').className = look;
    at('none').hidden = at('notices').childElementCount > 0;
    at('stop').disabled = Boolean(this.ended);
    if (this.ended) at('stop').textContent = 'Stop';
    if (this.ended === 'finished') at('progress').value = 1;
    const left = Math.max(0, ((this.due ?? 0) - performance.now()) / 1000);
    at('left').textContent = this.event && !this.ended ? `${clock(left)} left` : '';
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
