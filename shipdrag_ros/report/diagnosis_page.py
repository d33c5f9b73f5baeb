# SPDX-License-Identifier: Apache-2.0
"""The page of a diagnosis, for whoever runs the ship."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.diagnosis import Diagnosis, Trace
from shipdrag_ros.diagnosis import tables as diagnosis_cells
from shipdrag_ros.diagnosis import words as told
from shipdrag_ros.diagnosis.score import Score
from shipdrag_ros.replay import words
from shipdrag_ros.report import diagnosis_pictures
from shipdrag_ros.report.document import Picture, write_page
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import LIBRARY


def write_diagnosis(
    path: Path, found: Diagnosis, ship: Ship | None, *, score: Score | None
) -> None:
    """
    Write a diagnosis as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    found
        What the runs gave.
    ship
        That they were held against; None: a record of sailing, without a ship file.
    score
        Of coastdowns held against a stated baseline, on hidden data; None: not scored.
    """
    after = told.added(found)
    shown = found.effects or tuple(each for one in found.candidates for each in one.effects)
    sizes = diagnosis_cells.parameters(shown) if found.effects else diagnosis_cells.sizes(found)
    write_page(
        path,
        'diagnosis.html',
        title='What is missing in the model' + (f' of {ship.name}' if ship and ship.name else ''),
        ship='' if ship is None else words.ship_line(ship),
        runs=', '.join(trace.name for trace in found.traces),
        no_coastdown=found.no_coastdown,
        sentence=told.sentence(found),
        examined=told.examined(found),
        probabilities=Picture.of(
            diagnosis_pictures.probability_picture(told.answers(found)),
            'How probable each answer is.',
        ),
        effects=tuple(LIBRARY[name] for name in dict.fromkeys(each.name for each in shown)),
        parameters=sizes,
        facts=diagnosis_cells.facts(found),
        contradicted=told.facts(found),
        named=bool(found.effects),
        where=None if found.where is None else told.place(found),
        gaps=diagnosis_cells.gaps(found),
        motions=tuple(
            Picture.of(
                diagnosis_pictures.motion_picture(trace, after=after),
                f'{trace.name}: measured and simulated, and the difference between them. Inside '
                'the band is what noise alone may do.',
            )
            for trace in found.traces
        ),
        residuals=_residuals(found.traces, after) if found.traces else None,
        advice=told.advice(found),
        notes=found.notes,
        noise=diagnosis_cells.noise(found.traces),
        steady=', '.join(f'{trace.lead_in_s / 60.0:.0f} min' for trace in found.traces),
        baseline=told.baseline(found, ship),
        stated='' if ship is None else ', '.join(effect.name for effect in ship.effects),
        score=score if found.baseline == 'stated' else None,
    )


def _residuals(traces: Sequence[Trace], after: str) -> Picture:
    return Picture.of(
        diagnosis_pictures.residual_picture(traces, after=after),
        'What each model leaves unexplained, in standard deviations of the noise. Of good ones '
        '19 in 20 lie inside the band, without order.',
    )
