# SPDX-License-Identifier: Apache-2.0
"""The page that says which values of a ship file must be known well."""

from __future__ import annotations

from pathlib import Path

from shipdrag_ros.display import Section
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.studies.sensitivity import coasting_words as words
from shipdrag_ros.studies.sensitivity.coasting import CoastStudy
from shipdrag_ros.studies.sensitivity.face import pictures


def write_coasting(path: Path, found: CoastStudy) -> None:
    """
    Write all of it as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    found
    """
    parts = (
        (
            'What must be known well',
            picture(
                pictures.particulars_picture(found),
                'How far the record moves when a value of the ship file is wrong by 10 per cent, '
                'and by its stated standard deviation. The longest bars are to be measured well.',
            ),
            words.LOSSES,
            words.loss_table(found),
        ),
        (
            'What a wrong value is taken for',
            picture(
                pictures.mimic_picture(found),
                'What is left of each effect when the value beside its bar is blamed for it. A '
                'short bar: a ship file that is so far wrong is taken for the effect, and no '
                'record separates the two; a long bar: the effect looks like nothing else.',
            ),
            words.MIMICS,
            words.mimic_table(found),
        ),
    )
    sections = [Section(lines=words.notes(found))]
    for heading, drawing, caption, table in parts:
        sections.append(Section(heading, pictures=(drawing,), tables=((caption, table),)))
    write_page(
        path,
        'Which particulars matter' + (f': {found.ship.name}' if found.ship.name else ''),
        sections,
        source=found.ship.summary(),
        sentence=words.sentence(found),
    )
