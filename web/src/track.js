// A quantity over time: knots, joined by cubics where slopes are stated and by lines elsewhere.
// With slopes the piecewise parabolas of a planned stroke come out exactly.
import { unpack } from './packed.js';

const KEPT = 60_000; // knots of a growing track: 40 minutes of displayed samples, 25 per second

export class Track {
  /** A track from a page's data; without data, a growing one. */
  constructor(given) {
    this.time = given ? unpack(given.time) : [];
    this.value = given ? unpack(given.value) : [];
    this.slope = given?.slope ? unpack(given.slope) : null;
    this.last = 0; // players ask for one instant after the other
  }

  /** Append knots. */
  extend(time, value) {
    this.time.push(...time);
    this.value.push(...value);
    if (this.time.length > KEPT) for (const each of [this.time, this.value]) each.splice(0, KEPT / 4);
  }

  /** Index of the last knot at or before t. */
  before(t) {
    const { time } = this;
    let low = this.last;
    if (!(time[low] <= t && (low + 2 >= time.length || t < time[low + 2]))) {
      low = 0;
      let high = time.length - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (time[middle] <= t) low = middle;
        else high = middle - 1;
      }
    } else if (low + 1 < time.length && time[low + 1] <= t) low += 1;
    this.last = low;
    return low;
  }

  /** Value and rate at t; constant beyond the ends. */
  at(t) {
    const { time, value, slope } = this;
    const i = this.before(t);
    const width = time[i + 1] - time[i];
    if (t < time[0] || i + 1 >= time.length || !(width > 0)) return [value[i], 0];
    const s = (t - time[i]) / width;
    const way = value[i + 1] - value[i];
    if (!slope) return [value[i] + s * way, way / width];
    const [a, b] = [slope[i] * width, slope[i + 1] * width];
    return [
      value[i] + s * (a + s * (3 * way - 2 * a - b + s * (a + b - 2 * way))),
      (a + s * (6 * way - 4 * a - 2 * b + s * (3 * (a + b) - 6 * way))) / width,
    ];
  }

  /** Instants from begin to end for drawing the curve: knots, and points between. */
  instants(begin, end, atLeast) {
    const found = [];
    // times are rounded, and slopes at the ends must not be those of neighbouring parts
    const first = begin + 2e-4;
    const last = Math.max(end - 2e-4, first);
    for (let k = 0; k <= atLeast; k++) found.push(first + ((last - first) * k) / atLeast);
    const within = [];
    for (let i = this.before(first); i < this.time.length && this.time[i] <= last; i++) {
      if (this.time[i] >= first) within.push(this.time[i]);
    }
    const every = Math.max(1, Math.ceil(within.length / (4 * atLeast)));
    return [...found, ...within.filter((_, i) => i % every === 0)].sort((a, b) => a - b);
  }
}
