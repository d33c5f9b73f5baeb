# SPDX-License-Identifier: Apache-2.0
"""A stretch of record that a person says is a coastdown, judged by the regimes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from shipdrag_ros.coastdown.bins import Bins
from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, NotCoastdown, Regimes
from shipdrag_ros.coastdown.filling import add, close
from shipdrag_ros.coastdown.regimes import numbers
from shipdrag_ros.coastdown.regimes.watch import LEAD_S, RegimeFilter
from shipdrag_ros.coastdown.validate import CHANNEL_CODES, STAMPS, VALUES
from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.estimator import WindowEstimator
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Block, Float64, Int64, UInt8
from shipdrag_ros.ship import Ship

_BINS = 60  # of the bank in a window, where it is short
_PART_S = 600  # of record between two looks
_OTHERWISE = {
    'driven': (Dismissal.THRUST, 'the engine drives her'),
    'run_down': (Dismissal.THRUST, 'the thrust runs down'),
    'gliding': (Dismissal.OTHER, 'it is a glide by itself'),
    'braked': (Dismissal.BRAKE, 'something but the water slows her'),
    'turning': (Dismissal.TURN, 'she turns'),
    're_engaged': (Dismissal.THRUST, 'the engine drives her again'),
}


@compiled(
    f'void(Bins, {CHANNEL_CODES}, {STAMPS}, {VALUES}, i8)',
    like={'Bins': Bins.fresh(1)},
    uncounted=True,
)
def _fill(bins: Bins, channel: UInt8, stamp_ns: Int64, value: Float64, width: int) -> None:
    for i in range(len(channel)):
        c, stamp = int(channel[i]), stamp_ns[i]
        number = stamp // SECOND_NS
        if bins.samples[c] > 0 and number > bins.filling[c]:
            close(bins, c, width)
        add(bins, c, number, stamp, value[i, 0], value[i, 1])


def judge(accepted: Block, start_ns: int, end_ns: int, ship: Ship, slope_s: float) -> RegimeFilter:
    """
    Let the regimes take a window, and the record before it.

    Parameters
    ----------
    accepted
        Samples of one clock in the order of their arrival.
    start_ns, end_ns
        The window; that she glides there is evidence, and no more.
    ship
        Its length and volume.
    slope_s
        `Parameters.slope_window_s`.
    """
    # a short window is of a small craft, whatever the parameters were set for
    lasts_s = (end_ns - start_ns) / SECOND_NS
    width = max(1, min(RegimeFilter.width(slope_s), round(lasts_s / _BINS)))
    start, end = start_ns // SECOND_NS, end_ns // SECOND_NS
    oldest = int(accepted.stamp_ns.min()) // SECOND_NS if len(accepted) else start
    first = max(oldest, start - LEAD_S) - width
    known = start - first > 2 * width  # what she did before it
    regimes = RegimeFilter(
        ship,
        width,
        first,
        shafts=sum(bool(np.any(accepted.channel == each)) for each in SHAFTS),
        glides=0.0 if known else float(numbers.GLIDES_FIRST),
    )
    if known:
        # the claim: that she glides by then
        regimes.tell(start_ns / SECOND_NS - 2.0 * float(numbers.TOLD[1]))
    bins = Bins.fresh(LEAD_S + 2 * _PART_S)
    number = np.maximum.accumulate(accepted.stamp_ns // SECOND_NS)
    for at in range(first, end + 1, _PART_S):
        part = accepted[slice(*np.searchsorted(number, (at, min(at + _PART_S, end + 1))))]
        channel, stamp_ns = np.ascontiguousarray(part.channel), np.ascontiguousarray(part.stamp_ns)
        _fill(bins, channel, stamp_ns, part.value, round(slope_s))
        while regimes.advance(bins, min(at + _PART_S, end + 1)):
            pass
    return regimes


def estimate_given(
    accepted: Block,
    start_ns: int,
    end_ns: int,
    ship: Ship,
    parameters: Parameters,
    estimator: WindowEstimator,
) -> EndedCoastdown:
    """
    Estimate r(v) from the part of a window that is a coastdown.

    What came before the window is not known to be steady sailing; it helps to judge, and
    teaches the estimate nothing.
    """
    regimes = judge(accepted, start_ns, end_ns, ship, parameters.slope_window_s)
    what = regimes.regimes()
    given = EndedCoastdown(start_ns, end_ns, None, EndedBy.GIVEN, None, regimes=what)
    kept = _longest(regimes, start_ns, end_ns)
    if what is None:  # nothing to judge it by
        kept = start_ns, end_ns
    if kept is None:
        cut = _refused(regimes, start_ns, end_ns)
        return replace(given, failure=f'no coastdown: {cut.text}', withdrawn=True, cuts=(cut,))
    given = replace(
        given,
        start_ns=kept[0],
        end_ns=kept[1],
        cuts=(*_cuts(what, start_ns, kept[0]), *_cuts(what, kept[1], end_ns)),
    )
    try:
        found = estimator(Window.from_block(accepted, *kept), ship, parameters)
    except EstimationError as error:
        return replace(given, failure=str(error))
    return replace(given, estimate=found)


def _longest(regimes: RegimeFilter, start_ns: int, end_ns: int) -> tuple[int, int] | None:
    """Return the longest glide in a window [ns]; what is nearer to its bounds than a bin is it."""
    best = None
    for each in regimes.glides():
        first, last = round(each.begin_s * SECOND_NS), round(each.end_s * SECOND_NS)
        near = round(max(regimes.step_s, each.begin_sd_s) * SECOND_NS)
        first = start_ns if first < start_ns + near else first
        last = end_ns if last > end_ns - round(2 * regimes.step_s * SECOND_NS) else last
        if last > first and (best is None or last - first > best[1] - best[0]):
            best = first, last
    return best


def _refused(regimes: RegimeFilter, start_ns: int, end_ns: int) -> NotCoastdown:
    was = regimes.dismissal(start_ns / SECOND_NS)
    if was is None:
        return NotCoastdown(
            start_ns, end_ns, Dismissal.PLATEAU, 'she sailed on under even power all the time'
        )
    return replace(was, start_ns=start_ns, end_ns=end_ns)


def _cuts(what: Regimes | None, start_ns: int, end_ns: int) -> Iterator[NotCoastdown]:
    """Yield the parts of a stretch by the likeliest regime of each."""
    if what is None:
        return
    names = list(what.probability)
    table = np.array([what.probability[name] for name in names])
    inside = np.flatnonzero((what.time_ns > start_ns) & (what.time_ns < end_ns))
    if end_ns <= start_ns or not len(inside):
        return
    likeliest = np.argmax(table[:, inside], axis=0)
    places = [0, *(np.flatnonzero(np.diff(likeliest)) + 1).tolist(), len(inside)]
    for i, j in pairwise(places):
        part, name = inside[i:j], names[likeliest[i]]
        first = (
            start_ns if i == 0 else (what.time_ns[inside[i - 1]] + what.time_ns[inside[i]]) // 2
        )
        last = end_ns
        if j < len(inside):
            last = (what.time_ns[inside[j - 1]] + what.time_ns[inside[j]]) // 2
        most = float(what.probability[name][part].mean())
        reason, text = _OTHERWISE[name]
        yield NotCoastdown(
            int(first), int(last), reason, f'{text}: P({name.replace("_", " ")}) is {most:.2f}'
        )
