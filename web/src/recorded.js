// Played motion: tracks of all joints and segments of the time line, from a page's data or from
// lines of a run.
import { Track } from './track.js';

const tracks = (given) => given && given.map((each) => new Track(each));

/** Nearest link and box of each instant: a track, and indices that hold until the next knot. */
function distances(given) {
  if (!given) return null;
  const track = new Track(given);
  const at = (t) => {
    const i = track.before(t);
    return { distance: track.at(t)[0], link: given.link[i], box: given.box[i] };
  };
  return { track, at };
}

export class Recorded {
  constructor(data) {
    this.segments = data.segments;
    this.duration = data.segments.length ? data.segments.at(-1).end : 0;
    this.planned = tracks(data.planned);
    this.measured = tracks(data.measured?.position);
    this.velocity = tracks(data.measured?.velocity);
    this.torque = tracks(data.measured?.torque);
    this.predicted = tracks(data.predicted);
    this.band = tracks(data.band);
    this.distance = distances(data.distance);
    this.recorded = data.segments.filter((each) => each.recorded);
  }

  /** A running measurement without data. */
  static growing(joints) {
    const each = () => joints.map(() => new Track());
    return Object.assign(new Recorded({ segments: [] }), { measured: each(), torque: each(), predicted: each(), band: each() });
  }

  /** Take the positions of one instant, null for a missing joint, and torques until there is a recording. */
  sample(t, q, tau) {
    q.forEach((value, j) => this.measured[j].extend([t], [value ?? NaN]));
    this.duration = t;
    if (this.segments.length) return;
    tau.forEach((value, j) => this.torque[j].extend([t], [value ?? NaN]));
    this.sampled = t > this.torque[0].time[0];
  }

  /** Append torques of a recording, or current torques of all axes. */
  take({ axes, measurement, ...lines }) {
    const [{ time: instants }] = tracks(lines.torque);
    if (!instants.length) return;
    if (!this.segments.length) this.torque.forEach((_, j) => { this.torque[j] = new Track(); });
    this.sampled = false;
    for (const name of ['torque', 'predicted', 'band']) {
      tracks(lines[name]).forEach(({ time, value }, i) => this[name][axes[i]].extend(time, value));
    }
    const [begin, end] = [instants[0], instants.at(-1)];
    const last = this.segments.findLast((each) => each.id === measurement && each.axes[0] === axes[0]);
    if (last) last.end = end;
    else this.segments.push({ id: measurement, axes, begin, end });
  }

  /** Positions of the robot, measured ones if known. */
  get shown() {
    return this.measured ?? this.planned;
  }

  q(t) {
    return this.shown.map((track) => track.at(t)[0]);
  }

  /** Number of the active segment at t. */
  segment(t) {
    const found = this.segments.findIndex((each) => t < each.end);
    return found < 0 ? this.segments.length - 1 : found;
  }

  /** Position, velocity and torque of a joint at t, with planned or predicted values. */
  state(joint, t) {
    const planned = this.planned?.[joint].at(t);
    const measured = this.measured && [this.measured[joint].at(t)[0], this.velocity[joint].at(t)[0]];
    const torque = this.torque?.[joint].at(t)[0];
    const predicted = this.predicted?.[joint].at(t)[0];
    return {
      position: (measured ?? planned)[0],
      velocity: (measured ?? planned)[1],
      torque: torque ?? predicted,
      error: measured && planned ? measured[0] - planned[0] : undefined,
    };
  }

  /**
   * Joint with the greatest displacement between the ends of a segment, in multiples of its step.
   */
  busiest({ begin, end }, step) {
    const [from, to] = [this.q(begin), this.q(end)];
    const ways = step.map((each, j) => Math.abs(to[j] - from[j]) / each);
    return ways.indexOf(Math.max(...ways));
  }

  /** Configurations along a segment, each apart from all others by at least a step. */
  passed({ begin, end }, step) {
    const way = [];
    for (let k = 0; k <= SAMPLES; k++) way.push(this.q(begin + ((end - begin) * k) / SAMPLES));
    for (let share = 1; ; share *= 1.4) {
      const found = apart(way, step.map((each) => share * each));
      if (found.length <= POSES) return found;
    }
  }
}

const SAMPLES = 600;
const POSES = 96;

/** Configurations of the path that differ from all chosen before by more than a step in a joint. */
function apart(way, step) {
  const far = (a, b) => a.some((x, j) => Math.abs(x - b[j]) > step[j]);
  const found = [];
  for (const q of way) {
    if (found.every((each) => far(q, each))) found.push(q);
    if (found.length > POSES) break;
  }
  return found;
}
