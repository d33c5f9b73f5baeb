// SPDX-License-Identifier: Apache-2.0
// The page: one picture, kept by frames from the server, drawn where it has changed.

import { Chart, drawCurve, drawShafts, drawSpeeds, drawTrack } from './charts.js';
import { BRIDGE, SI, day, dayAndTime, figure, heading, length, percent, timeOfDay } from './units.js';

const OLD_MS = 4000; // the server says something every second
const AGAIN_MS = 2000;
const LONGEST_S = 2 * 86400;
const FINE_S = 1800;
const THIN_EVERY = 300; // rows
const MODES = ['day', 'dusk', 'night'];
const SIGNS = { good: '✓', act: '►', watch: '…', bad: '✕' };
const HELD = { yes: ['✓', 'yes'], no: ['✕', 'no'], wait: ['…', 'not yet'], unknown: ['?', 'not measured'], silent: ['✕', 'no reading now'] };
const LEVELS = [['✓', 'good'], ['!', 'look'], ['✕', 'fault'], ['✕', 'silent']];

const el = id => document.getElementById(id);
const picture = { rows: [] };
const charts = { curve: new Chart(el('curve')), speeds: new Chart(el('speeds')), shafts: new Chart(el('shafts')) };
let units = recall('units') === 'si' ? SI : BRIDGE;
let zone = Number(recall('zone') ?? Math.round(-new Date().getTimezoneOffset() / 30) / 2);
let heardMs = 0;
let thinned = 0; // rows that were left
const due = { parts: new Set(), rows: false, asked: false, wholeMs: 0 };
window.shipdrag = { picture, wholeMs: null }; // for tests and for the curious: how long the last whole picture took

function recall(name) { try { return localStorage.getItem(`shipdrag.${name}`); } catch { return null; } }
function keep(name, value) { try { localStorage.setItem(`shipdrag.${name}`, value); } catch { /* private window */ } }

function text(id, value) { if (el(id).textContent !== value) el(id).textContent = value; }

function make(tag, content, attributes = {}) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...[content].flat());
  return made;
}

// what came

function connect() {
  const stream = new EventSource('/stream');
  const take = whole => event => {
    heardMs = Date.now();
    if (whole) due.wholeMs = performance.now();
    const { rows = [], ...parts } = JSON.parse(event.data);
    if (whole) { picture.rows = rows; thinned = rows.length; } else { picture.rows.push(...rows); }
    if (rows.length && !whole) thin();
    Object.assign(picture, parts);
    for (const name of Object.keys(parts)) due.parts.add(name);
    due.rows ||= parts.inputs !== undefined;
    due.rows ||= rows.length > 0 || whole;
    ask();
  };
  stream.addEventListener('whole', take(true));
  stream.addEventListener('frame', take(false));
  stream.addEventListener('error', () => {
    if (stream.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN_MS);
  });
}

/** Draw what has come once for each picture of the screen, however many frames came; a page that nobody sees, once a second. */
function ask() {
  if (due.asked) return;
  due.asked = true;
  const draw = () => {
    const { parts, rows, wholeMs } = due;
    Object.assign(due, { parts: new Set(), rows: false, asked: false, wholeMs: 0 });
    show(parts, rows);
    if (wholeMs) setTimeout(() => { window.shipdrag.wholeMs = performance.now() - wholeMs; }); // it stands on the screen by then
  };
  if (document.hidden) setTimeout(draw, 1000); else requestAnimationFrame(draw);
}

/** Forget what is older than two days; a point in ten seconds, and the estimates, are enough of what is older than half an hour. */
function thin() {
  const { rows } = picture;
  const newest = rows[rows.length - 1][0];
  if (rows.length < thinned + THIN_EVERY) return;
  let last = -1;
  picture.rows = rows.filter(([second, , , estimate]) => {
    if (second < newest - LONGEST_S) return false;
    if (second >= newest - FINE_S) return true;
    const tens = Math.floor(second / 10);
    const first = tens !== last;
    last = tens;
    return first || estimate != null;
  });
  thinned = picture.rows.length;
}

// what is shown

const SHOWN = {
  headline: showHeadline,
  figures: showFigures,
  forecast: showGlide,
  if_stopped: showGlide,
  track: showTrack,
  checks: showChecks,
  inputs: showInputs,
  verdict: showVerdict,
  past: showPast,
  notes: showNotes,
  player: showPlayer,
  started: showStarted,
  clock: showClock,
};

function show(changed, rows) {
  for (const [name, draw] of Object.entries(SHOWN)) if (changed.has(name)) draw(picture[name]);
  if (changed.has('ship')) { text('ship', picture.ship?.name || 'Shipdrag'); showFigures(picture.figures); showPast(picture.past); showGlide(); }
  if (changed.has('forecast')) showTrack(picture.track);
  if (['ship', 'curve', 'past', 'all'].some(name => changed.has(name))) showCurve();
  if (rows || changed.has('all')) showTraces();
}

function showAll() { show(new Set(['all', 'ship', ...Object.keys(SHOWN)]), true); }

function showHeadline(part) {
  el('state').dataset.tone = part.tone;
  text('sign', SIGNS[part.tone]);
  text('headline', part.text);
  text('action', part.action);
  document.title = `${part.text} – Shipdrag`;
}

function showClock(part) {
  const live = !part.ship_s || Math.abs(part.ship_s - part.machine_s) < 120;
  const seconds = live ? part.machine_s : part.ship_s;
  text('clock-kind', live ? 'Ship' : 'Record');
  text('ship-time', live ? timeOfDay(seconds, zone) : `${day(seconds, zone)} ${timeOfDay(seconds, zone)}`);
  text('utc-time', timeOfDay(seconds, 0));
}

function setFigure(id, value, unit, spread) {
  el(id).replaceChildren(value, ...(value === '–' ? [] : [make('small', `${spread} ${unit}`)]));
}

function showFigures(part) {
  if (!part) return;
  const mass = picture.ship?.mass_kg;
  const speed = part.speed_m_s == null ? '–' : units.toSpeed(part.speed_m_s).toFixed(units === SI ? 2 : 1);
  setFigure('figure-speed', speed, units.speed, '');
  const old = part.speed_old_s != null;
  el('figure-speed').classList.toggle('stale', old);
  text('note-speed', `${part.speed_kind ?? 'not measured'}${old ? `, ${part.speed_old_s} s old` : ''}`);
  const { usual } = part;
  text('force-name', units === SI ? 'Specific resistance' : 'Resistance');
  if (!usual || (!mass && units !== SI)) {
    for (const id of ['figure-force', 'figure-power', 'figure-over']) setFigure(id, '–', '', '');
    text('note-force', usual ? 'the ship is not known' : 'after a coastdown begins');
    text('note-power', ''); text('note-over', '');
    return;
  }
  const force = units.toForce(usual.r, mass);
  const spread = 2 * units.toForce(usual.r_sigma, mass);
  const run = usual.run_s == null ? 'this run' : `run of ${dayAndTime(usual.run_s, zone)}`;
  const where = `at ${units.toSpeed(usual.speed_m_s).toFixed(1)} ${units.speed}, ${run}`;
  setFigure('figure-force', figure(force, spread), units.force, ` ± ${figure(spread, spread)}`);
  const share = usual.r_sigma / usual.r;
  text('note-force', where);
  const kw = mass ? usual.r * mass * usual.speed_m_s / 1000 : null;
  setFigure('figure-power', figure(kw, 2 * share * kw), 'kW', kw ? ` ± ${figure(2 * share * kw, 2 * share * kw)}` : '');
  text('note-power', where);
  if (usual.over_clean == null) {
    setFigure('figure-over', '–', '', '');
    text('note-over', picture.ship?.clean ? 'outside of the baseline' : 'no baseline in the ship file');
  } else {
    setFigure('figure-over', percent(usual.over_clean), '', ` ± ${(200 * usual.over_clean_sd).toFixed(0)} %`);
    text('note-over', where);
  }
}

/** A time as minutes and seconds. */
function minutes(s) { return s == null ? '…' : length(Math.round(s)); }

function speedOf(part) { return `${units.toSpeed(part.speed_m_s).toFixed(units === SI ? 2 : 1)} ${units.speed}`; }

function span(low, high) { return high == null ? `${minutes(low)} or later` : `${minutes(low)} to ${minutes(high)}`; }

function far(metres) { return units === SI || picture.ship?.mass_kg < 1e4 ? `${metres.toFixed(0)} m` : `${(metres / 1852).toFixed(2)} nm`; }

/** The rest of the glide, what it was, or the glide if she were stopped now. */
function showGlide() {
  const { forecast, if_stopped: stopped } = picture;
  const part = forecast ?? stopped;
  text('glide-name', forecast || !stopped ? 'Rest of the glide' : 'If the engine were stopped now');
  if (!part || part.why) { setFigure('figure-glide', '–', '', ''); text('note-glide', part ? `not foretold: ${part.why}` : 'foretold once the first estimate is accepted'); return; }
  if (part.withdrawn) {
    const [foretold, low, high] = part.foretold_s ?? [];
    setFigure('figure-glide', part.was_s == null ? '–' : minutes(part.was_s), 'min', '');
    const compared = part.was_s == null ? '' : ` To ${speedOf(part)}, half-way: foretold ${minutes(foretold)} (${span(low, high)}), was ${minutes(part.was_s)}.`;
    text('note-glide', `Withdrawn: ${part.withdrawn}.${compared}`);
    return;
  }
  const [time, low, high] = part.time_s;
  setFigure('figure-glide', minutes(time), 'min', '');
  const way = part.way_m == null ? '' : `, ${far(part.way_m)} through water`;
  text('note-glide', `${speedOf(part)} in ${minutes(time)} (${span(low, high)})${way}${part.hull ? `; by ${part.hull}` : ''}`);
}

function showTrack(part) {
  el('track-part').hidden = !part;
  if (!part) return;
  const glide = picture.forecast?.time_s ? picture.forecast : null;
  const label = glide ? `${minutes(glide.time_s[0])}: ${speedOf(glide)}` : '';
  const long = units === SI || picture.ship?.mass_kg < 1e4;
  drawTrack(el('track'), part, { label, unit: long ? 1 : 1852, far: length => (long ? `${length} m` : `${Number((length / 1852).toPrecision(2))} nm`) });
  text('track-say', part.over ? 'Since the stop (solid), and as it was foretold half-way (dashed).'
    : `Since the stop (solid), and to come (dashed)${part.mark ? `; the mark is where she is in ${minutes(glide.time_s[0])}, with the 90 % band of her way through water` : ''}.`);
}

function signed(list, rows) {
  el(list).replaceChildren(...rows.map(({ sign, word, name, say, data }) => make('li', [
    make('span', sign, { 'aria-hidden': 'true' }), make('b', name), make('span', `${word}${say ? `: ${say}` : ''}`),
  ], data)));
}

function showChecks(part) {
  signed('checks', part.map(check => ({ sign: HELD[check.held][0], word: HELD[check.held][1], name: check.name, say: check.text, data: { 'data-held': check.held } })));
}

function showInputs(part) {
  if (!part.length) return;
  signed('inputs', part.map(input => {
    const rejected = Object.entries(input.rejected).map(([reason, count]) => `${count} ${reason}`).join(', ');
    const none = !input.level && input.text.startsWith('no publisher');
    const [sign, word] = none ? ['–', 'none'] : LEVELS[input.level] ?? LEVELS[2];
    const rate = input.rate_hz ? `${input.rate_hz.toFixed(input.rate_hz < 9.5 ? 1 : 0)} Hz` : '';
    const said = input.level || (!rate && !none) ? input.text : '';
    return { sign, word, name: input.name, say: [said, rate, rejected && `rejected ${rejected}`].filter(Boolean).join(', '), data: { 'data-level': none ? 0 : input.level } };
  }));
}

const WAITING = { running: 'The last coastdown is being diagnosed…', 'none yet': 'Diagnosed after each coastdown.', '': 'Diagnosed after each coastdown.' };

function showVerdict(part) {
  const shown = [];
  if (part.state === 'done') {
    shown.push(make('p', part.sentence));
    if (part.sizes.length) shown.push(make('h3', 'How large'), make('ul', part.sizes.map(size => make('li', size))));
    // what the sentence says already is not said twice
    const probable = part.probabilities.filter(([name, share]) => share >= 0.005 && !part.sentence.includes(`${name.replaceAll('_', ' ')} (`)).slice(0, 6);
    if (probable.length) shown.push(make('h3', 'How probable'), make('ul', probable.map(([name, share]) => make('li', `${name.replaceAll('_', ' ')}: ${(100 * share).toFixed(0)} %`))));
    if (part.decide.length) shown.push(make('h3', 'What would decide'), make('ul', part.decide.map(line => make('li', line))));
  } else {
    shown.push(make('p', WAITING[part.state] ?? `No diagnosis: ${part.sentence}`, { class: 'quiet' }));
  }
  if (part.ahead) shown.push(make('p', part.ahead, { class: 'quiet' }));
  el('verdict').replaceChildren(...shown);
}

function showPast(part) {
  if (!part?.length) { el('past').replaceChildren(make('p', 'None yet.', { class: 'quiet' })); return; }
  const mass = picture.ship?.mass_kg;
  const head = ['Start', 'Heading', `at ${units.speed}`, units.force, 'over clean', 'length', 'ended by'];
  const rows = [...part].reverse().map(run => {
    const known = run.r != null && (mass || units === SI);
    const spread = known ? 2 * units.toForce(run.r_sigma, mass) : 0;
    return make('tr', [
      dayAndTime(run.start_s, zone), heading(run.heading_deg),
      run.speed_m_s == null ? '–' : units.toSpeed(run.speed_m_s).toFixed(1),
      known ? `${figure(units.toForce(run.r, mass), spread)} ± ${figure(spread, spread)}` : 'none',
      percent(run.over_clean), length(run.length_s), run.ended_by.replaceAll('_', ' '),
    ].map(cell => make('td', cell)));
  });
  el('past').replaceChildren(make('table', [make('thead', make('tr', head.map(name => make('th', name, { scope: 'col' })))), make('tbody', rows)]));
}

function showNotes(part) {
  el('notes').replaceChildren(...[...part].reverse().map(([second, said]) => make('li', [make('time', timeOfDay(second, zone)), said.replaceAll('_', ' ')])));
}

function showStarted(part) {
  text('version', `shipdrag_ros ${part.version}.`);
  const fleet = part.fleet ? [make('li', make('a', 'The fleet: which hull first', { href: '/fleet' }))] : [];
  el('engine-stopped').hidden = !part.marks;
  el('started').replaceChildren(...fleet, ...part.notes.map(note => make('li', note)));
}

function showCurve() {
  const { ship, curve } = picture;
  const past = (picture.past ?? []).filter(run => run.curve).slice(-3).filter(run => !curve || !sameCurve(run.curve, curve))
    .map(run => ({ ...run, name: dayAndTime(run.start_s, zone) }));
  const mass = ship?.mass_kg;
  if (!mass && units !== SI) { text('curve-say', 'The ship is not known yet: no curve can be drawn in kN.'); return; }
  drawCurve(charts.curve, { curve, clean: ship?.clean, past, units, mass });
  const usual = picture.figures?.usual;
  if (!usual) { text('curve-say', 'No curve yet: it grows while the ship coasts.'); return; }
  const over = usual.over_clean;
  const whose = usual.run_s == null ? 'this run' : `the run of ${dayAndTime(usual.run_s, zone)}`;
  const compared = over == null ? 'There is no clean hull to compare with.'
    : `At ${units.toSpeed(usual.speed_m_s).toFixed(1)} ${units.speed} ${whose} lies ${Math.abs(100 * over).toFixed(0)} % ${over >= 0 ? 'over' : 'under'} the clean hull (dashed).`;
  const of = picture.figures.r_of ? `, ${picture.figures.r_of}` : '';
  text('curve-say', `${compared} Band of the curve ± ${(200 * usual.r_sigma / usual.r).toFixed(0)} %${of}.`);
}

function sameCurve(one, other) {
  return one.speed_m_s[0] === other.speed_m_s[0] && one.r[0] === other.r[0];
}

/** Whether all of these inputs have fallen silent. */
function silent(...names) {
  const known = (picture.inputs ?? []).filter(({ name, rate_hz, level }) => names.includes(name) && (rate_hz || level === 3));
  return known.length > 0 && known.every(({ level }) => level === 3);
}

function showTraces() {
  const { rows } = picture;
  const span = Number(el('span').value);
  if (!rows.length) { charts.speeds.clear(); charts.shafts.clear(); return; }
  drawSpeeds(charts.speeds, rows, span, units, zone, picture.forecast);
  // once the instruments are silent, the last second need not be one in which they were read
  const lastRead = (quiet, ...columns) => (quiet && rows.findLast(row => columns.some(i => row[i] != null))) || rows[rows.length - 1];
  const noSpeed = silent('speed through water', 'speed over ground');
  const last = lastRead(noSpeed, 1, 2, 3);
  const said = [['log', 1], ['over ground', 2], ['estimate', 3]].filter(([, i]) => last[i] != null).map(([name, i]) => `${name} ${units.toSpeed(last[i]).toFixed(1)}`);
  text('trace-say', said.length ? `${noSpeed ? 'Last' : 'Now'}: ${said.join(', ')} ${units.speed}.` : 'Nothing was read in the last second.');
  const turning = rows.some(row => row[4] != null);
  el('shafts').hidden = !turning;
  if (turning) {
    drawShafts(charts.shafts, rows, span, zone);
    const noShaft = silent('shaft');
    const speed_rad_s = lastRead(noShaft, 4)[4];
    text('shaft-say', speed_rad_s == null ? 'Not read in the last second.' : `${noShaft ? 'Last' : 'Now'}: ${Math.round(speed_rad_s * 60 / (2 * Math.PI)) || 0} rpm.`);
  }
}

// a bag that is played

function showPlayer(part) {
  el('player').hidden = !part;
  el('keys-player').hidden = !part;
  if (!part) return;
  text('play', part.playing ? 'Pause' : 'Play');
  const speed = el('speed');
  if (![...speed.options].some(option => Number(option.value) === part.speed)) speed.append(make('option', `${part.speed} ×`, { value: String(part.speed) }));
  if (document.activeElement !== speed) speed.value = String(part.speed);
  const seek = el('seek');
  seek.min = part.start_s; seek.max = part.end_s;
  if (document.activeElement !== seek || !seek.dataset.held) seek.value = part.at_s;
  seek.setAttribute('aria-valuetext', timeOfDay(part.at_s, zone));
  el('bag-label').hidden = part.bags.length < 2;
  if (el('bag').options.length !== part.bags.length) el('bag').replaceChildren(...part.bags.map((name, i) => make('option', name.split('/').pop(), { value: i })));
  el('bag').value = String(part.bag);
  const read = part.end_s > part.start_s ? (part.read_s - part.start_s) / (part.end_s - part.start_s) : 1;
  text('played', part.problem || `${length(part.at_s - part.start_s)} of ${length(part.end_s - part.start_s)}${read < 1 ? `, ${(100 * read).toFixed(0)} % read` : ''}`);
}

async function control(action, value = 0) {
  await fetch('/player', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ action, value }) });
}

async function engineStopped() {
  el('engine-stopped').disabled = true;
  try {
    const answer = await fetch('/engine_stopped', { method: 'POST' });
    text('marked', await answer.text());
  } catch { text('marked', 'The page did not answer: the stop was not marked.'); }
  el('engine-stopped').disabled = false;
}

// buttons and keys

function setMode(mode) {
  document.documentElement.dataset.mode = mode;
  text('mode', `Display: ${mode}`);
  keep('mode', mode);
  if (picture.headline) showAll();
}

function nextMode() { setMode(MODES[(MODES.indexOf(document.documentElement.dataset.mode) + 1) % MODES.length]); }

function nextUnits() {
  units = units === SI ? BRIDGE : SI;
  keep('units', units === SI ? 'si' : 'bridge');
  text('units', `Units: ${units.name}`);
  showAll();
}

function nextSpan() {
  const { options, selectedIndex } = el('span');
  el('span').selectedIndex = (selectedIndex + 1) % options.length;
  showTraces();
}

function setUp() {
  const dark = matchMedia('(prefers-color-scheme: dark)').matches ? 'dusk' : 'day';
  setMode(MODES.includes(recall('mode')) ? recall('mode') : dark);
  text('units', `Units: ${units.name}`);
  const halves = Array.from({ length: 53 }, (_, i) => i / 2 - 12);
  el('zone').replaceChildren(...halves.map(h => make('option', `UTC${h < 0 ? '−' : '+'}${Math.abs(h)}`, { value: h })));
  el('zone').value = String(zone);
  el('zone').addEventListener('change', () => { zone = Number(el('zone').value); keep('zone', zone); showAll(); });
  el('mode').addEventListener('click', nextMode);
  el('units').addEventListener('click', nextUnits);
  el('engine-stopped').addEventListener('click', engineStopped);
  el('span').addEventListener('change', showTraces);
  el('play').addEventListener('click', () => control(picture.player?.playing ? 'pause' : 'play'));
  el('speed').addEventListener('change', () => control('speed', Number(el('speed').value)));
  el('bag').addEventListener('change', () => control('bag', Number(el('bag').value)));
  el('seek').addEventListener('input', () => { el('seek').dataset.held = '1'; });
  el('seek').addEventListener('change', () => { delete el('seek').dataset.held; control('seek', Number(el('seek').value)); });
  el('player').addEventListener('submit', event => event.preventDefault());
  document.addEventListener('keydown', event => {
    if (event.ctrlKey || event.altKey || event.metaKey || /^(INPUT|SELECT)$/.test(event.target.tagName) && event.target.id !== 'seek') return;
    const key = event.key.toLowerCase();
    if (key === 'n') nextMode();
    else if (key === 'u') nextUnits();
    else if (key === 'h') nextSpan();
    else if (picture.player && key === ' ' && event.target.tagName !== 'BUTTON') { event.preventDefault(); control(picture.player.playing ? 'pause' : 'play'); }
    else if (picture.player && /^arrow(left|right)$/.test(key)) {
      event.preventDefault();
      control('seek', picture.player.at_s + (key === 'arrowleft' ? -60 : 60));
    }
  });
  setInterval(() => {
    const late = heardMs ? Date.now() - heardMs : 0;
    const lost = late > OLD_MS;
    document.body.classList.toggle('old', lost);
    el('lost').hidden = !lost;
    if (lost) text('lost', `NO CONNECTION for ${length(late / 1000)}: everything below is old. The page asks again by itself.`);
  }, 500);
  heardMs = Date.now();
  connect();
}

setUp();
