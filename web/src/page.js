// The page, built from its packed data.
import { curvesOf } from './curves_of.js';
import { clock, make } from './elements.js';
import { States, sliders } from './joints.js';
import { inflate } from './packed.js';
import { Player, SPEEDS } from './player.js';
import { Recorded } from './recorded.js';
import { RobotView } from './robot_view.js';
import { Timeline } from './timeline.js';

const at = (id) => document.getElementById(id);

/** Open the page on its data; `window.view` then answers questions of tests and other scripts. */
export async function open() {
  try {
    const data = await inflate(at('data').textContent.trim());
    const scene = new RobotView(at('scene'), data);
    colours(data.kinds, scene);
    buttons(scene, data);
    window.view = data.segments.length ? played(scene, data) : still(scene, data);
  } catch (error) {
    at('failure').textContent = `This page cannot be shown here: ${error.message}. It needs a browser of 2023 or later with WebGL.`;
    at('failure').hidden = false;
    throw error;
  }
}

/** A robot with joints set by hand. */
function still(scene, { robot }) {
  at('player').hidden = true;
  sliders(at('states'), robot.joints, scene.q, (q, joint) => {
    scene.show(q);
    scene.highlight([joint]);
  });
  return { scene, show: (q) => scene.show(q) };
}

/** A plan or a run over time. */
function played(scene, data) {
  const recorded = new Recorded(data);
  const player = new Player(recorded.duration);
  const page = new Played(scene, data, recorded, player);
  page.follow();
  return {
    scene, player, show: (q) => scene.show(q), seek: (t) => player.seek(t), q: (t) => recorded.q(t),
    segments: recorded.segments, passed: (number) => page.passed(number), steps: page.steps,
  };
}

class Played {
  constructor(scene, data, recorded, player) {
    Object.assign(this, { scene, data, recorded, player, segment: -1, chosen: -1 });
    this.timeline = new Timeline(at('timeline'), { ...data, duration: recorded.duration, player });
    const joints = data.robot.joints;
    this.states = new States(at('states'), joints, {
      torque: Boolean(recorded.torque ?? recorded.predicted),
      error: Boolean(recorded.measured && recorded.planned),
    });
    this.curves = curvesOf(at('curves'), data, recorded, (t) => player.seek(t), (span) => {
      this.span = span;
      this._draw();
    });
    this._controls();
    player.addEventListener('time', () => this.follow());
    player.addEventListener('state', () => this._showState());
    document.addEventListener('keydown', (event) => this._key(event));
    new ResizeObserver(() => this._draw()).observe(at('curves'));
    this._showState();
  }

  /** Show the instant of the player in all parts of the page. */
  follow() {
    const { recorded, player: { time } } = this;
    const number = recorded.segment(time);
    if (number !== this.segment) this._enter(number);
    this.scene.show(recorded.q(time));
    this._showDistance(time);
    this.states.show(this.data.robot.joints.map((_, j) => recorded.state(j, time)), this.current.axes);
    for (const curve of this.curves) curve.cursor(time);
    this.timeline.show(time, this.current.words);
    at('clock').textContent = `${clock(time)} of ${clock(recorded.duration)}`;
  }

  get current() {
    return this.recorded.segments[this.segment];
  }

  get joint() {
    if (this.chosen >= 0) return this.chosen;
    return this.current.recorded ? this.current.axes[0] ?? 0 : this.recorded.busiest(this.current, this.steps);
  }

  _enter(number) {
    this.segment = number;
    this.span = undefined;
    const { words, problem, axes } = this.current;
    at('now').textContent = words;
    at('problem').textContent = problem ?? '';
    at('problem').hidden = !problem;
    this.scene.highlight(axes);
    this._sweep();
    if (this.current.recorded) at('measurement').value = String(number);
    this._draw();
  }

  _sweep() {
    this.scene.sweep(this.passed(this.segment));
  }

  /** Configurations for the volume of a segment; empty for a hidden volume. */
  passed(number) {
    return at('show-swept').checked ? this.recorded.passed(this.recorded.segments[number], this.steps) : [];
  }

  get steps() {
    return this.data.robot.joints.map(({ step }) => step);
  }

  _draw() {
    if (this.segment < 0) return;
    const { begin, end } = this.current;
    for (const curve of this.curves) curve.draw(this.joint, ...this.span ?? [begin, end], { origin: begin });
    for (const curve of this.curves) curve.cursor(this.player.time);
  }

  _showDistance(time) {
    if (!this.recorded.distance) return;
    const { distance, link, box } = this.recorded.distance.at(time);
    const near = distance < 2 * this.data.workspace.margin;
    at('distance').textContent = `nearest to a box: ${(1000 * distance).toFixed(0)} mm, link ${link + 1} to ${this.data.workspace.boxes[box].name}`;
    this.scene.nearest(near ? link : -1, near ? box : -1);
  }

  _controls() {
    const { player, recorded } = this;
    at('play').addEventListener('click', () => player.toggle());
    at('previous').addEventListener('click', () => this._jump(-1));
    at('next').addEventListener('click', () => this._jump(1));
    at('speed').append(...SPEEDS.map((speed) => make('option', { value: speed, text: `${speed} ×` })));
    at('speed').addEventListener('change', (event) => player.setSpeed(Number(event.target.value)));
    at('measurement').append(...recorded.segments.flatMap((each, i) => (each.recorded
      ? [make('option', { value: i, text: `${each.words}, ${clock(each.begin)}${each.problem ? ', refused' : ''}` })] : [])));
    at('measurement').addEventListener('change', (event) => player.seek(recorded.segments[event.target.value].begin));
    at('axis').append(make('option', { value: -1, text: 'axis under way' }),
      ...this.data.robot.joints.map((_, j) => make('option', { value: j, text: `axis ${j + 1}` })));
    at('axis').addEventListener('change', (event) => { this.chosen = Number(event.target.value); this._draw(); });
    at('show-swept').addEventListener('change', () => this._sweep());
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this._draw());
  }

  _showState() {
    const { playing, speed } = this.player;
    at('play').textContent = playing ? 'Pause' : 'Play';
    at('speed').value = String(speed);
  }

  /** Go to the previous or next measurement. */
  _jump(by) {
    const { recorded, player } = this;
    const here = by > 0
      ? recorded.recorded.find((each) => each.begin > player.time)
      : recorded.recorded.findLast((each) => each.begin < player.time - 1e-6);
    if (here) player.seek(here.begin);
  }

  _key(event) {
    const within = event.target.closest?.('select, input, button, summary');
    if (event.ctrlKey || event.metaKey || event.altKey || (within && event.key === ' ')) return;
    if (event.target.closest?.('select')) return;
    const { player } = this;
    const acts = {
      ' ': () => player.toggle(), k: () => player.toggle(),
      ArrowLeft: () => player.seek(player.time - (event.shiftKey ? 10 : 1)),
      ArrowRight: () => player.seek(player.time + (event.shiftKey ? 10 : 1)),
      n: () => this._jump(1), p: () => this._jump(-1), f: () => player.change(1), s: () => player.change(-1),
      Home: () => player.seek(0), End: () => player.seek(player.duration),
    }[event.key];
    if (!acts) return;
    acts();
    event.preventDefault();
  }
}

/** Buttons for views and for visible parts. */
function buttons(scene, { robot, workspace, segments }) {
  for (const from of ['oblique', 'front', 'side', 'top']) {
    at('views').append(make('button', { type: 'button', text: from, onclick: () => scene.look(from) }));
  }
  const covered = Boolean(robot.meshes?.length);
  const parts = [
    ['links', 'capsules', !covered, true], ['meshes', 'meshes', covered, covered],
    ['boxes', 'boxes', true, Boolean(workspace?.boxes.length)], ['limits', 'joint limits', true, true],
    ['swept', 'swept volume', true, segments.length > 0],
  ];
  for (const [part, name, on, there] of parts.filter(([, , , there]) => there)) {
    const box = make('input', { type: 'checkbox', id: `show-${part}`, checked: on, onchange: () => scene.toggle(part, box.checked) });
    at('parts').append(make('label', {}, box, ` ${name}`));
  }
}

/** Colours of kinds and of the scene for this colour scheme. */
function colours(kinds, scene) {
  const scheme = matchMedia('(prefers-color-scheme: dark)');
  const set = () => {
    kinds.forEach(({ colour }, i) => {
      const mixed = scheme.matches ? `color-mix(in srgb, ${colour} 62%, white)` : colour;
      document.documentElement.style.setProperty(`--kind-${i}`, mixed);
    });
    scene.theme(scheme.matches);
  };
  scheme.addEventListener('change', set);
  set();
}
