# SPDX-License-Identifier: Apache-2.0
"""
The noise of a steady record: small filters of a driven ship, averaged by their evidence.

What log and speed over ground, or fixes, differ by is followed too: what both say is the ship.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.motion import ROOT_TWO_PI, hull_law, rest_speed
from shipdrag_ros.coastdown.regimes.state import BankSetting
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64

_GUSTS, _WANDERS, _TIMES, _WHITES = len(n.GUST), len(n.WANDER), len(n.WANDER_S), len(n.WHITE)
FILTERS = _GUSTS * _WANDERS * _TIMES * _WHITES  # of a speed
_STATES = 5  # speed, that of the engine, gust, slow error or current, way less the way as read
_STEADY_RAD_S = 1e-3  # a rate of turn that any helm has
_APART = 3  # log less speed over ground, or that of the fixes
_STEEP = (2.0 * float(n.NO_THRUST) - 1.0) / (float(n.NO_THRUST) - 1.0)


class NoiseFilters(NamedTuple):
    """
    Filters of three instruments, and what they made of the record.

    Attributes
    ----------
    mean, spread : (4, FILTERS, states), (4, FILTERS, states, states)
        For log, speed over ground, fixes, and the first less the second.
    evidence : (4, FILTERS)
        Faded log likelihood.
    last, bend : (4, 2), (4, 2)
        Last two readings; mean size of second differences, and how many it is of.
    seen : (4,)
        Readings of a driven ship.
    coarse : (2, 2)
        Of log and speed over ground: share of bins in which every second reads the same, and mean
        range of the seconds of a bin.
    rate : (2,)
        Mean square of the rate of turn, and its weight.
    used : (NOISES,)
    work : (2 states, states)
    beside : (3, FILTERS / whites)
        Log evidence in the other instrument, in what both differ by, and in both.
    gained : (FILTERS,)
        Log density of the last reading by each.
    """

    mean: Float64
    spread: Float64
    evidence: Float64
    last: Float64
    bend: Float64
    seen: Float64
    coarse: Float64
    rate: Float64
    used: Float64
    work: Float64
    beside: Float64
    gained: Float64

    @classmethod
    def fresh(cls) -> NoiseFilters:
        """
        Return filters that have seen nothing.
        """
        first = np.array([0.08, 0.03, 60.0, 0.03, 60.0, 0.1, 0.1, 10.0, 0.6, 0.01])
        return cls(
            np.zeros((4, FILTERS, _STATES)),
            np.zeros((4, FILTERS, _STATES, _STATES)),
            np.zeros((4, FILTERS)),
            np.full((4, 2), np.nan),
            np.zeros((4, 2)),
            np.zeros(4),
            np.zeros((2, 2)),
            np.zeros(2),
            first,
            np.zeros((2 * _STATES, _STATES)),
            np.zeros((3, _GUSTS * _WANDERS * _TIMES)),
            np.zeros(FILTERS),
        )


@compiled(inline=True, uncounted=True)
def _parts(which: int, k: int) -> tuple[float, float, float, float]:
    """Return gust, slow error and its time, and white noise of a filter."""
    gust = 0.0 if which == _APART else n.GUST[k % _GUSTS]
    k //= _GUSTS
    white = n.WHITE[k % _WHITES]
    k //= _WHITES
    return gust, n.WANDER[k // _TIMES], n.WANDER_S[k % _TIMES], white


@compiled(uncounted=True)
def listen(
    noise: NoiseFilters, setting: BankSetting, said: Float64, before: float, driven: float
) -> None:
    """
    Learn from a bin, by the probability that she was driven evenly: of the bin before, and now.
    """
    for which in range(4):
        value = _value(setting, said, which)
        if not np.isnan(value):
            _bends(noise, setting, which, value)
            if which <= s.GROUND:
                _coarse(noise, setting, which, said[s.RANGES + which], driven)
            _one(noise, setting, which, value, before, driven)
    if not np.isnan(said[s.RATE]):
        sd = math.sqrt(noise.rate[0]) if noise.rate[1] > 8.0 else np.inf
        clipped = min(abs(said[s.RATE]), 3.0 * max(sd, _STEADY_RAD_S))
        gain = driven / min(noise.rate[1] + 1.0, 1.0 / setting.forgets)
        noise.rate[1] += driven
        noise.rate[0] += gain * (clipped * clipped - noise.rate[0])
    _average(noise, setting, noise.used)


@compiled(inline=True, uncounted=True)
def _value(setting: BankSetting, said: Float64, which: int) -> float:
    """Return what an instrument says, or what the log says more than the speed over ground."""
    if which != _APART:
        return float(said[which])
    ground = said[s.ADVANCE] / setting.step_s if np.isnan(said[s.GROUND]) else said[s.GROUND]
    return float(said[s.LOG] - ground)


@compiled(uncounted=True)
def _bends(noise: NoiseFilters, setting: BankSetting, which: int, value: float) -> None:
    """Learn the size of second differences, in which no regime is seen."""
    last, bend = noise.last[which], noise.bend[which]
    size = abs(value - 2.0 * last[0] + last[1])
    last[0], last[1] = value, last[0]
    if np.isnan(size):
        return
    if bend[1] > 8.0:
        size = min(size, max(4.0 * bend[0], n.WHITE_FLOOR * abs(value)))
    bend[1] += 1.0
    bend[0] += (size - bend[0]) / min(bend[1], 1.0 / setting.forgets)


@compiled(inline=True, uncounted=True)
def _spread(noise: NoiseFilters, which: int, setting: BankSetting) -> float:
    """Return the sd that white noise has, were those its; of fixes from differences of theirs."""
    variance, least = (20.0, setting.step_s) if which == s.ADVANCE else (6.0, 1.0)
    # readings that stand still are not without noise
    speed = max(noise.mean[s.LOG if which == _APART else which, 0, 1], rest_speed(setting.hull))
    size = noise.bend[which, 0] * 1.2533 / math.sqrt(variance)
    return float(max(size, n.WHITE_FLOOR * speed * least))


@compiled(inline=True, uncounted=True)
def _coarse(
    noise: NoiseFilters, setting: BankSetting, which: int, spread: float, driven: float
) -> None:
    """Learn how often the seconds of a bin read the same, and their mean range."""
    coarse = noise.coarse[which]
    gain = driven / min(noise.seen[which] + 1.0, 1.0 / setting.forgets)
    coarse[0] += gain * ((1.0 if spread == 0.0 else 0.0) - coarse[0])
    coarse[1] += gain * (spread - coarse[1])


@compiled(inline=True, uncounted=True)
def _rounding_of(noise: NoiseFilters, which: int) -> float:
    """Return the sd of what a display rounds off: less, the more often its readings differ."""
    same, spread = noise.coarse[which]
    return float(same * spread / ((1.0 - same) * math.sqrt(12.0))) if spread > 0.0 else 0.0


@compiled(inline=True, uncounted=True)
def _rounding(noise: NoiseFilters, which: int) -> float:
    """Return that of an instrument, or of the log less the speed over ground."""
    if which == _APART:
        return math.hypot(_rounding_of(noise, s.LOG), _rounding_of(noise, s.GROUND))
    return _rounding_of(noise, which) if which <= s.GROUND else 0.0


@compiled(uncounted=True)
def _one(
    noise: NoiseFilters,
    setting: BankSetting,
    which: int,
    value: float,
    before: float,
    driven: float,
) -> None:
    step = setting.step_s
    speed = value / step if which == 2 else value
    count = noise.seen[which]
    noise.seen[which] = count + driven
    spread = _spread(noise, which, setting)
    if count < 4 or not (speed > 0.0 or which == _APART):
        fix = spread if which == 2 else 0.0
        for k in range(FILTERS):
            _start(noise.mean[which, k], noise.spread[which, k], speed, fix, step)
        return
    size = noise.mean[0 if which == _APART else which, 0, 1]
    a = math.exp(hull_law(setting.hull, math.log(max(size, 1e-3)))[0] + setting.hull.level)
    fade = 1.0 - driven * setting.forgets
    stride = _GUSTS if which == _APART else 1  # no gust moves one of them alone
    gained, best = noise.gained, -np.inf
    for k in range(0, FILTERS, stride):
        gained[k] = _filter(noise, setting, which, k, value, spread, a)
        best = max(best, gained[k])
    switches, chance = max(before - driven, 0.0), (n.STOP + n.LEVEL + n.TURN) * step / 3600.0
    for k in range(0, FILTERS, stride):
        # what she does else explains the reading as the best does, but had to begin
        share = math.exp(gained[k] - best)
        evidence = math.log(driven * share + 1.0 - driven) + switches * math.log(share + chance)
        noise.evidence[which, k] = fade * noise.evidence[which, k] + evidence


@compiled(uncounted=True)
def _start(x: Float64, p: Float64, speed: float, fix: float, step_s: float) -> None:
    """Put a filter in balance at a speed, read from a log or from two fixes of that error."""
    x[:], p[:] = 0.0, 0.0
    x[0] = x[1] = speed
    p[0, 0] = p[1, 1] = (0.05 * max(abs(speed), 1e-3)) ** 2 + 2.0 * (fix / step_s) ** 2
    p[3, 3], p[4, 4] = 1e-4, fix * fix


@compiled(uncounted=True)
def _filter(
    noise: NoiseFilters,
    setting: BankSetting,
    which: int,
    k: int,
    value: float,
    spread: float,
    a: float,
) -> float:
    """Carry one filter over a bin; return the log density of the reading."""
    x, p, work = noise.mean[which, k], noise.spread[which, k], noise.work
    gust, wander, wander_s, white = _parts(which, k)
    dt, pace = setting.step_s, setting.pace
    keep = 1.0  # no hull brings back what they differ by
    if which != _APART:
        keep = math.exp(-dt * min(_STEEP * a / max(x[1], 1e-3), 1.0 / dt))
    keep_g, keep_b = math.exp(-dt / (n.GUST_S * pace)), math.exp(-dt / (wander_s * pace))
    way = dt if which == 2 else 0.0
    # rows of the transition: speed, engine, gust, slow error, way
    for m in range(_STATES):
        work[0, m] = keep * p[0, m] + (1.0 - keep) * p[1, m] + dt * p[2, m]
        work[1, m] = p[1, m]
        work[2, m] = keep_g * p[2, m]
        work[3, m] = keep_b * p[3, m]
        work[4, m] = p[4, m] + way * (p[0, m] + p[3, m])
    for m in range(_STATES):
        q = work[m]
        p[m, 0] = keep * q[0] + (1.0 - keep) * q[1] + dt * q[2]
        p[m, 1] = q[1]
        p[m, 2] = keep_g * q[2]
        p[m, 3] = keep_b * q[3]
        p[m, 4] = q[4] + way * (q[0] + q[3])
    moved = way * (x[0] + x[3]) - (value if which == 2 else 0.0)
    x[4] += moved
    x[0] = keep * x[0] + (1.0 - keep) * x[1] + dt * x[2]
    x[2] *= keep_g
    x[3] *= keep_b
    if which == _APART:
        p[0, 0] += 2.0 * n.CURRENT[1] ** 2 * dt / (n.CURRENT_S * pace)
    else:
        p[1, 1] += (n.POWER_DRIFT * x[1]) ** 2 * dt / (600.0 * pace)
    p[2, 2] += (1.0 - keep_g * keep_g) * (gust * a) ** 2
    p[3, 3] += (1.0 - keep_b * keep_b) * wander * wander
    first, second = (4, 4) if which == 2 else (0, 3)
    variance = (white * spread) ** 2 + _rounding(noise, which) ** 2 + 1e-12
    off = -x[4] if which == 2 else value - x[0] - x[3]
    gain = work[_STATES]
    total = variance
    for m in range(_STATES):
        gain[m] = p[m, first] + (p[m, second] if second != first else 0.0)
    total += gain[first] + (gain[second] if second != first else 0.0)
    usual = (1.0 - n.BAD) * math.exp(-0.5 * off * off / total) / (ROOT_TWO_PI * math.sqrt(total))
    # or anything, which no filter explains better than another
    density = usual + n.BAD * n.BAD_DENSITY / (dt if which == 2 else 1.0)
    share = usual / density
    for m in range(_STATES):
        x[m] += share * gain[m] / total * off
        for j in range(_STATES):
            p[m, j] -= share * gain[m] * gain[j] / total
    return math.log(density)


@compiled(inline=True, uncounted=True)
def _kind_of(k: int) -> int:
    """Return which gust and slow error a filter has, whatever its white noise."""
    return k % _GUSTS + _GUSTS * (k // (_GUSTS * _WHITES))


@compiled(uncounted=True)
def _compare(noise: NoiseFilters, which: int) -> None:
    """
    Fill in what the other instrument, and what both differ by, say of gusts and slow errors.

    The gusts are the same ship's; what they differ by is the larger of both slow errors.
    """
    alone, apart, found = noise.beside
    alone[:], apart[:], found[:] = -np.inf, -np.inf, 0.0
    other = s.LOG if which != s.LOG else s.GROUND if noise.seen[s.GROUND] >= 8 else 2
    if noise.seen[_APART] < 8 or (which == 2 and noise.seen[s.GROUND] >= 8):
        return
    for k in range(FILTERS):
        kind = _kind_of(k)
        alone[kind] = max(alone[kind], noise.evidence[other, k])
        none = kind - kind % _GUSTS  # no gust moves one of them alone
        apart[none] = max(apart[none], noise.evidence[_APART, k - k % _GUSTS])
    for kind in range(len(found)):
        gust, own = kind % _GUSTS, kind // _GUSTS
        found[kind] = -np.inf
        for its in range(_WANDERS * _TIMES):
            larger = its if its // _TIMES > own // _TIMES else own
            both = alone[gust + _GUSTS * its] + apart[_GUSTS * larger]
            found[kind] = max(found[kind], both)


@compiled(uncounted=True)
def _average(noise: NoiseFilters, setting: BankSetting, out: Float64) -> None:
    """Average the filters of each instrument by their evidence; the gust is the log's first."""
    gusted = False
    for which in range(3):
        if noise.seen[which] < 8:
            continue
        _compare(noise, which)
        beside, best = noise.beside[2], -np.inf
        for k in range(FILTERS):
            best = max(best, noise.evidence[which, k] + beside[_kind_of(k)])
        total = g = b = t = w = 0.0
        for k in range(FILTERS):
            share = math.exp(noise.evidence[which, k] + beside[_kind_of(k)] - best)
            gust, wander, wander_s, white = _parts(which, k)
            total += share
            g += share * math.log(gust)
            b += share * math.log(wander)
            t += share * math.log(wander_s)
            w += share * white * white
        spread = _spread(noise, which, setting)
        white = math.hypot(math.sqrt(w / total) * spread, _rounding(noise, which))
        if not gusted:
            out[s.N_GUST], gusted = math.exp(g / total), True
        wander, wander_s = math.exp(b / total), math.exp(t / total)
        if which == 0:
            out[s.N_WANDER], out[s.N_WANDER_S], out[s.N_LOG] = wander, wander_s, white
        elif which == 1:
            out[s.N_EDDY], out[s.N_EDDY_S], out[s.N_GROUND] = wander, wander_s, white
        elif noise.seen[1] < 8:
            out[s.N_EDDY], out[s.N_EDDY_S], out[s.N_FIX], out[s.N_WALK] = (
                wander,
                wander_s,
                white,
                0.0,
            )
        else:  # the speed over ground has said what is common
            out[s.N_FIX] = white
            out[s.N_WALK] = wander * math.sqrt(2.0 * wander_s * setting.pace)
    if noise.rate[1] > 8.0:
        out[s.N_RATE] = math.sqrt(noise.rate[0]) + 1e-5
