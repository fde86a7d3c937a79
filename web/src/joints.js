// The table of joints: sliders of a robot, or the state of the played motion.
import { make, shown } from './elements.js';

const IN_RANGE = 'in its range';
const within = ({ lower, upper }, q) => Math.min(Math.max((q - lower) / (upper - lower), 0), 1);

/** Sliders for all joints within their limits; calls back with q. */
export function sliders(host, joints, start, changed) {
  const q = Array.from(start);
  const rows = joints.map((joint, j) => {
    const { lower, upper, unit } = joint;
    const output = make('output', { text: `${shown(q[j], upper - lower)} ${unit}` });
    const slider = make('input', {
      type: 'range', min: lower, max: upper, step: (upper - lower) / 1000, value: q[j],
      'aria-label': `Joint ${j + 1}, ${lower.toPrecision(3)} to ${upper.toPrecision(3)} ${unit}`,
      oninput: () => {
        q[j] = Number(slider.value);
        output.textContent = `${shown(q[j], upper - lower)} ${unit}`;
        changed(q, j);
      },
    });
    return make('tr', {}, make('th', { scope: 'row', text: `${j + 1}` }),
      make('td', { text: shown(lower, upper - lower) }), make('td', { class: 'wide' }, slider),
      make('td', { text: shown(upper, upper - lower) }), make('td', {}, output));
  });
  const heads = ['joint', 'lowest', 'position', 'highest', 'set'].map((text) => make('th', { scope: 'col', text }));
  host.append(make('table', {}, make('thead', {}, make('tr', {}, ...heads)), make('tbody', {}, ...rows)));
}

/** The state of all axes at the displayed instant. */
export class States {
  constructor(host, joints, { torque, error }) {
    this.joints = joints;
    const heads = ['axis', 'position', IN_RANGE, 'velocity', ...(error ? ['less set-point'] : []), ...(torque ? ['torque'] : [])];
    this.rows = joints.map((_, j) => this._row(j, { torque, error }));
    const head = make('tr', {}, ...heads.map((text) => make('th', { scope: 'col', text, class: text === IN_RANGE && 'wide' })));
    host.append(make('table', { class: 'played' }, make('thead', {}, head), make('tbody', {}, ...this.rows.map(({ row }) => row))));
  }

  _row(j, { torque, error }) {
    const cells = { position: make('td'), velocity: make('td'), ...(error && { error: make('td') }), ...(torque && { torque: make('td') }) };
    const fill = make('span', { class: 'fill' });
    const range = make('td', { class: 'wide' }, make('span', { class: 'range', 'aria-hidden': 'true' }, fill));
    const { position, ...others } = cells;
    const row = make('tr', {}, make('th', { scope: 'row', text: `${j + 1}` }), position, range, ...Object.values(others));
    return { row, fill, ...cells };
  }

  show(states, measured) {
    states.forEach(({ position, velocity, torque, error }, j) => {
      const { unit, torque_unit: torqueUnit, lower, upper } = this.joints[j];
      const each = this.rows[j];
      each.position.textContent = `${shown(position, upper - lower)} ${unit}`;
      each.velocity.textContent = `${shown(velocity, 5)} ${unit}/s`;
      if (each.error) each.error.textContent = error === undefined ? '–' : `${shown(1000 * error, 10)} m${unit}`;
      if (each.torque) each.torque.textContent = `${shown(torque, 100)} ${torqueUnit}`;
      each.fill.style.left = `${100 * within(this.joints[j], position)}%`;
      each.row.classList.toggle('measured', measured.includes(j));
    });
  }
}
