# SPDX-License-Identifier: Apache-2.0
"""What the histories say of the past: coastdowns with their dates, and why they end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes.bank import Bank
from shipdrag_ros.coastdown.regimes.state import (
    BRAKE,
    COUNT,
    GLIDE,
    GLIDE_TURN,
    HELD,
    KIND,
    LEVEL,
    SWITCHES,
    TURN,
    WEIGHT,
    BankSetting,
)
from shipdrag_ros.samples import Float64


class SmoothedGlide(NamedTuple):
    """
    A stretch in which she probably glides.

    Attributes
    ----------
    stop_s, date_s, begin_s, end_s
        Medians of when the thrust began to fall, of when an abrupt stop would have cost as much
        speed or a shaft shows the thrust gone, of when it was gone, and of the end [s of the
        bank].
    begin_sd_s
        Standard deviation of `begin_s`.
    probability
        The largest in it.
    after
        Regime that follows; -1 where none does.
    """

    stop_s: float
    date_s: float
    begin_s: float
    end_s: float
    begin_sd_s: float
    probability: float
    after: int


class _Stretches(NamedTuple):
    """Every glide of every history: stop, date, begin, end, weight, and what follows."""

    stop_s: Float64
    date_s: Float64
    begin_s: Float64
    end_s: Float64
    weight: Float64
    after: NDArray[np.int64]


def _stretches(bank: Bank, setting: BankSetting) -> _Stretches:
    all_ = bank.histories
    count = int(all_.used[0])
    now_s = int(all_.clock[0]) * setting.step_s
    weight = np.exp(all_.number[:count, WEIGHT])
    switches = all_.whole[:count, COUNT]
    at, what, ramp = all_.at[:count], all_.what[:count], all_.ramp[:count]
    rows, columns = np.nonzero((np.arange(SWITCHES) < switches[:, np.newaxis]) & (what == GLIDE))
    last = columns + 1 >= switches[rows]
    following = np.minimum(columns + 1, SWITCHES - 1)
    end = np.where(last, now_s, at[rows, following])
    stop, lasts = at[rows, columns], ramp[rows, columns]
    seen = (setting.shafts > 0) & (all_.whole[rows, KIND] < HELD)
    # the revs fall evenly: an abrupt stop after a third of that costs as much speed
    date = np.minimum(stop + np.where(seen, lasts, lasts / 3.0), end)
    begin = np.minimum(stop + lasts, end)
    after = np.where(last, -1, what[rows, following])
    return _Stretches(stop, date, begin, end, weight[rows], after)


def _gliding(found: _Stretches, bins: int, step_s: float) -> Float64:
    edges = np.zeros(bins + 1)
    first = np.clip(np.rint(found.begin_s / step_s).astype(int), 0, bins)
    last = np.clip(np.rint(found.end_s / step_s).astype(int), 0, bins)
    np.add.at(edges, first, found.weight)
    np.add.at(edges, last, -found.weight)
    return np.cumsum(edges)[:-1]


def glides(bank: Bank, setting: BankSetting, speed: Float64) -> list[SmoothedGlide]:
    """
    Read the coastdowns out of all histories.

    Parameters
    ----------
    speed : (bins,)
        Mean speed in each bin [m/s]: what keeps it, glides no more.
    """
    found, step_s = _stretches(bank, setting), setting.step_s
    likely = _gliding(found, int(bank.histories.clock[0]), step_s)
    inside = np.concatenate([[False], likely > n.HOLD[0], [False]])
    edges = np.flatnonzero(inside[1:] != inside[:-1]).reshape(-1, 2)
    all_of = []
    for first, last in edges:
        peak = float(likely[first:last].max())
        if peak < n.HOLD[1]:
            continue
        shared = np.minimum(found.end_s, last * step_s) - np.maximum(found.begin_s, first * step_s)
        one = shared > 0.5 * (last - first) * step_s
        if not one.any():
            continue
        glide = _one(_Stretches(*(each[one] for each in found)), peak)
        end_s = min(glide.end_s, _even_s(speed, glide, step_s))
        if end_s - glide.begin_s >= n.SHORTEST_S * setting.pace:
            all_of.append(glide._replace(end_s=end_s))
    return all_of


def _one(found: _Stretches, peak: float) -> SmoothedGlide:
    """Take medians over the histories that hold one glide."""
    share = found.weight / found.weight.sum()
    stop, date, begin, end = (
        _median(each, share) for each in (found.stop_s, found.date_s, found.begin_s, found.end_s)
    )
    mean = float(share @ found.begin_s)
    sd = float(np.sqrt(max(share @ found.begin_s**2 - mean**2, 0.0)))
    codes = np.arange(-1, GLIDE_TURN + 1)
    after = int(codes[np.argmax([share[found.after == code].sum() for code in codes])])
    return SmoothedGlide(min(stop, date), date, max(date, begin), end, sd, peak, after)


def _median(value: Float64, share: Float64) -> float:
    order = np.argsort(value, kind='stable')
    place = np.searchsorted(np.cumsum(share[order]), 0.5)
    return float(value[order[min(int(place), len(order) - 1)]])


def _even_s(speed: Float64, glide: SmoothedGlide, step_s: float) -> float:
    """Return when she begins to keep her speed; infinite where she does not."""
    part, length = n.EVEN
    ahead = round(float(length) / n.BIN_S)
    first = round(glide.begin_s / step_s) + 2 * ahead
    last = min(round(glide.end_s / step_s), len(speed) - ahead)
    for k in range(first, last):
        now = float(np.mean(speed[max(k - 3, 0) : k + 1]))
        if float(np.mean(speed[k + ahead - 3 : k + ahead + 1])) > part * now:
            return k * step_s
    return float('inf')


def other_regime(bank: Bank) -> int:
    """
    Return the likeliest regime now that is no glide: the reason of a dismissal.
    """
    all_ = bank.histories
    count = int(all_.used[0])
    weight = np.exp(all_.number[:count, WEIGHT])
    regime = all_.whole[:count, 0]
    sums = [weight[regime == code].sum() for code in (LEVEL, BRAKE, TURN, GLIDE_TURN)]
    return (LEVEL, BRAKE, TURN, GLIDE_TURN)[int(np.argmax(sums))]
