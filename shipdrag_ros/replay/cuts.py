# SPDX-License-Identifier: Apache-2.0
"""What of a stretch was cut and why, in words."""

from __future__ import annotations

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import EndedCoastdown, NotCoastdown

_AROUND_NS = 60_000_000_000  # that clocks of sensors and recorder may be apart

StretchSpan = tuple[int, int]


def cut_lines(coastdown: EndedCoastdown, span_ns: StretchSpan | None) -> tuple[str, ...]:
    """
    Say what was cut off a stretch, a sentence each.

    Parameters
    ----------
    coastdown
    span_ns
        Of the record, from whose start times are counted.
    """
    if not coastdown.cuts:
        return ()
    start_ns, end_ns = stretch(coastdown)
    whole = f'{_moment(start_ns, span_ns)} to {_moment(end_ns, span_ns)}'
    kept = f'{_moment(coastdown.start_ns, span_ns)} to {_moment(coastdown.end_ns, span_ns)}'
    first = (
        f'Nothing of {whole} is taken for a coastdown:'
        if coastdown.withdrawn
        else f'Of {whole} only {kept} is taken for a coastdown; the rest was cut:'
    )
    return (first, *(cut_line(cut, span_ns) for cut in coastdown.cuts))


def cut_line(cut: NotCoastdown, span_ns: StretchSpan | None) -> str:
    """
    Say when and why a stretch is no coastdown.
    """
    start, end = _moment(cut.start_ns, span_ns), _moment(cut.end_ns, span_ns)
    return f'{start} to {end}, {cut.reason.value.replace("_", "-")}: {cut.text}'


def stretch(coastdown: EndedCoastdown) -> StretchSpan:
    """Return the bounds of what was examined."""
    every: list[EndedCoastdown | NotCoastdown] = [coastdown, *coastdown.cuts]
    return min(each.start_ns for each in every), max(each.end_ns for each in every)


def inside(time_ns: int, span_ns: StretchSpan | None) -> bool:
    return span_ns is not None and (span_ns[0] - _AROUND_NS <= time_ns <= span_ns[1] + _AROUND_NS)


def _moment(time_ns: int, span_ns: StretchSpan | None) -> str:
    """Return a time in s from the start of the record, or of day where clocks are apart."""
    if span_ns is None or not inside(time_ns, span_ns):
        return display.utc(time_ns)
    return f'{(time_ns - span_ns[0]) * 1e-9:.1f} s'
