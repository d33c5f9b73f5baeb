// SPDX-License-Identifier: Apache-2.0
// The three charts and the track. Lines differ by dash and width, not by colour alone.

import { timeOfDay } from './units.js';

/* global uPlot */

const POINTS = 120;

const inks = { mode: null, known: new Map() };

/** A colour of the display that is on; asked of the browser once, since each asking costs it a look at all styles. */
function ink(name) {
  const { mode } = document.documentElement.dataset;
  if (inks.mode !== mode) { inks.mode = mode; inks.known.clear(); }
  if (!inks.known.has(name)) inks.known.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return inks.known.get(name);
}

/** Values of a curve at the places x; null outside of it. */
export function at(x, xs, ys) {
  let i = 0;
  return x.map(v => {
    if (!xs.length || v < xs[0] || v > xs[xs.length - 1]) return null;
    while (i < xs.length - 2 && xs[i + 1] < v) i += 1;
    if (xs.length < 2) return ys[0];
    return ys[i] + (ys[i + 1] - ys[i]) * (v - xs[i]) / (xs[i + 1] - xs[i]);
  });
}

function axis(label, size) {
  return { label, size, labelSize: 22, stroke: ink('--ink'), font: '13px sans-serif', labelFont: '13px sans-serif',
    grid: { stroke: ink('--line'), width: 1 }, ticks: { stroke: ink('--line') } };
}

const SVG = 'http://www.w3.org/2000/svg';

function shape(name, attributes, text = '') {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

/** A piece of a line as it is drawn, for the legend. */
function sample({ stroke, width, dash = [] }) {
  const svg = shape('svg', { width: 36, height: 12, 'aria-hidden': 'true' });
  svg.append(shape('line', { x1: 0, x2: 36, y1: 6, y2: 6, stroke, 'stroke-width': width, 'stroke-dasharray': dash.join(' ') }));
  return svg;
}

/** A chart that fills its box, made anew where labels or colours change; the legend reads off the place pointed at. */
export class Chart {
  constructor(box) {
    this.box = box;
    this.legend = document.createElement('p');
    this.legend.className = 'legend';
    box.after(this.legend);
    this.plot = null;
    this.key = '';
    this.size = null;
    new ResizeObserver(([{ contentRect }]) => { if (this.fit(contentRect)) this.plot?.setSize(this.size); }).observe(box);
  }

  /** Note the size, and return whether it has changed; to ask for it at each drawing would lay the page out anew. */
  fit({ width, height }) {
    const [wide, high] = [Math.max(Math.floor(width), 100), Math.max(Math.floor(height), 80)];
    if (this.size?.width === wide && this.size.height === high) return false;
    this.size = { width: wide, height: high };
    return true;
  }

  draw(key, options, data) {
    const whole = `${key} ${document.documentElement.dataset.mode}`;
    this.data = data;
    if (this.plot && this.key === whole) { this.plot.setData(data); this.name(); return; }
    this.clear();
    this.key = whole;
    if (!this.size) this.fit(this.box.getBoundingClientRect());
    const made = options();
    this.plot = new uPlot({ ...this.size, legend: { show: false }, cursor: { drag: { x: false, y: false } }, hooks: { setCursor: [u => this.read(u)] }, ...made }, data, this.box);
    this.values = made.series.map(({ label, legend = true, ...look }) => {
      const value = document.createElement('b');
      if (legend) {
        const item = document.createElement('span');
        item.append(...(look.stroke ? [sample(look)] : []), ` ${label} `, value);
        item.hidden = !look.stroke;
        this.legend.append(item);
      }
      return value;
    });
    this.name();
  }

  /** A line of which there is nothing has no name in the legend. */
  name() {
    this.values.forEach((value, i) => {
      if (i && value.parentElement) value.parentElement.hidden = !this.data[i].some(v => v != null);
    });
  }

  read(u) {
    this.values?.forEach((value, i) => {
      const at = u.cursor.idx;
      const shown = at == null || u.data[i][at] == null ? '' : u.series[i].value(u, u.data[i][at]);
      value.textContent = shown;
      if (i === 0 && value.parentElement) value.parentElement.hidden = shown === '';
    });
  }

  clear() {
    this.plot?.destroy();
    this.plot = null;
    this.values = null;
    this.legend.replaceChildren();
  }
}

/** r(v) with its band, over the clean hull and over what was found earlier. */
export function drawCurve(chart, { curve, clean, past, units, mass }) {
  const lines = [];
  const force = r => units.toForce(r, mass);
  if (clean) lines.push({ x: clean.speed_m_s, y: clean.resistance_n.map(n => force(n / mass)), name: 'clean hull' });
  for (const run of past) lines.push({ x: run.curve.speed_m_s, y: run.curve.r.map(force), name: run.name });
  if (!lines.length && !curve) { chart.clear(); return; }
  const spans = [...past.map(run => run.curve), ...(curve ? [curve] : [])].map(c => c.speed_m_s);
  const speeds = (spans.length ? spans : lines.map(line => line.x)).flat();
  const high = Math.max(...speeds) * 1.05;
  const low = Math.max(0, Math.min(...speeds) * 0.9);
  const x = Array.from({ length: POINTS }, (_, i) => low + (high - low) * i / (POINTS - 1));
  const data = [x.map(units.toSpeed)];
  const band = s => (curve ? at(x, curve.speed_m_s, curve.r.map((r, i) => force(Math.max(r + s * curve.r_sigma[i], 0)))) : x.map(() => null));
  data.push(band(2), band(-2), band(0));
  for (const line of lines) data.push(at(x, line.x, line.y));
  const key = `${units.name} ${lines.map(line => line.name).join()}`;
  const shown = said(v => v.toFixed(units.force === 'kN' ? (v < 10 ? 2 : 0) : 5));
  chart.draw(key, () => ({
    scales: { x: { time: false }, y: { range: (_, min, max) => [0, (max || 1) * 1.05] } },
    axes: [axis(`speed through water [${units.speed}]`, 34), axis(`resistance [${units.force}]`, 58)],
    bands: [{ series: [1, 2], fill: ink('--band') }],
    series: [
      { label: units.speed === 'kn' ? 'at kn' : 'at m/s', value: said(v => v.toFixed(1)) },
      { label: 'band', stroke: ink('--accent'), width: 0.5, value: shown, legend: false },
      { label: 'low', stroke: ink('--accent'), width: 0.5, value: shown, legend: false },
      { label: 'this run (shaded: band)', stroke: ink('--accent'), width: 3, value: shown },
      ...lines.map(line => (line.name === 'clean hull'
        ? { label: line.name, stroke: ink('--ink'), width: 2, dash: [10, 5], value: shown }
        : { label: line.name, stroke: ink('--second'), width: 1.5, dash: [2, 4], value: shown })),
    ],
  }), data);
}

function timeAxis(offset) {
  return { ...axis('', 32), labelSize: 0, values: (u, ticks, _a, _s, step) => ticks.map(t => timeOfDay(t, offset, step < 60)) };
}

/** How a value is read off: – where there is none. */
function said(say) { return (_, v) => (v == null ? '–' : say(v)); }

function timeSeries(offset) { return { label: 'time', value: said(v => timeOfDay(v, offset)) }; }

/** Speeds over time; rows are [second, log, ground, estimate, shaft]. */
export function drawSpeeds(chart, rows, span, units, offset, forecast) {
  const cut = since(rows, span);
  const newest = cut.length ? cut[cut.length - 1][0] : 0;
  // what is to come, not more of it than half of what was
  const coming = (forecast?.rows ?? []).map(([t, ...rest]) => [forecast.made_s + t, ...rest]).filter(([t]) => t > newest && t < newest + span / 2);
  // the estimate of one coastdown is not joined to that of the next
  const made = cut.filter(row => row[3] != null).map(([t]) => t);
  const steps = made.slice(1).map((t, i) => t - made[i]).sort((a, b) => a - b);
  const apart = 5 * steps[steps.length >> 1];
  let last = -Infinity;
  const estimates = cut.map(([t, , , v]) => {
    if (v == null) return t - last > apart ? null : undefined; // a gap, or nothing to draw
    last = t;
    return units.toSpeed(v);
  });
  const speed = column => [...cut.map(row => (row[column] == null ? null : units.toSpeed(row[column]))), ...coming.map(() => null)];
  const ahead = column => [...cut.map(() => null), ...coming.map(row => units.toSpeed(row[column]))];
  chart.draw(`${units.name} ${offset}`, () => ({
    scales: { x: { time: true }, y: { range: (_, min, max) => (min == null ? [0, 1] : pad(min, max)) } },
    axes: [timeAxis(offset), axis(`speed [${units.speed}]`, 58)],
    bands: [{ series: [6, 5], fill: ink('--band') }],
    series: [
      timeSeries(offset),
      { label: 'log', stroke: ink('--accent'), width: 2, points: { show: false } },
      { label: 'over ground', stroke: ink('--second'), width: 1.5, dash: [6, 4], points: { show: false } },
      { label: 'estimate', stroke: ink('--third'), width: 3, dash: [2, 3], points: { show: false } },
      { label: 'foretold (shaded: 90 %)', stroke: ink('--third'), width: 1.5, points: { show: false } },
      { label: 'low', stroke: ink('--third'), width: 0.5, legend: false, points: { show: false } },
      { label: 'high', stroke: ink('--third'), width: 0.5, legend: false, points: { show: false } },
    ].map(each => (each.stroke ? { ...each, value: said(v => v.toFixed(2)) } : each)),
  }), [[...cut, ...coming].map(row => row[0]), speed(1), speed(2), [...estimates, ...coming.map(() => null)], ahead(1), ahead(2), ahead(3)]);
}

export function drawShafts(chart, rows, span, offset) {
  const cut = since(rows, span);
  const rpm = cut.map(row => (row[4] == null ? null : row[4] * 60 / (2 * Math.PI)));
  chart.draw(`${offset}`, () => ({
    scales: { x: { time: true }, y: { range: (_, min, max) => (min == null ? [0, 1] : pad(Math.min(min, 0), max)) } },
    axes: [timeAxis(offset), axis('shaft [rpm]', 58)],
    series: [
      timeSeries(offset),
      { label: 'rpm', stroke: ink('--accent'), width: 2, points: { show: false }, value: said(v => v.toFixed(0)) },
    ],
  }), [cut.map(row => row[0]), rpm]);
}

function pad(min, max) {
  const more = Math.max((max - min) * 0.08, 0.2);
  return [Math.max(min - more, Math.min(min, 0)), max + more];
}

function since(rows, span) {
  if (!rows.length) return rows;
  const first = rows[rows.length - 1][0] - span;
  let i = rows.length;
  while (i > 0 && rows[i - 1][0] >= first) i -= 1;
  return i ? rows.slice(i) : rows;
}

const [WIDE, HIGH, EDGE] = [640, 200, 26];
const STEPS = [1, 2, 5];

/** A round length that is at most so long. */
function round(most) {
  const ten = 10 ** Math.floor(Math.log10(most));
  return Math.max(...STEPS.map(step => step * ten).filter(length => length <= most), ten / 2);
}

/** The track since the stop and the one to come, to scale; y of `position` is up: north, where it is latitude and longitude. `label` stands at the mark, `far` says a length. */
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
