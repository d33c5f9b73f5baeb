# SPDX-License-Identifier: Apache-2.0
"""The readable result of `replay`, in the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from shipdrag_ros.cli.output import Output
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.estimation import tables as estimate_tables
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.cuts import cut_lines
from shipdrag_ros.replay.hulls import Ranking
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import Together


def show_run(output: Output, run: RunResult) -> None:
    """
    Print what one bag gave.
    """
    output.heading(run.bag)
    output.say(run.ship.summary())
    for warning in run.warnings:
        output.say(f'Warning: {warning}')
    if not run.coastdowns:
        for line in run.summary():
            output.say(line)
    for number, coastdown in enumerate(run.coastdowns, start=1):
        output.heading(f'Coastdown {number}')
        _show_coastdown(output, coastdown, run)
    if run.dismissed:
        output.heading('What is no coastdown')
        output.table(tables.not_coastdowns_table(run.dismissed))
    output.heading('Messages')
    output.table(tables.inputs_table(run.inputs))
    output.say(words.recorded_sentence(run.recorded))


def _show_coastdown(output: Output, coastdown: EndedCoastdown, run: RunResult) -> None:
    """Print one coastdown: knots and kN first, m/s and m/s² below."""
    for line in cut_lines(coastdown, run.span_ns):
        output.say(line)
    lines = words.summary(coastdown, run.ship)
    for line in lines[:-1]:
        output.say(line)
    estimate = coastdown.estimate
    curve = None if estimate is None else estimate.valid_curve
    if curve is not None and len(curve):
        output.table(estimate_tables.force_table(curve, run.ship))
        output.say('')
    output.say(lines[-1])
    if curve is not None and len(curve):
        truth = None if run.truth is None else run.truth.at
        output.table(estimate_tables.curve_table(curve, truth=truth))
        output.say('')
    output.table(tables.facts(coastdown))
    if estimate is not None:
        for note in estimate_words.notes(estimate):
            output.say(f'- {note}')


def show_ranking(output: Output, ranking: Ranking) -> None:
    """
    Print hulls by Fr_max.
    """
    output.heading('Hulls compared: the higher Fr_max, the later a hull makes wave')
    output.table(tables.ranking_table(ranking))
    for note in ranking.notes:
        output.say(f'- {note}')


def show_together(output: Output, found: Together, runs: Sequence[RunResult]) -> None:
    """
    Print all coastdowns, a line each, and their one r(v), or why there is none.
    """
    if sum(len(run.coastdowns) for run in runs) > 1:
        output.heading('All coastdowns')
        output.table(tables.coastdowns_table(runs))
    if found.combined is None:
        if found.why_not:
            output.say(f'Not combined: {found.why_not}.')
        return
    ship = runs[0].ship
    force = Force.of(found.combined, ship)
    output.heading(f'{found.combined.runs} coastdowns together')
    output.say(force.at(force.near(tables.common_speed_m_s(runs))))
    output.table(estimate_tables.force_table(found.combined, ship))
    output.say('')
    output.table(estimate_tables.combined_table(found.combined))
    for note in words.combined_notes(found.combined):
        output.say(f'- {note}')
