// What a page offers beside what it shows: recordings behind points and parameters, and an instant
// that curves and the robot show together. Without it the page shows the same, and none of these.
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

  const carried = document.getElementById('carried');
  if (!carried) return;
  const inflate = async ({ textContent }) => {
    const bytes = Uint8Array.from(atob(textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
    return JSON.parse(await new Response(stream).text());
  };
  let inflated;
  const data = () => (inflated ??= inflate(carried));
  const sums = ({ step, differences }) => {
    let sum = 0;
    return differences.map((each) => (sum += each) * step);
  };

  const tip = element('div', { id: 'tip', hidden: '' });
  const dialog = element('dialog', { 'aria-labelledby': 'recording' });
  document.body.append(tip, dialog);
  dialog.addEventListener('click', (event) => event.target === dialog && dialog.close());

  // Curves over time, from the back to the front; an area has a second line to go back along.
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
  const evenly = (packed, duration) => {
    const y = sums(packed);
    return { t: y.map((_, k) => (k / Math.max(y.length - 1, 1)) * duration), y };
  };
  const curves = (shown, duration, label) => {
    const width = Math.max(300, Math.min(640, innerWidth - 80));
    const { height, left, right, top, bottom } = SIZE;
    const every = shown.flatMap(({ y, low = [] }) => [...y, ...low]);
    const [least, most] = every.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const margin = 0.05 * (most - least) || 1;
    const [low, high] = [least - margin, most + margin];
    const x = (t) => left + (t / duration) * (width - left - right);
    const y = (value) => height - bottom - ((value - low) / (high - low)) * (height - top - bottom);
    const picture = drawn('svg', { viewBox: `0 0 ${width} ${height}`, width, role: 'img', 'aria-label': label });
    const across = marks(0, duration, width / 80);
    const up = marks(low, high, 4);
    const grid = [...across.map(([t]) => `M${x(t)} ${top}V${height - bottom}`),
      ...up.map(([value]) => `M${left} ${y(value)}H${width - right}`)].join('');
    const at = (t, v) => `${x(t).toFixed(1)} ${y(v).toFixed(1)}`;
    // a line is interrupted where samples are missing
    const path = ({ t, y: values, low: back }) => {
      const hole = 3 * ((t.at(-1) - t[0]) / t.length);
      const runs = [];
      t.forEach((each, k) => (k && each - t[k - 1] < hole ? runs.at(-1).push(k) : runs.push([k])));
      return runs.map((own) => `M${own.map((k) => at(t[k], values[k])).join('L')}${
        back ? `L${own.toReversed().map((k) => at(t[k], back[k])).join('L')}Z` : ''}`).join('');
    };
    picture.append(
      drawn('path', { class: 'grid', d: grid }),
      ...shown.map((each) => {
        const group = drawn('g', { class: each.colour });
        group.append(drawn('path', { class: each.low ? 'band' : '', d: path(each), ...(each.dash && { 'stroke-dasharray': each.dash }) }));
        return group;
      }),
      drawn('path', { class: 'frame', d: `M${left} ${top}V${height - bottom}H${width - right}` }),
      ...across.map(([t, text]) => drawn('text', { class: 'middle', x: x(t), y: height - bottom + 14 }, text)),
      ...up.map(([value, text]) => drawn('text', { class: 'end', x: left - 5, y: y(value) + 4 }, text)),
      drawn('text', { class: 'middle', x: (left + width - right) / 2, y: height - 3 }, 'time [s]'),
      drawn('text', { class: 'middle', x: 13, y: (height - bottom + top) / 2,
        transform: `rotate(-90 13 ${(height - bottom + top) / 2})` }, label),
    );
    return picture;
  };
  const axisOf = ({ name, units, torque, position, ...model }, duration) => {
    const word = units[0] === 'N' ? 'force' : 'torque';
    const measured = { ...evenly(torque, duration), colour: 'measured' };
    const found = [element('h3', {}, name)];
    if (model.instants) {
      const t = sums(model.instants);
      const [predicted, residual, half] = [model.predicted, model.residual, model.half].map(sums);
      const around = (middle) => ({ t, y: middle.map((v, k) => v + half[k]), low: middle.map((v, k) => v - half[k]), colour: 'model' });
      found.push(
        curves([around(predicted), measured, { t, y: predicted, colour: 'model', dash: '5 3' }], duration, `${word} [${units[0]}]`),
        curves([around(t.map(() => 0)), { t, y: residual, colour: 'measured' }], duration, `residual [${units[0]}]`),
      );
    } else found.push(curves([measured], duration, `${word} [${units[0]}]`));
    return [...found, curves([{ ...evenly(position, duration), colour: 'measured' }], duration, `position [${units[1]}]`)];
  };

  const show_dialog = (title, ...content) => {
    const close = element('button', { type: 'button' }, 'Close');
    close.addEventListener('click', () => dialog.close());
    const top = element('div', { class: 'top' });
    top.append(element('h2', { id: 'recording' }, title), close);
    dialog.replaceChildren(top, ...content);
    if (!dialog.open) dialog.showModal();
    dialog.scrollTop = 0;
  };
  const open = async (id) => {
    const { words, duration, axes } = (await data()).recordings[id];
    const body = element('div', { class: 'chart' });
    for (const each of axes) body.append(...axisOf(each, duration));
    const note = 'Blue: as recorded, of each stretch of time the least and the greatest torque. Orange: as the model predicts it, with its interval of 95 %.';
    show_dialog(`${id}: ${words}`, body, element('p', { class: 'small' }, note));
  };

  // Parameters lead to the recordings that carry them.
  const openParameter = ({ title, by }) => {
    const list = element('ol', { class: 'carriers' });
    for (const [id, share] of by) {
      const item = element('li', { style: `--share: ${share}%` });
      const button = element('button', { type: 'button' }, id);
      button.addEventListener('click', () => open(id));
      item.append(button, ` ${share} %`);
      list.append(item);
    }
    show_dialog(title, element('p', {}, 'Recordings that carry it, with their shares in its certainty:'), list);
  };
  const parameters = async () => {
    const found = (await data()).parameters;
    for (const cell of document.querySelectorAll('tbody th[scope="row"]')) {
      const each = found[cell.textContent.trim()];
      if (!each) continue;
      const button = element('button', { type: 'button', class: 'plain', title: `${each.title}, recordings that carry it` });
      button.append(...cell.childNodes);
      button.addEventListener('click', () => openParameter(each));
      cell.append(button);
    }
  };
  parameters();

  // One instant: the robot stands as it did then, and curves of that recording have a cursor.
  const play = async () => {
    const { poses, robot } = await data();
    const place = document.querySelector('.robot');
    if (!poses || !place) return;
    const script = element('script');
    script.textContent = await inflate(document.getElementById('view'));
    document.body.append(script);
    const host = element('div', { class: 'host' });
    place.append(host);
    let view;
    try {
      view = new hilView.RobotView(host, { robot, label: robot.name });
    } catch {
      host.remove(); // no WebGL here: the picture stays
      return;
    }
    place.removeAttribute('role');
    place.removeAttribute('aria-label');
    place.classList.add('live');
    const scheme = matchMedia('(prefers-color-scheme: dark)');
    const theme = () => view.theme(scheme.matches);
    scheme.addEventListener('change', theme);
    theme();
    const ways = new Map(Object.entries(poses).map(([id, { duration, q }]) => [id, { duration, q: q.map(sums) }]));
    const panels = [...document.querySelectorAll('svg[data-r]')].filter((each) => ways.has(each.dataset.r)).map((svg) => {
      const [left, right, low, high] = svg.dataset.x.split(' ').map(Number);
      const line = drawn('path', { class: 'cursor' });
      svg.append(line);
      return { svg, line, id: svg.dataset.r, left, right, low, high, height: svg.viewBox.baseVal.height };
    });
    const slider = element('input', { type: 'range', min: 0, step: 'any', 'aria-label': 'Instant of the recording' });
    const words = element('p', { class: 'small' });
    place.append(slider, words);
    let now;
    const seek = (id, t) => {
      const { duration, q } = ways.get(id);
      now = id;
      const at = Math.min(Math.max(t, 0), duration);
      view.show(q.map((each) => each[Math.round((at / duration) * (each.length - 1))]));
      slider.max = duration;
      slider.value = at;
      words.textContent = `${id}, ${at.toFixed(2)} s`;
      for (const { line, id: own, left, right, low, high, height } of panels) {
        const x = left + ((at - low) / (high - low)) * (right - left);
        line.setAttribute('d', own === id && x >= left && x <= right ? `M${x.toFixed(1)} 24V${height - 38}` : '');
      }
    };
    for (const { svg, id, left, right, low, high } of panels) {
      const follow = ({ clientX }) => {
        const box = svg.getBoundingClientRect();
        const x = ((clientX - box.left) / box.width) * svg.viewBox.baseVal.width;
        if (x >= left && x <= right) seek(id, low + ((x - left) / (right - left)) * (high - low));
      };
      svg.addEventListener('pointermove', follow);
      svg.addEventListener('pointerdown', follow);
    }
    slider.addEventListener('input', () => seek(now, Number(slider.value)));
    seek(panels[0].id, panels[0].low);
    view.look('oblique');
    window.report = { view, seek };
  };
  play();

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
