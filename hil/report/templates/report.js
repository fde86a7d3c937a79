// Points of measurements: their ids under the pointer and the focus, and the recordings behind them.
// Without it the page shows the same, but neither ids nor recordings.
'use strict';
(() => {
  const NEAR = 12; // from the pointer to a point that it means, in pixels
  const element = (name, attributes = {}, text = '', space = 'http://www.w3.org/1999/xhtml') => {
    const made = document.createElementNS(space, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.textContent = text;
    return made;
  };
  const drawn = (name, attributes, text) =>
    element(name, attributes, text, 'http://www.w3.org/2000/svg');

  // What overflows can be reached by the keyboard.
  const scrolling = () => {
    for (const each of document.querySelectorAll('.wide, .panels > div')) {
      if (each.scrollWidth > each.clientWidth) each.tabIndex = 0;
      else each.removeAttribute('tabindex');
    }
  };
  addEventListener('resize', scrolling);
  scrolling();

  const carried = document.getElementById('recordings');
  if (!carried) return;
  const inflate = async () => {
    const bytes = Uint8Array.from(atob(carried.textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
    return new Map(Object.entries(JSON.parse(await new Response(stream).text())));
  };
  let recordings;

  const tip = element('div', { id: 'tip', hidden: '' });
  const dialog = element('dialog', { 'aria-labelledby': 'recording' });
  document.body.append(tip, dialog);
  dialog.addEventListener('click', (event) => event.target === dialog && dialog.close());

  // A curve over time: least and greatest, or one value, of each stretch of it.
  const SIZE = { height: 150, left: 62, bottom: 34, top: 8, right: 10 };
  const written = (value, step) =>
    value.toFixed(Math.max(0, -Math.floor(Math.log10(step)))).replace('-', '−');
  const marks = (low, high, most) => {
    const least = (high - low) / most || 1;
    const size = 10 ** Math.floor(Math.log10(least));
    const step = size * [1, 2, 5, 10].find((each) => each * size >= least);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) {
      found.push([k * step, written(k * step, step)]);
    }
    return found;
  };
  const curve = ({ step, differences }, duration, label) => {
    let sum = 0;
    const values = differences.map((each) => (sum += each) * step);
    const width = Math.max(300, Math.min(640, innerWidth - 80));
    const { height, left, right, top, bottom } = SIZE;
    const margin = 0.05 * (Math.max(...values) - Math.min(...values)) || 1;
    const low = Math.min(...values) - margin;
    const high = Math.max(...values) + margin;
    const x = (t) => left + (t / duration) * (width - left - right);
    const y = (value) => height - bottom - ((value - low) / (high - low)) * (height - top - bottom);
    const picture = drawn('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': label });
    const across = marks(0, duration, width / 80);
    const up = marks(low, high, 4);
    const grid = [...across.map(([t]) => `M${x(t)} ${top}V${height - bottom}`),
      ...up.map(([value]) => `M${left} ${y(value)}H${width - right}`)].join('');
    const last = Math.max(values.length - 1, 1);
    const line = values.map((value, k) => `${k ? 'L' : 'M'}${x((k / last) * duration).toFixed(1)} ${y(value).toFixed(1)}`);
    picture.append(
      drawn('path', { class: 'grid', d: grid }),
      drawn('path', { class: 'measured', d: line.join('') }),
      drawn('path', { class: 'frame', d: `M${left} ${top}V${height - bottom}H${width - right}` }),
      ...across.map(([t, text]) => drawn('text', { class: 'middle', x: x(t), y: height - bottom + 13 }, text)),
      ...up.map(([value, text]) => drawn('text', { class: 'end', x: left - 5, y: y(value) + 4 }, text)),
      drawn('text', { class: 'middle', x: (left + width - right) / 2, y: height - 3 }, 'time [s]'),
      drawn('text', { class: 'middle', x: 11, y: (height - bottom + top) / 2,
        transform: `rotate(-90 11 ${(height - bottom + top) / 2})` }, label),
    );
    return picture;
  };

  const open = async (id) => {
    recordings ??= inflate();
    const { words, duration, axes } = (await recordings).get(id);
    const close = element('button', { type: 'button' }, 'Close');
    close.addEventListener('click', () => dialog.close());
    const body = element('div', { class: 'chart' });
    for (const { name, units, torque, position } of axes) {
      body.append(element('h3', {}, name));
      body.append(curve(torque, duration, `${units[0] === 'N' ? 'force' : 'torque'} [${units[0]}]`));
      body.append(curve(position, duration, `position [${units[1]}]`));
    }
    const top = element('div', { class: 'top' });
    top.append(element('h2', { id: 'recording' }, `${id}: ${words}`), close);
    const note = 'As recorded; of each stretch of time the least and the greatest torque.';
    dialog.replaceChildren(top, body, element('p', { class: 'small' }, note));
    dialog.showModal();
  };

  // Points of the same measurement stand out together.
  const alike = new Map();
  for (const each of document.querySelectorAll('[data-m]')) {
    alike.set(each.dataset.m, [...(alike.get(each.dataset.m) ?? []), each]);
  }
  let marked = [];
  const mark = (points) => {
    for (const each of marked) each.classList.remove('same');
    for (const each of points) each.classList.add('same');
    marked = points;
  };
  const show = (point) => {
    const box = point.getBoundingClientRect();
    tip.textContent = point.dataset.m;
    tip.hidden = false;
    const right = document.documentElement.clientWidth - tip.offsetWidth - 4;
    tip.style.left = `${scrollX + Math.max(4, Math.min(box.right + 6, right))}px`;
    tip.style.top = `${scrollY + box.top - tip.offsetHeight - 2}px`;
    mark(alike.get(point.dataset.m));
  };
  const hide = () => {
    tip.hidden = true;
    mark([]);
  };
  const nearest = (points, event) => {
    let found = null;
    let least = NEAR;
    for (const point of points) {
      const box = point.getBoundingClientRect();
      const away = Math.hypot(event.clientX - (box.left + box.right) / 2,
        event.clientY - (box.top + box.bottom) / 2);
      if (away < least) [found, least] = [point, away];
    }
    return found;
  };

  // One stop of the Tab key for each panel; the arrows go from point to point.
  for (const panel of document.querySelectorAll('.panels svg')) {
    const points = [...panel.querySelectorAll('[data-m]')];
    if (!points.length) continue;
    panel.closest('[role="img"]')?.setAttribute('role', 'group');
    for (const point of points) {
      point.setAttribute('role', 'button');
      point.setAttribute('aria-label', `${point.dataset.m}, open its recording`);
      point.setAttribute('tabindex', '-1');
    }
    points[0].setAttribute('tabindex', '0');
    panel.addEventListener('pointermove', (event) => {
      const point = nearest(points, event);
      panel.classList.toggle('pointed', Boolean(point));
      if (point) show(point);
      else hide();
    });
    panel.addEventListener('pointerleave', hide);
    panel.addEventListener('click', (event) => {
      const point = nearest(points, event);
      if (point) open(point.dataset.m);
    });
    panel.addEventListener('focusin', (event) => event.target.dataset.m && show(event.target));
    panel.addEventListener('focusout', hide);
    panel.addEventListener('keydown', (event) => {
      const at = points.indexOf(event.target);
      const way = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (at < 0) return;
      if (event.key === 'Enter' || event.key === ' ') open(event.target.dataset.m);
      else if (way) {
        const next = points[(at + way + points.length) % points.length];
        event.target.setAttribute('tabindex', '-1');
        next.setAttribute('tabindex', '0');
        next.focus();
      } else return;
      event.preventDefault();
    });
  }
  document.querySelector('.hint').hidden = false;
})();
