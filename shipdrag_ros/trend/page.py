# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet: which hull first, then each ship."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.display import Section, Table
from shipdrag_ros.report.document import write_page
from shipdrag_ros.trend import pictures, words
from shipdrag_ros.trend.ship_trend import ShipTrend

_RANKED = 'Each ship at her reference speed, the one to be cleaned first on top'
_HOW = Section(
    'How to read it',
    lines=(
        'Added resistance is the resistance of the hull through the water over that of the clean '
        'hull, at the speed stated. It is what coastdowns show, without the propeller.',
        'The band holds what is known of the hull, not of a single run: weather and draught make '
        'runs scatter about it.',
        'It is not the speed loss of ISO 19030, which compares shaft power and so counts the '
        'propeller too. At equal effective power a hull whose resistance grew by 10 % is about '
        '3 % slower, where power goes as the cube of the speed.',
    ),
)


def write_trends(
    path: Path, trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]]
) -> None:
    """
    Write the trends of a fleet as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    trends
        In the order of their rank.
    skipped
        Bag and reason of what the fleet could not use.
    """
    sections = [Section('Which hull first', tables=((_RANKED, words.ranking(trends)),))]
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
                tables=steps if trend.events else (),
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
    write_page(path, 'Trend of the fleet', sections, sentence=_sentence(trends))


def _sentence(trends: Sequence[ShipTrend]) -> str:
    """Return the first line: which hull, and how sure."""
    if not trends or trends[0].now is None:
        return 'No ship has runs enough for a trend.'
    first = trends[0]
    return (
        f'{first.series.name} first: {words.percent(first.now)} % over the clean hull'
        f'{words.speed_loss(first)}.'
    )
