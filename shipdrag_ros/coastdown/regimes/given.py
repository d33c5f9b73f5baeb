# SPDX-License-Identifier: Apache-2.0
"""A window that a person claims to be a coastdown: as bins, and what the bank reads in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import compress, pairwise, product
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.bank import Bank, step
from shipdrag_ros.coastdown.regimes.births import LOST
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import hull_law, rest_speed
from shipdrag_ros.coastdown.regimes.read_out import (
    Spans,
    median,
    probability_of,
    spans_of,
    stretches,
)
from shipdrag_ros.coastdown.regimes.state import BankSetting
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import FURTHER, MOTION_INPUTS, SECOND_NS, Float64, Int64
from shipdrag_ros.ship import Ship

REGIMES = ((s.DRIVEN, s.AMID, s.LEVEL), (s.GLIDE,), (s.BRAKE,), (s.GLIDE_TURN,))
ENGINES, GLIDES, BRAKES, TURNS = range(4)
_BINS, _MOST = 60, 150  # of a window
_BEFORE = 60  # at most
_COURSE = 3  # bins on each side that show a course
_OPPOSED = -0.7  # cosine of heading and course


class Binned(NamedTuple):
    """
    What the bins of a window say, and of the record before it.

    Attributes
    ----------
    zero_ns
        Start of the first bin [ns].
    step_s
    before
        Bins before the window.
    said : (bins, SAID)
    noise : (NOISES,)
        White noise of each instrument.
    speed : (bins,)
        As the best of them shows it [m/s]; NaN where nothing does.
    """

    zero_ns: int
    step_s: float
    before: int
    said: Float64
    noise: Float64
    speed: Float64

    @property
    def top(self) -> float:
        """The highest speed [m/s]."""
        size = np.abs(self.speed[np.isfinite(self.speed)])
        return float(np.quantile(size, 0.98)) if len(size) else 0.0

    @property
    def swing(self) -> float:
        """The largest change of speed, but for a tenth of the record [m/s^2]."""
        some = 2 * _COURSE
        size = np.abs(self.speed[some:] - self.speed[:-some]) / (some * self.step_s)
        size = size[np.isfinite(size)]
        return float(np.quantile(size, 0.9)) if len(size) else 0.0


class _Bins(NamedTuple):
    """Bins of time, and the windows from which they are filled."""

    zero_ns: int
    step_s: float
    bins: int
    parts: tuple[Window, ...]

    def of(self, name: str, number: int | None = None) -> tuple[Float64, Float64]:
        """
        Return times [bins] and values of an input; of a shaft revs times pitch.
        """
        if number is None:
            found = [part.series(name) for part in self.parts]
            time_ns = np.concatenate([each.time_ns for each in found])
            value = np.concatenate([each.value for each in found])
        else:
            time_ns, value = shaft_revs(self.parts, number)
        place = (time_ns - self.zero_ns) / (SECOND_NS * self.step_s)
        inside = (place >= 0.0) & (place < self.bins)
        return place[inside], value[inside]

    def means(self, place: Float64, value: Float64) -> Float64:
        """
        Average the middle third of each bin: single spikes are none of it.
        """
        out = np.full(self.bins, np.nan)
        edges = np.searchsorted(place, np.arange(self.bins + 1))
        for k, (first, last) in enumerate(pairwise(edges.tolist())):
            if last > first:
                some = np.sort(value[first:last])
                off = (last - first) // 3
                out[k] = some[off : len(some) - off].mean()
        return out

    def speeds(self, kind: str) -> Float64:
        """
        Average a speed: of the first instrument, where it is silent of others in its scale.
        """
        out = np.full(self.bins, np.nan)
        for name in _names(self.parts[-1], kind):
            other = self.means(*self.of(name))
            both = np.isfinite(out) & np.isfinite(other) & (other != 0.0)
            scale = float(np.median(out[both] / other[both])) if both.any() else 1.0
            out = np.where(np.isnan(out), scale * other, out)
        return out


def _names(window: Window, kind: str) -> list[str]:
    """Return the inputs of a kind."""
    return [name for name in window.motion if FURTHER.get(name, name) == kind]


def bin_window(window: Window, parameters: Parameters, longest_s: float) -> Binned | None:
    """
    Bin a window and the record before it.

    Parameters
    ----------
    window
    parameters
        `heading_convention` is used.
    longest_s
        Bins are no longer.

    Returns
    -------
    Binned or None
        None where nothing shows a speed.
    """
    window = window.by_rep103(parameters.heading_convention)
    length_s = (window.end_ns - window.start_ns) / SECOND_NS
    heard = [series.time_ns for series in window.each(*MOTION_INPUTS) if len(series) > 2]
    apart = [float(np.median(np.diff(time_ns))) / SECOND_NS for time_ns in heard]
    if not apart:
        return None
    step_s = max(min(longest_s, length_s / _BINS), min(apart), length_s / _MOST)
    before = 0
    if window.before is not None:
        known_s = (window.start_ns - window.before.start_ns) / SECOND_NS
        before = min(int(known_s / step_s), _BEFORE)
        before = before if before >= 2 * _COURSE else 0  # bins that teach nothing
    parts = (window,) if window.before is None else (window.before, window)
    zero_ns = window.start_ns - round(before * step_s * SECOND_NS)
    count = before + max(math.ceil(length_s / step_s), 1)
    bins = _Bins(zero_ns, step_s, count, parts)
    said, noise = np.full((count, s.SAID), np.nan), np.zeros(s.NOISES)
    heading = _heading(bins)
    course = _track(bins, said, noise)
    with np.errstate(invalid='ignore'):
        opposed = (np.cos(course - heading) < _OPPOSED) & (step_s > 1.5 * min(apart))
        sign = np.where(opposed, -1.0, 1.0)
    said[:, s.LOG] = bins.speeds('speed_through_water')
    said[:, s.GROUND] = sign * bins.speeds('speed_over_ground')
    said[:, s.ADVANCE] *= sign
    by_compass = bool(np.isfinite(heading).any())
    at = bins.of('heading')[0] if by_compass else np.empty(0)
    # the readings of a bin are not always in its middle
    apart_s = step_s * np.diff(bins.means(at, at)) if by_compass else step_s
    said[1:, s.RATE] = _turned(heading if by_compass else course) / apart_s
    said[:, s.RUDDER] = bins.means(*bins.of('rudder'))
    for k in range(len(window.shafts)):
        said[:, s.SHAFTS + k] = bins.means(*bins.of('shafts', k))
    speed = said[:, s.LOG]
    for other in (said[:, s.GROUND], said[:, s.ADVANCE] / step_s):
        speed = np.where(np.isnan(speed), other, speed)
    for k, column in ((s.N_LOG, s.LOG), (s.N_GROUND, s.GROUND)):
        noise[k] = _white(said[:, column])
    known = np.diff(said[:, s.RATE])
    noise[s.N_RATE] = _mad(known) / math.sqrt(2.0) + 1e-5
    found = Binned(zero_ns, step_s, before, said, noise, speed)
    floor = n.WHITE_FLOOR * found.top
    noise[s.N_LOG], noise[s.N_GROUND] = max(noise[s.N_LOG], floor), max(noise[s.N_GROUND], floor)
    noise[s.N_FIX] = max(noise[s.N_FIX], floor * step_s)
    noise[s.N_WALK] = noise[s.N_FIX] / math.sqrt(6.0 * step_s)
    return found


def _mad(value: Float64) -> float:
    value = np.abs(value[np.isfinite(value)])
    return MAD_TO_SD * float(np.median(value)) if len(value) else 0.0


def _white(value: Float64) -> float:
    """Return the white noise of a value whose course is smooth."""
    return _mad(np.diff(value, 3)) / math.sqrt(20.0)


def _heading(bins: _Bins) -> Float64:
    place, value = bins.of('heading')
    return bins.means(place, np.unwrap(value)) if len(value) else np.full(bins.bins, np.nan)


def _turned(angle: Float64) -> Float64:
    turned = np.diff(angle)
    return np.asarray(np.arctan2(np.sin(turned), np.cos(turned)))


def _track(bins: _Bins, said: Float64, noise: Float64) -> Float64:
    """Put the way of each bin along the course into `said`; return the course."""
    heard = bins.parts[-1]
    track = max(_names(heard, 'position'), key=lambda name: len(heard.series(name)))
    place, value = bins.of(track)
    if not len(place):
        return np.full(bins.bins, np.nan)
    east, north = (bins.means(place, value[:, axis]) for axis in (0, 1))
    noise[s.N_FIX] = 0.5 * math.hypot(_white(east), _white(north)) * math.sqrt(2.0)
    course = np.full(bins.bins, np.nan)
    for k in range(bins.bins):
        low, high = max(k - _COURSE, 0), min(k + _COURSE, bins.bins - 1)
        some = np.isfinite(east[low : high + 1])
        if some.sum() >= 2:
            x, y = east[low : high + 1][some], north[low : high + 1][some]
            at = np.flatnonzero(some) - np.flatnonzero(some).mean()
            course[k] = math.atan2(float(at @ y), float(at @ x))
    way = np.full(bins.bins, np.nan)
    way[1:] = np.diff(east) * np.cos(course[1:]) + np.diff(north) * np.sin(course[1:])
    said[:, s.ADVANCE] = way
    return course


def shaft_revs(parts: tuple[Window, ...], number: int) -> tuple[Int64, Float64]:
    """
    Return times [ns] of the readings of a shaft, and revs times the pitch of then [rad/s].

    A pitch holds until the next is read, and the first one before it too.
    """
    time_ns, revs, pitch_ns, pitch = (
        np.concatenate([getattr(getattr(part, name)[number], of) for part in parts])
        for name in ('shafts', 'pitches')
        for of in ('time_ns', 'value')
    )
    if len(pitch):
        held = np.searchsorted(pitch_ns, time_ns, side='right') - 1
        revs = revs * pitch[np.maximum(held, 0)]
    return time_ns, revs


@dataclass(frozen=True)
class WindowRegimes:
    """
    What the bank makes of a window.

    Attributes
    ----------
    binned
        What it was told.
    probability : (4, bins)
        That an engine acts, that she glides, that something stops her, that she glides in a turn.
    rest
        Speed of a ship at rest, which is never quite so [m/s].
    """

    binned: Binned
    spans: Spans
    probability: Float64
    rest: float

    def stretches(self, *which: int) -> list[tuple[int, int]]:
        """
        Return first bins, and those after the last, of the stretches that may be so.
        """
        likely = self.probability[list(which)].sum(axis=0) > n.CLAIM
        likely[: self.binned.before] = False
        return stretches(likely)

    def lost(self, span: tuple[int, int]) -> float:
        """
        Return the speed that is lost in some bins [m/s].
        """
        speed = self.binned.speed[span[0] : span[1]]
        speed = speed[np.isfinite(speed)]
        some = max(1, min(3, len(speed) // 3))
        return float(speed[:some].mean() - speed[-some:].mean()) if len(speed) else 0.0

    def dates(self, span: tuple[int, int], *which: int) -> tuple[float, float]:
        """
        Return when a stretch of bins began and ended [bins], of the histories that hold it.
        """
        codes = [code for each in which for code in REGIMES[each]]
        step_s = self.binned.step_s
        found = self.spans.part(np.isin(self.spans.what, codes))
        likely = self.probability[list(which), slice(*span)].sum(axis=0)
        likely = span[0] + np.flatnonzero(likely >= min(0.5, likely.max()))
        places = []
        for at, dated in ((likely[0], 'date_s'), (likely[-1], 'end_s')):
            at_s = (at + 0.5) * step_s
            held = found.part((found.begin_s < at_s) & (at_s < found.end_s))
            share = held.weight / held.weight.sum()
            places.append(median(getattr(held, dated), share) / step_s)
        begin, end = places
        return max(begin, span[0] - 0.5), min(end, span[1] + 0.5)


def read(window: Window, ship: Ship, parameters: Parameters) -> WindowRegimes | None:
    """
    Let the bank read a window and the record before it; None where nothing shows a speed.

    Notes
    -----
    No steady record shows the noise: all settings of it are weighed by their evidence.
    """
    longest_s = float(n.BIN_S) * math.sqrt(ship.length_m / float(n.BIN_LENGTH_M))
    binned = bin_window(window, parameters, longest_s)
    if binned is None or not binned.top > 0.0:
        return None
    hull = HullPrior.any_body(ship)
    read_out = np.isfinite(binned.said[:, s.SHAFTS : s.SHAFTS + 4]).any(axis=0)
    resistance = math.exp(hull_law(hull, math.log(binned.top))[0] + hull.level)
    setting = BankSetting.of(hull, binned.step_s, shafts=int(read_out.sum()))._replace(
        pace=binned.step_s / n.BIN_S,
        forgets=n.BIN_S / n.MEMORY_S,
        told_s=binned.before * binned.step_s,
        engine=max(resistance, binned.swing),
    )
    # a log errs by a part of the speed: as that of the ship of the table
    wanders = n.WANDER * binned.top / math.exp(hull.sails) * longest_s / float(n.BIN_S)
    short, long = n.WANDER_S
    settings = [*product(n.ANY_GUST, wanders, [long]), *product(n.GUST[:1], wanders, [short])]
    banks = [_bank(binned, *each) for each in settings]
    evidence = [0.0 for _ in banks]
    for k, said in enumerate(binned.said):
        for each, bank in enumerate(banks):
            bank.said[:] = said
            shown = step(bank, setting)
            if k >= binned.before:
                evidence[each] += shown
        # one so far behind would weigh nothing, as a history that is so
        likely = [each >= max(evidence) - LOST for each in evidence]
        banks, evidence = list(compress(banks, likely)), list(compress(evidence, likely))
    if not evidence or not np.isfinite(max(evidence)):  # rounding broke every one
        return None
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    parts = [
        spans._replace(weight=part * spans.weight)
        for part, spans in zip(share, (spans_of(bank, setting) for bank in banks), strict=True)
    ]
    joined = Spans(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    probability = [
        probability_of(joined.part(np.isin(joined.what, codes)), len(binned.said), binned.step_s)
        for codes in REGIMES
    ]
    return WindowRegimes(binned, joined, np.array(probability), rest_speed(hull))


def _bank(binned: Binned, gust: float, wander: float, wander_s: float) -> Bank:
    """Return a bank that is to read a window with some noise."""
    bank = Bank.fresh()
    noise = bank.noise.used
    noise[:] = binned.noise
    noise[s.N_GUST] = gust
    noise[[s.N_WANDER, s.N_EDDY]], noise[[s.N_WANDER_S, s.N_EDDY_S]] = wander, wander_s
    bank.revs[:] = most_revs(binned)
    bank.first[:] = math.log(binned.top), 60.0, np.nan
    # what nothing shows before the first bin that is read goes by
    bank.histories.clock[0] = np.argmax(np.isfinite(binned.speed))
    return bank


def most_revs(binned: Binned) -> Float64:
    """
    Return the most revs times pitch of each shaft, (4,) [rad/s], with the sign it mostly has.
    """
    turning = np.nan_to_num(binned.said[:, s.SHAFTS : s.SHAFTS + 4])
    most = np.abs(turning).max(axis=0)
    mostly = np.sign(np.where(np.abs(turning) > 0.5 * most, turning, 0.0)).sum(axis=0)
    return np.asarray(most * np.where(mostly < 0.0, -1.0, 1.0))
