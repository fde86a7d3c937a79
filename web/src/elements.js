// Small helpers for the page's elements.
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === 'text') element.textContent = value;
    else if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (value !== undefined && value !== false) element.setAttribute(key, value === true ? '' : value);
  }
  element.append(...children);
  return element;
}

/** A number with as many decimals as its size needs, and with a typographic minus sign. */
export function shown(value, size) {
  if (!Number.isFinite(value)) return '–';
  const places = Math.min(Math.max(3 - Math.ceil(Math.log10(size || 1)), 0), 5);
  const text = value.toFixed(places);
  return (Number(text) === 0 ? text.replace('-', '') : text).replace('-', '−');
}

/** Time in minutes and seconds. */
export function clock(seconds) {
  const whole = Math.floor(seconds + 1e-6);
  const [minutes, rest] = [Math.floor(whole / 60), whole % 60];
  return `${minutes}:${String(rest).padStart(2, '0')}`;
}
