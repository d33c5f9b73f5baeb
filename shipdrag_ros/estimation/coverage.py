# SPDX-License-Identifier: Apache-2.0
"""Which inputs of a coastdown have gaps, and what its figure rests on there."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.samples import SECOND_NS

_GAP_S = 10.0  # without a sample, and more than _GAP_STEPS usual steps: a gap
_GAP_STEPS = 5.0
_WORTH_SAYING = 0.1  # of the window


def missing_s(series: Series, start_ns: int, end_ns: int) -> float:
    """
    Return how much of a window an input says nothing of.

    Parameters
    ----------
    series : n samples
        Inside the window.
    start_ns, end_ns
        The window [ns].

    Returns
    -------
    float
        Sum of the gaps [s].
    """
    if not len(series):
        return (end_ns - start_ns) / SECOND_NS
    edges = np.concatenate([[start_ns], series.time_ns, [end_ns]])
    steps = np.diff(edges) / SECOND_NS
    usual = float(np.median(steps))
    return float(steps[steps > max(_GAP_S, _GAP_STEPS * usual)].sum())


def coverage_notes(window: Window) -> tuple[str, ...]:
    """
    Say which inputs have gaps, and what the estimate rests on there.

    Parameters
    ----------
    window
        Of the whole coastdown.

    Returns
    -------
    tuple of str
        A sentence for each input of the motion that says nothing of a tenth of it.
    """
    before = window if window.before is None else window.before
    length = (window.end_ns - window.start_ns) / SECOND_NS
    missing = {}
    for name in window.motion:
        series = window.series(name)
        if len(series) or len(before.series(name)):
            missing[name] = missing_s(series, window.start_ns, window.end_ns)
    notes = []
    for name, seconds in missing.items():
        if seconds <= _WORTH_SAYING * length:
            continue
        others = [other for other in missing if missing[other] < 0.5 * seconds]
        rests = (
            f'there the estimate rests on {" and ".join(others)}'
            if others
            else 'nothing else shows what happened there'
        )
        notes.append(
            f'{name}: no usable reading for {seconds:.0f} of {length:.0f} s (silent, stuck or '
            f'rejected): {rests}'
        )
    return tuple(notes)
