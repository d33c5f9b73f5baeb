# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet: which hull first, then each ship."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from shipdrag_ros.display import Link, Section, Table, plus_minus, utc
from shipdrag_ros.report.document import page_text
from shipdrag_ros.trend import pictures, words
from shipdrag_ros.trend.ship_trend import ShipTrend

_RANKED = 'Each ship at her reference speed, the one to be cleaned first on top.'
_RUNS = 'Coastdowns, the latest first; ± is two standard deviations'
Links = Mapping[tuple[str, int], str]
_HOW = Section(
    'How to read it',
    lines=(
        'Added resistance is the resistance of the hull through the water over that of the clean '
        'hull, at the speed stated. It is what coastdowns show, without the propeller.',
        'The band holds what is known of the hull, not of a single run: weather and draught make '
        'runs scatter about it.',
        'Speed lost is at equal effective power, where power goes as the cube of the speed: a '
        'hull whose resistance grew by 10 % is about 3 % slower. It is not the speed loss of ISO '
        '19030, which compares shaft power and so counts the propeller too.',
    ),
)


def write_trends(
    path: Path,
    trends: Sequence[ShipTrend],
    skipped: Sequence[tuple[str, str]],
    *,
    links: Links | None = None,
) -> None:
    """
    Write the trends of a fleet to an HTML file; an existing one is replaced.

    The other parameters are those of `fleet_text`.
    """
    path.write_text(fleet_text(trends, skipped, links=links), encoding='utf-8')


def fleet_text(
    trends: Sequence[ShipTrend],
    skipped: Sequence[tuple[str, str]],
    *,
    links: Links | None = None,
) -> str:
    """
    Return the trends of a fleet as one page (HTML).

    Parameters
    ----------
    trends
        In the order of their rank.
    skipped
        Bag and reason of what the fleet could not use.
    links
        Where the page of each coastdown is, by bag and start; None where there are none.
    """
    sections = [
        Section(
            'Which hull first',
            tables=((f'{_RANKED} {words.ranked_by(trends)}', words.ranking(trends)),),
        )
    ]
    for trend in trends:
        drawn = () if trend.curve is None else (pictures.added_resistance(trend),)
        steps = (('Steps in the state of the hull', words.event_table(trend)),)
        sections.append(
            Section(
                trend.series.name or 'a ship without a name',
                entry=trend.series.name or 'a ship without a name',
                lead=words.lines(trend)[:1],
                lines=words.lines(trend)[1:],
                pictures=drawn,
                tables=(*(steps if trend.events else ()), (_RUNS, _runs(trend, links or {}))),
            )
        )
    if skipped:
        table = Table(('bag', 'reason'), tuple(skipped))
        sections.append(
            Section(
                'Bags that could not be used',
                tables=(('What the fleet could not use, and why', table),),
            )
        )
    sections.append(_HOW)
    return page_text('Trend of the fleet', sections, sentence=_sentence(trends))


def _runs(trend: ShipTrend, links: Links) -> Table:
    """Return a line a coastdown; its date leads to its page, where there is one."""
    rows = []
    for point in reversed(trend.points):
        date, href = utc(point.time_ns), links.get((point.bag, point.time_ns))
        loss = words.speed_lost(point.value)
        known = bool(np.isfinite(point.value))
        rows.append(
            (
                date if href is None else Link(date, href),
                point.bag,
                plus_minus(100.0 * point.value, 200.0 * point.sd) if known else '-',
                '-' if loss is None or not known else f'{100.0 * loss:.1f}',
                point.reason or 'used',
            )
        )
    head = ('start', 'bag', 'added [%]', 'speed lost [%]', 'used, or why not')
    return Table(head, tuple(rows))


def _sentence(trends: Sequence[ShipTrend]) -> str:
    """Return the first line: which hull, and how sure."""
    if not trends or trends[0].now is None:
        return 'No ship has runs enough for a trend.'
    first = trends[0]
    cost = f'; it costs {words.amount(first.costs.usd_per_year)} USD a year' if first.costs else ''
    return (
        f'{first.series.name} first: {words.percent(first.now)} % over the clean hull'
        f'{words.speed_loss(first)}{cost}.'
    )
