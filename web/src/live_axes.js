// The table of axes of a running measurement: position in its range, torque in its limit, friction.
import { make, shown } from './elements.js';

const HIGH = 0.9; // share of the torque limit from which it is marked

export class LiveAxes {
  constructor(host, joints) {
    this.joints = joints.map((joint) => ({ ...joint }));
    this.rows = joints.map((joint, j) => this._row(joint, j));
    const heads = ['axis', 'position', 'torque', 'friction so far'].map((text) => make('th', { scope: 'col', text }));
    const body = make('tbody', {}, ...this.rows.map(({ row }) => row));
    host.replaceChildren(make('table', {}, make('thead', {}, make('tr', {}, ...heads)), body));
  }

  _row(joint, j) {
    const fill = make('span', { class: 'fill' });
    const bar = make('span', { class: 'torque-bar' });
    const [position, torque] = [make('span'), make('span')];
    const [ends, most] = [make('span', { class: 'small' }), make('span', { class: 'small' })];
    const friction = make('td', { class: 'friction' });
    const name = make('th', { scope: 'row', text: `${j + 1}` });
    const range = make('span', { class: 'range', 'aria-hidden': 'true' }, fill);
    const limit = make('span', { class: 'range', 'aria-hidden': 'true' }, bar);
    limit.hidden = most.hidden = !joint.torque;
    ends.textContent = within(joint);
    most.textContent = `limit ${shown(joint.torque, joint.torque)}`;
    const row = make('tr', { class: 'unknown' }, name, make('td', {}, position, range, ends), make('td', {}, torque, limit, most), friction);
    return { row, position, fill, ends, torque, bar, friction };
  }

  /** Take the limits in force on the drives. */
  narrow(axes) {
    axes.forEach(({ name, lower, upper }, j) => {
      const joint = this.joints[j];
      joint.lower = Math.max(joint.lower, lower ?? joint.lower);
      joint.upper = Math.min(joint.upper, upper ?? joint.upper);
      this.rows[j].ends.textContent = within(joint);
      this.rows[j].row.title = name;
    });
  }

  /** Show positions and torques; null marks missing values. */
  show(q, tau) {
    this.rows.forEach((row, j) => {
      row.row.classList.remove('unknown');
      const { lower, upper, unit, torque, torque_unit: torqueUnit } = this.joints[j];
      row.position.textContent = q[j] === null ? 'missing' : `${shown(q[j], upper - lower)} ${unit}`;
      if (q[j] !== null) row.fill.style.left = `${100 * Math.min(Math.max((q[j] - lower) / (upper - lower), 0), 1)}%`;
      row.torque.textContent = tau[j] === null ? 'missing' : `${shown(tau[j], torque ?? 100)} ${torqueUnit}`;
      const share = Math.min(Math.max((tau[j] ?? 0) / (torque ?? 1), -1), 1);
      row.bar.style.left = `${50 + 50 * Math.min(share, 0)}%`;
      row.bar.style.width = `${50 * Math.abs(share)}%`;
      row.bar.classList.toggle('high', Math.abs(share) > HIGH);
    });
  }

  /** Mark the measured axes. */
  highlight(axes) {
    this.rows.forEach(({ row }, j) => row.classList.toggle('measured', axes.includes(j)));
  }

  /** Show a level of friction. */
  friction({ axis, level, speed, count, least, most }) {
    const { unit, torque_unit: torqueUnit } = this.joints[axis];
    const [now, from, to] = [level, least, most].map((each) => shown(each, Math.abs(level)));
    const range = count > 1 ? ` (${count} so far: ${from} to ${to})` : '';
    this.rows[axis].friction.textContent = `${now} ${torqueUnit} at ${shown(speed, 10)} ${unit}/s${range}`;
  }
}

/** The range of a joint's position. */
function within({ lower, upper }) {
  return `${shown(lower, upper - lower)} to ${shown(upper, upper - lower)}`;
}
