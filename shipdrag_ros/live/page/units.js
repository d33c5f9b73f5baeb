// SPDX-License-Identifier: Apache-2.0
// SI figures to what is read on a bridge, and times to what stands on its clock.

const MONTHS = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];
const KNOT = 1852 / 3600;

export const BRIDGE = {
  name: 'kn, kN', speed: 'kn', force: 'kN',
  toSpeed: v => v / KNOT,
  toForce: (r, mass) => r * mass / 1000,
};
export const SI = {
  name: 'm/s, m/s²', speed: 'm/s', force: 'm/s²',
  toSpeed: v => v,
  toForce: r => r,
};

/** A figure with as many digits as its spread allows; – where there is none. */
export function figure(value, spread) {
  if (value == null || !Number.isFinite(value)) return '–';
  let digits = 2 - Math.floor(Math.log10(Math.abs(value) || 1)) ;
  if (spread > 0) digits = 1 - Math.floor(Math.log10(spread));
  return value.toFixed(Math.min(Math.max(digits, 0), 6));
}

export function percent(share) {
  if (share == null || !Number.isFinite(share)) return '–';
  const value = 100 * share;
  return `${value > 0 ? '+' : ''}${value.toFixed(Math.abs(value) < 9.95 ? 1 : 0)} %`;
}

/** Time of day at an offset from UTC [h]. */
export function timeOfDay(seconds, offset, withSeconds = true) {
  if (!seconds) return '--:--:--';
  return new Date((seconds + offset * 3600) * 1000).toISOString().slice(11, withSeconds ? 19 : 16);
}

export function day(seconds, offset) {
  const moment = new Date((seconds + offset * 3600) * 1000);
  return `${moment.getUTCDate()} ${MONTHS[moment.getUTCMonth()]}`;
}

export function dayAndTime(seconds, offset) {
  return `${day(seconds, offset)} ${timeOfDay(seconds, offset, false)}`;
}

export function length(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}

export function heading(degrees) {
  return degrees == null ? '–' : String(Math.round(degrees) % 360).padStart(3, '0');
}
