# SPDX-License-Identifier: Apache-2.0
"""Tables of a result as text, the same in the terminal and on the page; its curves as CSV."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import ENDED_BY, EndedCoastdown, InputCounts, NotCoastdown
from shipdrag_ros.display import Table, spreadsheet_text
from shipdrag_ros.estimation import tables
from shipdrag_ros.estimation.force import Force, usual_speed_m_s
from shipdrag_ros.estimation.result import FroudeMax
from shipdrag_ros.estimation.words import FROUDE_MAX_BY
from shipdrag_ros.replay import words
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import Ranking

COLUMNS = ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2', 'froude')
OF_CONDITIONS = ('resistance_m_s2', 'sigma_m_s2')
"""Columns that stand once more behind these, of the run's conditions."""


def facts(coastdown: EndedCoastdown) -> Table:
    """
    Show how a coastdown was found and what its estimate rests on.
    """
    seconds = (coastdown.end_ns - coastdown.start_ns) * 1e-9
    rows: list[tuple[str, ...]] = [
        ('start', display.utc(coastdown.start_ns)),
        ('duration', display.duration(seconds)),
        ('ended because', words.ended(coastdown)),
    ]
    if coastdown.onset_detected_ns is not None:
        # from where it seemed to begin, which may have been cut since
        first_ns = min([coastdown.start_ns, *(cut.start_ns for cut in coastdown.cuts)])
        delay = (coastdown.onset_detected_ns - first_ns) * 1e-9
        rows.append(('confirmed after', display.duration(delay)))
    if coastdown.regimes is not None:
        rows.append(('the model explains the record', words.explained(coastdown.regimes)))
    if coastdown.estimate is not None:
        rows.extend(tables.facts(coastdown.estimate).rows)
    return Table(('', ''), tuple(rows))


def coastdowns_table(runs: Sequence[RunResult]) -> Table:
    """
    Show all coastdowns, a line each, at one speed as far as each is known there.
    """
    speed = common_speed_m_s(runs)
    rows = []
    for run in runs:
        for coastdown in run.coastdowns:
            cells = ('-', '-', '-', '-')
            if coastdown.estimate is not None and len(coastdown.estimate.valid_curve):
                force = Force.of(coastdown.estimate.valid_curve, run.ship)
                cells = force.cells(force.near(speed))
            rows.append(
                (
                    display.utc(coastdown.start_ns),
                    run.bag,
                    *(cell or '-' for cell in cells),
                    coastdown.failure or ENDED_BY[coastdown.ended_by],
                )
            )
    heads = ('start', 'bag', 'at', 'resistance', 'effective power', 'clean hull', 'ended because')
    return Table(heads, tuple(rows))


def common_speed_m_s(runs: Sequence[RunResult]) -> float:
    """
    Return the speed at which coastdowns are compared; 0 where none gave an estimate.
    """
    found = [part.estimate for run in runs for part in run.coastdowns if part.estimate is not None]
    return usual_speed_m_s(found, runs[0].ship) if found else 0.0


def inputs_table(inputs: Mapping[str, InputCounts]) -> Table:
    """
    Show the messages of each input and why some were not used.
    """
    return Table(
        ('input', 'messages', 'used', 'rejected'),
        tuple(
            (
                name,
                f'{counts.messages}',
                f'{counts.used}',
                ', '.join(f'{n} {reason}' for reason, n in counts.rejected.items() if n) or '-',
            )
            for name, counts in inputs.items()
        ),
    )


def not_coastdowns_table(dismissed: Sequence[NotCoastdown]) -> Table:
    """
    Show what was nearly a coastdown, or was cut, and why.
    """
    return Table(
        ('from', 'for', 'reason', 'why'),
        tuple(
            (
                display.utc(one.start_ns),
                display.duration(max(one.end_ns - one.start_ns, 0) * 1e-9),
                one.reason.value,
                one.text,
            )
            for one in dismissed
        ),
    )


def ranking_table(ranking: Ranking) -> Table:
    """
    Show hulls by Fr_max, the best first.
    """
    rows = []
    for place, hull in enumerate(ranking.hulls, start=1):
        bound = hull.found_by is FroudeMax.BRANCH_TOP
        rows.append(
            (
                f'{place}. {hull.label}',
                f'{"at least " if bound else ""}{hull.froude_max:.3f}',
                ', '.join(f'{other:.3f}' for other in hull.others) or '-',
                FROUDE_MAX_BY[hull.found_by],
            )
        )
    return Table(('hull', 'Fr_max', 'other coastdowns', 'found as'), tuple(rows))


def write_curves(path: Path, runs: Sequence[RunResult]) -> None:
    """
    Write every r(v) inside its valid range, one row a speed.

    The first columns show the bag and the number of the coastdown in it.
    """
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        behind = [f'conditions_{name}' for name in OF_CONDITIONS]
        writer.writerow(('bag', 'coastdown', *COLUMNS, *behind))
        for run in runs:
            for number, coastdown in enumerate(run.coastdowns, start=1):
                if coastdown.estimate is None:
                    continue
                calm = coastdown.estimate.valid_calm
                conditions = coastdown.estimate.valid_conditions
                columns = [getattr(calm, name).tolist() for name in COLUMNS]
                columns += [getattr(conditions, name).tolist() for name in OF_CONDITIONS]
                for values in zip(*columns):
                    writer.writerow((spreadsheet_text(run.bag), number, *values))
