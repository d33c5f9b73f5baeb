# SPDX-License-Identifier: Apache-2.0
"""
A speed held against another over minutes of steady sailing: is it off by the ratio of two units?

No driver says the unit of what it publishes, and a log in knots gives a smooth and
plausible curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from shipdrag_ros.coastdown.bins import FIRST_TRACK, SOURCES, Bins, line, newest_bin
from shipdrag_ros.display import mistaken_units
from shipdrag_ros.samples import Channel

_LOG, _GROUND = int(Channel.SPEED_THROUGH_WATER), int(Channel.SPEED_OVER_GROUND)
_SPAN_S = 60  # speeds are means over so long
_LOOKS = 4  # one after the other, all of which must say the same
_SAME = 0.05  # relative: the looks differ by less
_STEADY = 0.1  # relative change within a look
_SPEED_M_S = 1.0
_APART_M_S = 1.5  # less may be a current


def unit_doubts(bins: Bins) -> dict[str, str]:
    """
    Say which speed is off by the ratio of two units, by the last four minutes.

    Parameters
    ----------
    bins
        What the monitor keeps.

    Returns
    -------
    dict[str, str]
        What to say, by input; without those that agree, or of which nothing can be stated:
        no second speed, no way, a change of speed.
    """
    newest = max(newest_bin(bins, source) for source in range(SOURCES))
    heard = [source for source in range(SOURCES) if newest_bin(bins, source) > newest - 5]
    tracks = [source for source in heard if source >= FIRST_TRACK]
    ground = [*tracks, *(source for source in heard if source == _GROUND)]
    found = {}
    for source in (_LOG, _GROUND):
        measures = [other for other in ground if other > source]
        if source in heard and measures:
            text = _doubt(bins, source, measures[0], newest - 2)
            if text:
                found[Channel(source).input] = text
    return found


def _doubt(bins: Bins, source: int, other: int, last: int) -> str:
    pairs = list(_means(bins, source, other, last))
    if len(pairs) < _LOOKS:
        return ''
    ratios = [one / two for one, two in pairs]
    ratio, measure = math.fsum(ratios) / _LOOKS, Channel(other).input.replace('_', ' ')
    apart = min(abs(one - two) for one, two in pairs)
    if max(ratios) > (1.0 + _SAME) * min(ratios) or apart < _APART_M_S:
        return ''
    units = mistaken_units(ratio)
    if not units:
        return ''
    minutes = _LOOKS * _SPAN_S // 60
    against = 'the speed of the position' if other >= FIRST_TRACK else f'the {measure}'
    text = (
        f'it reads {ratio:.2f} times {against} over {minutes} minutes of steady sailing, near '
        f'{units}: look at the unit that its driver converts from, m/s is expected'
    )
    if source != _LOG:
        return text
    return f'{text}; if the unit is right, a current of {apart:.1f} m/s runs'


def _means(bins: Bins, source: int, other: int, last: int) -> Iterator[tuple[float, float]]:
    """Yield mean speeds of both [m/s], the latest first, as long as she is steady."""
    for look in range(_LOOKS):
        means = []
        for each in (source, other):
            slope, level, _ = line(bins, each, last - look * _SPAN_S, _SPAN_S)
            change = slope * _SPAN_S
            mean = level - 0.5 * change
            if not (mean > _SPEED_M_S and abs(change) < _STEADY * mean):  # NaN too
                return
            means.append(mean)
        yield means[0], means[1]
