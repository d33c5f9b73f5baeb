# SPDX-License-Identifier: Apache-2.0
"""The page that says which derivatives of a steered ship matter."""

from __future__ import annotations

from pathlib import Path

from shipdrag_ros.display import Section
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.studies.sensitivity import steering_words as words
from shipdrag_ros.studies.sensitivity.face import pictures
from shipdrag_ros.studies.sensitivity.steering import Experiment, SteeringStudy


def write_steering(path: Path, found: SteeringStudy, shown: Experiment) -> None:
    """
    Write all of it as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    found
        The losses and the reduced model.
    shown
        Of several manoeuvres.
    """
    names = (
        f'{found.check.manoeuvre.name} of the full and of the reduced models: lines that lie on '
        'each other show that what was left out is not missed.'
    )
    parts = (
        (
            'How much each matters',
            picture(
                pictures.ranking_picture(found),
                'How much the motion changes when a derivative is wrong: the longer the bar, the '
                'better it must be known. Pale bars, short of the line, may be left out of the '
                'model.',
            ),
            words.LOSSES,
            words.loss_table(found),
        ),
        (
            'The model without the others',
            picture(pictures.check_picture(found), names),
            words.CHECK,
            words.check_table(found),
        ),
        (
            'Which manoeuvre to sail',
            picture(
                pictures.design_picture(shown),
                'Loss of 10 per cent of each derivative in each manoeuvre: the darker, the better '
                'it is seen. Dot: the manoeuvre that shows it best.',
            ),
            words.DESIGN,
            words.design_table(shown),
        ),
    )
    sections = [Section(lines=words.notes(found))]
    for heading, drawing, caption, table in parts:
        sections.append(Section(heading, pictures=(drawing,), tables=((caption, table),)))
    sections.append(
        Section('What the names mean', tables=((words.MEANINGS, words.meaning_table(found)),))
    )
    write_page(
        path,
        f'Which derivatives matter: {found.ship.name}',
        sections,
        source=found.ship.source,
        sentence=words.sentence(found),
    )
