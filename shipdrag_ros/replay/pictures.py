# SPDX-License-Identifier: Apache-2.0
"""Pictures of a replay: what of a stretch was cut and why, hulls compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.display import speed_unit
from shipdrag_ros.estimation.pictures import LINES
from shipdrag_ros.estimation.result import ResistanceCurve
from shipdrag_ros.replay.cuts import StretchSpan, inside, stretch
from shipdrag_ros.replay.hulls import RankedHull
from shipdrag_ros.report.drawing import BLUE, SIZE, STYLE

_HATCHES = ('///', '\\\\\\', 'xxx', '...')  # distinct in print too
_NARROW = 0.02  # of the time axis: no room for a label


def cut_picture(coastdown: EndedCoastdown, span_ns: StretchSpan | None, mass_kg: float) -> Figure:
    """
    Draw the speed of the whole stretch, with what was cut of it hatched and named.

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
        axis = figure.subplots()
        time_s = np.array([seconds(time_ns) for time_ns, _ in coastdown.stretch])
        axis.plot(time_s, [speed / unit for _, speed in coastdown.stretch], color=BLUE)
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
        axis.set_xlim(first, last)
        axis.set_xlabel(f'time [s] from the start of the {"record" if from_start else "stretch"}')
        axis.set_ylabel(f'speed [{unit_name}]')
    return figure


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
