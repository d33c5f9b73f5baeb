# SPDX-License-Identifier: Apache-2.0
"""Pictures of a replay: what of a stretch was cut and why, hulls compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from shipdrag_ros.coastdown.events import EndedCoastdown, Regimes
from shipdrag_ros.display import speed_unit
from shipdrag_ros.estimation.pictures import LINES
from shipdrag_ros.estimation.result import ResistanceCurve
from shipdrag_ros.replay.hulls import RankedHull
from shipdrag_ros.replay.words import StretchSpan, inside, stretch
from shipdrag_ros.report.drawing import BLUE, SIZE, STYLE
from shipdrag_ros.samples import Float64

_HATCHES = ('///', '\\\\\\', 'xxx', '...')  # distinct in print too
_COLORS = ('#bbbbbb', '#9ecae1', '#2171b5', '#d94801', '#f1b300', '#636363')  # of each regime
_SHOWN = 0.02
_NARROW = 0.02  # of the time axis: no room for a label


def cut_picture(coastdown: EndedCoastdown, span_ns: StretchSpan | None, mass_kg: float) -> Figure:
    """
    Draw the speed with what was cut hatched and named, and under it what she did.

    Parameters
    ----------
    coastdown
    span_ns
        Of the record, from whose start times are counted.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    unit, unit_name = speed_unit(mass_kg)
    zero_ns = stretch(coastdown)[0]
    from_start = inside(zero_ns, span_ns)
    if span_ns is not None and from_start:
        zero_ns = span_ns[0]

    def seconds(time_ns: int) -> float:
        return (time_ns - zero_ns) * 1e-9

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout='constrained')
        regimes = coastdown.regimes
        if regimes is None:
            axis = lowest = figure.subplots()
            time_s = np.array([seconds(time_ns) for time_ns, _ in coastdown.stretch])
            speed_m_s = np.array([speed for _, speed in coastdown.stretch])
        else:
            axis, lowest = figure.subplots(2, sharex=True, height_ratios=(3, 1))
            time_s = np.array([seconds(time_ns) for time_ns in regimes.time_ns.tolist()])
            speed_m_s = regimes.speed_m_s
            _probabilities(lowest, time_s, regimes)
        axis.plot(time_s, speed_m_s / unit, color=BLUE)
        places = blended_transform_factory(axis.transData, axis.transAxes)
        first, last = (seconds(each) for each in stretch(coastdown))
        reasons = list(dict.fromkeys(cut.reason for cut in coastdown.cuts))
        for cut in coastdown.cuts:
            number = reasons.index(cut.reason)
            start, end = seconds(cut.start_ns), seconds(cut.end_ns)
            axis.axvspan(
                start,
                end,
                facecolor='#eeeeee',
                edgecolor='#999999',
                hatch=_HATCHES[number % len(_HATCHES)],
                linewidth=0.5,
                zorder=0,
            )
        for start, end, reason in _labels(coastdown, seconds):
            if end - start > _NARROW * (last - first):
                axis.text(
                    0.5 * (start + end),
                    0.97,
                    reason,
                    transform=places,
                    rotation='vertical',
                    horizontalalignment='center',
                    verticalalignment='top',
                    bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0},
                )
        axis.set_xlim(min(first, float(time_s[0])), max(last, float(time_s[-1])))
        lowest.set_xlabel(
            f'time [s] from the start of the {"record" if from_start else "stretch"}'
        )
        axis.set_ylabel(f'speed [{unit_name}]')
    return figure


def _probabilities(axis: Axes, time_s: Float64, regimes: Regimes) -> None:
    """Stack the probability of each regime; what is never likely has no place in the legend."""
    shares = {
        name.replace('_', ' '): share
        for name, share in regimes.probability.items()
        if float(share.max()) > _SHOWN
    }
    colors = [_COLORS[list(regimes.probability).index(name.replace(' ', '_'))] for name in shares]
    axis.stackplot(
        time_s,
        *shares.values(),
        labels=list(shares),
        colors=colors,
        edgecolor='white',
        linewidth=0.3,
    )
    axis.set_ylim(0.0, 1.0)
    axis.set_ylabel('probability')
    axis.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize='small')


def _labels(
    coastdown: EndedCoastdown, seconds: Callable[[int], float]
) -> list[tuple[float, float, str]]:
    """Return one label for cuts of one reason that overlap."""
    found: list[tuple[float, float, str]] = []
    for cut in coastdown.cuts:
        start, end = seconds(cut.start_ns), seconds(cut.end_ns)
        reason = cut.reason.value.replace('_', '-')
        same = next(
            (i for i, (_, b, name) in enumerate(found) if name == reason and b >= start), None
        )
        if same is None:
            found.append((start, end, reason))
        else:
            found[same] = (found[same][0], max(end, found[same][1]), reason)
    return found


def comparison_picture(hulls: Sequence[RankedHull]) -> Figure:
    """
    Draw r(Fr) of several hulls, each inside its valid range.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout='constrained')
        axis = figure.subplots()
        for number, hull in enumerate(hulls):
            color, style = LINES[number % len(LINES)]
            curve = hull.curve
            axis.fill_between(curve.froude, *_band(curve), color=color, alpha=0.15, linewidth=0)
            axis.plot(
                curve.froude, curve.resistance_m_s2, color=color, linestyle=style, label=hull.label
            )
            at_top = np.interp(hull.froude_max, curve.froude, curve.resistance_m_s2)
            axis.plot([hull.froude_max], [at_top], 'o', color=color)
        axis.set_xlabel('Froude number [-]; the dot is Fr_max')
        axis.set_ylabel('specific resistance r [m/s² = N/kg]')
        axis.legend(loc='upper left')
    return figure


def _band(curve: ResistanceCurve) -> tuple[Any, Any]:
    return (
        curve.resistance_m_s2 - 2.0 * curve.sigma_m_s2,
        curve.resistance_m_s2 + 2.0 * curve.sigma_m_s2,
    )
