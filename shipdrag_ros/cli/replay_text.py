# SPDX-License-Identifier: Apache-2.0
"""The readable result of `replay`, in the terminal."""

from __future__ import annotations

from shipdrag_ros.cli.output import Output
from shipdrag_ros.replay import tables as cells
from shipdrag_ros.replay import words
from shipdrag_ros.replay.cuts import cut_lines
from shipdrag_ros.replay.hulls import Ranking
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import Together


def show_run(output: Output, run: RunResult) -> None:
    """
    Print what one bag gave.
    """
    output.heading(run.bag)
    output.say(words.ship_line(run.ship))
    for warning in run.warnings:
        output.say(f'Warning: {warning}')
    if not run.coastdowns:
        output.say(
            words.no_coastdown_sentence(run.steady_lead_s, len(run.not_coastdowns), run.why_none)
        )
    for number, coastdown in enumerate(run.coastdowns, start=1):
        output.heading(f'Coastdown {number}')
        for line in cut_lines(coastdown, run.span_ns):
            output.say(line)
        output.table(cells.facts(coastdown))
        output.say(words.result_sentence(coastdown, mass_kg=run.ship.mass_kg))
        if coastdown.estimate is not None:
            output.table(cells.curve_table(coastdown.estimate.valid_curve, truth=run.truth))
        for note in words.notes(coastdown):
            output.say(f'- {note}')
    if run.dismissed:
        output.heading('What is no coastdown')
        output.table(cells.not_coastdowns_table(run.dismissed))
    output.heading('Messages')
    output.table(cells.inputs_table(run.inputs))
    output.say(words.recorded_sentence(run.recorded))


def show_ranking(output: Output, ranking: Ranking) -> None:
    """
    Print hulls by Fr_max.
    """
    output.heading('Hulls compared: the higher Fr_max, the later a hull makes wave')
    output.table(cells.ranking_table(ranking))
    for note in ranking.notes:
        output.say(f'- {note}')


def show_together(output: Output, found: Together) -> None:
    """
    Print the one r(v) of several coastdowns, or why there is none.
    """
    if found.combined is None:
        if found.why_not:
            output.say(f'Not combined: {found.why_not}.')
        return
    output.heading(f'{found.combined.runs} coastdowns together')
    output.table(cells.combined_table(found.combined))
    for note in words.combined_notes(found.combined):
        output.say(f'- {note}')
