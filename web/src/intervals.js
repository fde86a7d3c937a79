// 95 % intervals of the base parameters as bars that shrink, on a logarithmic scale.
import { make } from './elements.js';

const [WIDEST, NARROWEST] = [1, 1e-6]; // shares of the torque limit at the scale's ends

const SURE = 0.01; // share of the torque limit below which a parameter counts as known

export class Intervals {
  constructor(host) {
    this.host = host;
    this.rows = [];
  }

  take({ recordings, parameters }) {
    if (this.rows.length !== parameters.length) this._build(parameters);
    const sure = parameters.filter(({ half, share }) => half !== null && share < SURE).length;
    this.known = `${sure} of ${parameters.length} parameters known`;
    this.caption.textContent = `From ${recordings} recordings: ${this.known}, their 95 % intervals matter by less than ${100 * SURE} % of a torque limit`;
    parameters.forEach((each, k) => this._set(this.rows[k], each));
  }

  _build(parameters) {
    this.caption = make('caption');
    const heads = ['parameter', 'value', '± 95 %', '', '% of limit'].map((text) => make(text ? 'th' : 'td', text ? { scope: 'col', text } : {}));
    this.rows = parameters.map(({ name, meaning, expression, unit }) => {
      const [value, half, share] = [make('td'), make('td'), make('td')];
      const bar = make('span', { class: 'interval' });
      const title = make('th', { scope: 'row', title: expression }, meaning, make('span', { class: 'small', text: ` ${name}` }));
      const row = make('tr', {}, title, value, half, make('td', { class: 'bar', 'aria-hidden': 'true' }, make('span', { class: 'range' }, bar)), share);
      return { row, value, half, share, bar, unit: unit.replace('m2', 'm²') };
    });
    const body = make('tbody', {}, ...this.rows.map(({ row }) => row));
    this.host.replaceChildren(make('table', { class: 'intervals' }, this.caption, make('thead', {}, make('tr', {}, ...heads)), body));
  }

  _set(row, { value, half, share }) {
    const known = half !== null && share < WIDEST; // an interval beyond the torque limit has no significance
    row.value.textContent = known ? `${rounded(value, half)} ${row.unit}` : 'open';
    row.half.textContent = known ? figure(half) : '–';
    row.share.textContent = known ? figure(100 * share) : '–';
    const length = known ? Math.log(Math.max(share, NARROWEST) / NARROWEST) / Math.log(WIDEST / NARROWEST) : 1;
    row.bar.style.width = `${100 * Math.min(Math.max(length, 0.01), 1)}%`;
    row.bar.classList.toggle('open', !known);
  }
}

/** A value with as many decimals as the interval has significant ones. */
function rounded(value, half) {
  const places = Math.min(Math.max(1 - Math.floor(Math.log10(half || 1)), 0), 6);
  return value.toFixed(places).replace(/^-(?=0\.?0*$)/, '').replace('-', '−');
}

/** Two significant digits, never with an exponent. */
function figure(value) {
  const places = Math.min(Math.max(1 - Math.floor(Math.log10(value || 1)), 0), 6);
  return value.toFixed(places);
}
