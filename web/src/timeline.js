// The time line: a strip coloured by kind of segment, above a slider that sets the instant.
import { clock, make } from './elements.js';

const SVG = 'http://www.w3.org/2000/svg';

export class Timeline {
  constructor(host, { segments, kinds, duration, player }) {
    this.player = player;
    this.slider = make('input', {
      type: 'range', min: 0, max: duration, step: 'any', value: 0, 'aria-label': 'Instant',
      oninput: () => player.seek(Number(this.slider.value)),
    });
    this.slider.addEventListener('keydown', (event) => this._key(event));
    host.append(strip(segments, kinds, duration), this.slider, legend(segments, kinds));
  }

  show(time, words) {
    this.slider.value = time;
    this.slider.setAttribute('aria-valuetext', `${clock(time)}, ${words}`);
  }

  _key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1, PageDown: -30, PageUp: 30 }[event.key];
    if (!by) return;
    this.player.seek(this.player.time + by * (event.shiftKey ? 10 : 1));
    event.preventDefault();
    event.stopPropagation();
  }
}

function strip(segments, kinds, duration) {
  const svg = document.createElementNS(SVG, 'svg');
  const attributes = { viewBox: '0 0 1000 20', preserveAspectRatio: 'none', class: 'strip', 'aria-hidden': 'true' };
  for (const [key, value] of Object.entries(attributes)) svg.setAttribute(key, value);
  for (const { begin, end, kind, problem } of segments) {
    const rect = document.createElementNS(SVG, 'rect');
    rect.setAttribute('x', (1000 * begin) / duration);
    rect.setAttribute('width', Math.max((1000 * (end - begin)) / duration, 0.3));
    rect.setAttribute('y', kinds[kind].moves ? 6 : 0);
    rect.setAttribute('height', kinds[kind].moves ? 8 : 20);
    rect.style.fill = problem ? 'var(--bad)' : `var(--kind-${kind})`;
    svg.append(rect);
  }
  return svg;
}

function legend(segments, kinds) {
  const items = kinds.map(({ name }, kind) => {
    const of = segments.filter((each) => each.kind === kind);
    const time = clock(of.reduce((sum, { begin, end }) => sum + end - begin, 0));
    const swatch = make('span', { class: 'swatch' });
    swatch.style.background = `var(--kind-${kind})`;
    return make('li', {}, swatch, `${name}, ${of.length} in ${time}`);
  });
  return make('ul', { class: 'legend' }, ...items);
}
