# SPDX-License-Identifier: Apache-2.0
"""What the histories say of the past: the probability of each regime, and the coastdowns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.bank import (
    OUT,
    P_BRAKED,
    P_DRIVEN,
    P_ENGAGED,
    P_GLIDING,
    P_RUN_DOWN,
    P_TURNING,
    Bank,
)
from shipdrag_ros.coastdown.regimes.state import BankSetting
from shipdrag_ros.samples import Float64, Int64

_LIKELY = 0.5
_UNPOWERED = (s.GLIDE, s.BRAKE, s.GLIDE_TURN)


class SmoothedGlide(NamedTuple):
    """
    A stretch in which she probably glides.

    Attributes
    ----------
    before_s, stop_s, start_s, begin_s, end_s
        Medians of when the regime before it began, of when the thrust began to fall, of the
        date, of when the thrust was gone, and of the end [s of the bank].
    begin_sd_s
        Standard deviation of `begin_s`.
    before, after
        Regime that it follows, and that follows it; -1 where none does.
    """

    before_s: float
    stop_s: float
    start_s: float
    begin_s: float
    end_s: float
    begin_sd_s: float
    before: int
    after: int


class LostSpeed(NamedTuple):
    """
    What slowed her where she did not glide.

    Attributes
    ----------
    what
        The regime in which she lost most of her speed.
    begin_s
        Median of when it began [s of the bank].
    again
        Whether she has probably glided before.
    lost_m_s : (bins,)
        Speed that she lost in it, from the first bin looked at to the slowest [m/s].
    """

    what: int
    begin_s: float
    again: bool
    lost_m_s: Float64


class Spans(NamedTuple):
    """
    Every regime of every history, (n,) each.

    `date_s` and `gone_s` are of a glide: when an abrupt stop would have cost as much speed, or a
    shaft shows that the thrust is gone, and when it was gone; `before` and `after` the regimes
    beside it, -1 where none is; `again` whether she has glided before.
    """

    what: Int64
    before: Int64
    before_s: Float64
    begin_s: Float64
    date_s: Float64
    gone_s: Float64
    end_s: Float64
    weight: Float64
    after: Int64
    again: NDArray[np.bool_]

    def part(self, chosen: NDArray[np.bool_]) -> Spans:
        """
        Return some of them.
        """
        return Spans._make(each[chosen] for each in self)


def spans_of(bank: Bank, setting: BankSetting) -> Spans:
    """
    List the regimes that the histories have gone through.
    """
    all_ = bank.histories
    used = int(all_.used[0])
    now_s = int(all_.clock[0]) * setting.step_s
    count = all_.row['count'][:used, np.newaxis]
    # she is driven from the start on, up to the first switch
    first = np.zeros((used, 1), s.SWITCH)
    first['what'] = s.DRIVEN
    switched = np.concatenate([first, all_.switched[:used]], axis=1)
    at, what, ramp = (switched[name] for name in ('at', 'what', 'ramp'))
    place = np.arange(s.SWITCHES + 1)
    last = place == count
    end = np.where(last, now_s, np.roll(at, -1, axis=1))
    ramp = np.where(what == s.GLIDE, ramp, 0.0)
    gone = np.minimum(at + ramp, end)
    scaled = setting.shafts > 0 and setting.engine == 0.0  # revs by those of steady sailing
    seen = scaled & (all_.row['glide_kind'][:used, np.newaxis] < s.HELD)
    # the revs fall evenly: an abrupt stop after a third of that costs as much speed
    date = np.minimum(at + np.where(seen, ramp, ramp / 3.0), end)
    after = np.where(last, -1, np.roll(what, -1, axis=1))
    is_glide = what == s.GLIDE
    again = np.cumsum(is_glide, axis=1) - is_glide > 0
    weight = np.broadcast_to(np.exp(all_.row['weight'][:used, np.newaxis]), what.shape)
    there = (place <= count) & (end > at)
    before = np.where(place == 0, -1, np.roll(what, 1, axis=1))
    before_s = np.roll(at, 1, axis=1)
    return Spans(what, before, before_s, at, date, gone, end, weight, after, again).part(there)


def probability_of(found: Spans, bins: int, step_s: float) -> Float64:
    """
    Return the probability of some spans in each bin since the start.
    """
    edges = np.zeros(bins + 1)
    np.add.at(edges, np.clip(np.rint(found.begin_s / step_s).astype(int), 0, bins), found.weight)
    np.add.at(edges, np.clip(np.rint(found.end_s / step_s).astype(int), 0, bins), -found.weight)
    return np.cumsum(edges)[:-1].clip(0.0, 1.0)  # but for rounding


def smoothed(found: Spans, bins: int, step_s: float) -> dict[str, Float64]:
    """
    Return the probability of each regime in each bin since the start, given all that came.
    """
    engaged = (found.what == s.LEVEL) & found.again
    glide = found.part(found.what == s.GLIDE)
    of = {
        P_DRIVEN: found.part(np.isin(found.what, (s.DRIVEN, s.LEVEL, s.AMID)) & ~engaged),
        P_RUN_DOWN: glide._replace(end_s=glide.gone_s),
        P_GLIDING: glide._replace(begin_s=glide.gone_s),
        P_BRAKED: found.part(found.what == s.BRAKE),
        P_TURNING: found.part((found.what == s.TURN) | (found.what == s.GLIDE_TURN)),
        P_ENGAGED: found.part(engaged),
    }
    share = np.array([probability_of(of[number], bins, step_s) for number in range(len(OUT))])
    # of the histories that were kept: the least likely are dropped after they are weighed
    share /= np.maximum(share.sum(axis=0), np.finfo(float).tiny)
    return dict(zip(OUT, share, strict=True))


def glides(found: Spans, setting: BankSetting, bins: int) -> list[SmoothedGlide]:
    """
    Read the coastdowns in so many bins out of all histories, as `spans_of` gives them.
    """
    found, step_s = found.part(found.what == s.GLIDE), setting.step_s
    likely = probability_of(found._replace(begin_s=found.gone_s), bins, step_s)
    all_of: list[SmoothedGlide] = []
    for first, last in stretches(likely > _LIKELY):
        shared = np.minimum(found.end_s, last * step_s) - np.maximum(found.gone_s, first * step_s)
        one = shared > 0.5 * (last - first) * step_s
        if not one.any():
            continue
        glide = _one(found.part(one))
        # one that was not over at a doubt goes on after it
        if all_of and min(glide.begin_s, first * step_s) < all_of[-1].end_s:
            continue
        if glide.end_s - glide.begin_s >= n.SHORTEST_S * setting.step_s / n.BIN_S:
            all_of.append(glide)
    return all_of


def stretches(inside: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """
    Return first bins, and those after the last, of the stretches in which something holds.
    """
    padded = np.concatenate([[False], inside, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _one(found: Spans) -> SmoothedGlide:
    """Take medians over the histories that hold one glide."""
    share = found.weight / found.weight.sum()
    before, stop, start, begin, end = (
        median(each, share)
        for each in (found.before_s, found.begin_s, found.date_s, found.gone_s, found.end_s)
    )
    mean = float(share @ found.gone_s)
    sd = float(np.sqrt(max(share @ found.gone_s**2 - mean**2, 0.0)))
    codes = np.arange(-1, s.AMID + 1)
    beside = [
        int(codes[np.argmax([share[each == code].sum() for code in codes])])
        for each in (found.before, found.after)
    ]
    stop = min(stop, start)
    return SmoothedGlide(min(before, stop), stop, start, max(start, begin), end, sd, *beside)


def median(value: Float64, share: Float64) -> float:
    """
    Return the median of values with shares that add up to one.
    """
    order = np.argsort(value, kind='stable')
    place = np.searchsorted(np.cumsum(share[order]), 0.5)
    return float(value[order[min(int(place), len(order) - 1)]])


def unpowered(found: Spans, bins: int, setting: BankSetting) -> list[tuple[float, float]]:
    """
    Return the stretches [s] without thrust that are probably not one glide from end to end.
    """
    step_s, spared_s = setting.step_s, n.SHORTEST_S * setting.step_s / n.BIN_S
    likely = probability_of(found.part(np.isin(found.what, _UNPOWERED)), bins, step_s)
    glide = found.part(found.what == s.GLIDE)
    several = []
    for first, last in stretches(likely > _LIKELY):
        first_s, last_s = first * step_s, last * step_s
        within_s = np.minimum(glide.end_s, last_s) - np.maximum(glide.begin_s, first_s)
        if glide.weight[within_s > last_s - first_s - spared_s].sum() <= _LIKELY:
            several.append((first_s, last_s))
    return several


def slowed_by(found: Spans, speed: Float64, first: int, step_s: float) -> LostSpeed | None:
    """
    Return in what she lost most of her speed from a bin to the slowest.

    A glide only where that is likelier throughout than all else. None where she lost none.
    """
    last = first + int(np.argmin(speed[first:])) + 1
    lost = -np.diff(speed[first:last], prepend=speed[max(first - 1, 0)])
    shared = np.minimum(found.end_s, last * step_s) - np.maximum(found.begin_s, first * step_s)
    codes = (s.LEVEL, s.AMID, s.BRAKE, s.TURN, s.GLIDE_TURN, s.GLIDE)
    parts = [(found.what == code) & (shared > 0.0) for code in codes]
    losses = [
        probability_of(found.part(part), len(speed), step_s)[first:last] * lost for part in parts
    ]
    glided = probability_of(found.part(found.what == s.GLIDE), len(speed), step_s)[first:last]
    most = int(np.argmax([loss.sum() for loss in losses[:-1]]))
    best = len(codes) - 1 if glided.min() > _LIKELY else most
    if not losses[best].sum() > 0.0:
        return None
    share, part = (found.weight * shared)[parts[best]], found.part(parts[best])
    share /= share.sum()
    again = float(share[part.again].sum()) > _LIKELY
    return LostSpeed(codes[best], median(part.begin_s, share), again, losses[best])
