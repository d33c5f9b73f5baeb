// SPDX-License-Identifier: Apache-2.0
// The track since the stop and the one to come, drawn to scale; y of `position` is up: north, where it is latitude and longitude.

const SVG = 'http://www.w3.org/2000/svg';
const [WIDE, HIGH, EDGE] = [640, 200, 26];
const STEPS = [1, 2, 5];

function shape(name, attributes, text = '') {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

/** A round length that is at most so long. */
function round(most) {
  const ten = 10 ** Math.floor(Math.log10(most));
  return Math.max(...STEPS.map(step => step * ten).filter(length => length <= most), ten / 2);
}

/** Draw it; `label` stands at the mark, `far` says a length. */
export function drawTrack(box, { was, ahead, mark }, { label, far, unit }) {
  const all = [...was, ...ahead, ...(mark ?? [])];
  const [xs, ys] = [all.map(([x]) => x), all.map(([, y]) => y)];
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = Math.min((WIDE - 2 * EDGE) / Math.max(right - left, 1e-6), (HIGH - 2 * EDGE) / Math.max(high - low, 1e-6));
  const at = ([x, y]) => [WIDE / 2 + (x - (left + right) / 2) * scale, HIGH / 2 - (y - (low + high) / 2) * scale];
  const line = (points, look) => shape('polyline', { points: points.map(point => at(point).map(v => v.toFixed(1)).join()).join(' '), class: look });
  const svg = shape('svg', { viewBox: `0 0 ${WIDE} ${HIGH}`, width: '100%', height: '100%', 'aria-hidden': 'true' });
  svg.append(line(was, 'track-was'), line(ahead, 'track-ahead'));
  const side = ([x, y]) => (x > WIDE / 2 ? { x: x - 8, y: y - 10, 'text-anchor': 'end' } : { x: x + 8, y: y - 10 });
  if (mark) {
    const [middle, ...band] = mark;
    svg.append(line(band, 'track-band'));
    const [x, y] = at(middle);
    svg.append(shape('circle', { cx: x, cy: y, r: 5, class: 'track-mark' }), shape('text', side([x, y]), label));
  }
  const [x, y] = at([0, 0]);
  const [before, after] = [at(ahead[0]), at(ahead[ahead.length - 1])];
  const course = Math.atan2(after[1] - before[1], after[0] - before[0]) * 180 / Math.PI;
  svg.append(shape('path', { d: 'M9 0 -6 -5 -6 5Z', transform: `translate(${x} ${y}) rotate(${course})`, class: 'track-ship' }));
  const bar = round(WIDE / 4 / scale / unit);
  const end = EDGE + bar * unit * scale;
  svg.append(shape('path', { d: `M${EDGE} ${HIGH - 12}v5H${end}v-5`, class: 'track-bar' }), shape('text', { x: end + 6, y: HIGH - 6 }, far(bar * unit)));
  svg.append(shape('text', { x: WIDE - EDGE, y: HIGH - 6, 'text-anchor': 'end' }, 'up: north (+y in a local frame)'));
  box.replaceChildren(svg);
}
