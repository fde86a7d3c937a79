// A hand at the virtual arm: a dragged link is pulled towards the pointer; a button pushes one
// axis.
import { Raycaster, Vector2, Vector3 } from 'three';
import { make } from './elements.js';

const STRONGEST = 0.2; // share of an axis's torque limit
const FULL = 0.25; // share of the reach by which the pointer goes for the strongest pull
const EVERY = 100; // interval at which a pull is repeated [ms]
const PUSHED = 0.5; // duration of a push by a button [s]
const LASTS = 0.3; // time after the last message until the arm is released [s]
const HINT = 'Drag a link of the arm';
const GRIP = [0, 14, 32]; // radii about the pointer in which a link is searched, so that a near miss does not turn the camera [pixels]
const AROUND = 8; // directions of a ring

export class Hand {
  /** `send(torque, lasts)` transmits a push. */
  constructor(view, robot, host, send) {
    this.view = view;
    this.joints = robot.joints;
    this.reach = robot.reach;
    this.send = send;
    this.ray = new Raycaster();
    this.element = view.renderer.domElement;
    const on = (name, action) => this.element.addEventListener(name, action, { capture: true });
    on('pointerdown', (event) => this._grip(event));
    on('pointermove', (event) => this._pull(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) on(end, () => this._letGo());
    this.force = make('span', { class: 'force small' }); // over the picture, which must not move under the pointer
    view.host.append(this.force);
    const buttons = this.joints.map((_, j) => make('button', { type: 'button', text: `axis ${j + 1}`, 'aria-label': `Push axis ${j + 1}`, onclick: () => this._push(j) }));
    this.bar = make('div', { class: 'row', role: 'group', 'aria-label': 'Push the arm' }, make('span', { text: 'Drag a link, or push' }), ...buttons);
    host.append(this.bar);
    this.enable(false, '');
  }

  /** Take pushes or not; a drag of the arm is answered by the reason why not, if there is one. */
  enable(on, closed) {
    this.on = on && !closed;
    this.closed = closed;
    this.bar.hidden = !this.on;
    this.element.classList.toggle('pushed', this.on);
    this._letGo();
  }

  /** Torque of a pull at a point, by virtual work: J' F. */
  static torques(joints, frames, link, point, force) {
    return joints.map(({ revolute }, j) => {
      if (j > link) return 0;
      const { elements: e } = frames[j];
      const axis = new Vector3(e[8], e[9], e[10]);
      if (!revolute) return axis.dot(force);
      return axis.dot(point.clone().sub(new Vector3(e[12], e[13], e[14])).cross(force));
    });
  }

  _push(j) {
    const torque = this.joints.map((joint, k) => (k === j ? STRONGEST * joint.torque : 0));
    this.send(torque, PUSHED);
    this.force.textContent = `pushed axis ${j + 1} with ${torque[j].toFixed(0)} ${this.joints[j].torque_unit}`;
  }

  _grip(event) {
    const held = (this.on || this.closed) && this._under(event);
    if (!held) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.force.textContent = this.closed;
    if (this.closed) return;
    this.element.setPointerCapture(event.pointerId);
    const inverse = this.view.chain.frames[held.link].clone().invert();
    this.held = { link: held.link, local: held.point.clone().applyMatrix4(inverse), depth: held.point.clone().project(this.view.camera).z };
    this.to = held.point;
    this.view.highlight([held.link]);
    this.timer = setInterval(() => this._tell(), EVERY);
  }

  /** Link and point at or near the pointer: a fingertip is wide, and the wrist slender. */
  _under(event) {
    const links = this.view.capsules.filter(({ visible }) => visible);
    for (const radius of GRIP) {
      for (let k = 0; k < (radius ? AROUND : 1); k++) {
        const angle = (2 * Math.PI * k) / AROUND;
        this.ray.setFromCamera(this._place(event, radius * Math.cos(angle), radius * Math.sin(angle)), this.view.camera);
        const [hit] = this.ray.intersectObjects(links);
        if (hit) return { link: this.view.capsules.indexOf(hit.object), point: hit.point };
      }
    }
    return undefined;
  }

  _place({ clientX, clientY }, dx = 0, dy = 0) {
    const { left, top, width, height } = this.element.getBoundingClientRect();
    return new Vector2((2 * (clientX + dx - left)) / width - 1, 1 - (2 * (clientY + dy - top)) / height);
  }

  _pull(event) {
    if (!this.held) return;
    event.stopImmediatePropagation();
    const { x, y } = this._place(event);
    this.to = new Vector3(x, y, this.held.depth).unproject(this.view.camera);
  }

  _tell() {
    const { link, local } = this.held;
    const { frames } = this.view.chain;
    const at = local.clone().applyMatrix4(frames[link]);
    const way = this.to.clone().sub(at);
    const far = way.length();
    if (far < 1e-3 * this.reach) return;
    const unit = way.divideScalar(far);
    const torque = Hand.torques(this.joints, frames, link, at, unit);
    const most = Math.max(...torque.map((each, j) => Math.abs(each) / this.joints[j].torque));
    const force = Math.min((STRONGEST / most) * Math.min(far / (FULL * this.reach), 1), 500);
    this.send(torque.map((each) => each * force), LASTS);
    this.view.pull(at, this.to);
    this.force.textContent = `pulling with ${force.toFixed(0)} N`;
  }

  _letGo() {
    this.force.textContent = this.on ? HINT : '';
    if (!this.held) return;
    clearInterval(this.timer);
    this.held = undefined;
    this.send(this.joints.map(() => 0), 0);
    this.view.pull();
    this.view.highlight([]);
  }
}
