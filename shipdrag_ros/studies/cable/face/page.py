# SPDX-License-Identifier: Apache-2.0
"""The page of a towed cable."""

from __future__ import annotations

from pathlib import Path

from shipdrag_ros.display import Section
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.studies.cable.drag import Cable, Tangent
from shipdrag_ros.studies.cable.face import pictures as cable_pictures
from shipdrag_ros.studies.cable.words import errors, facts, line, notes, sentence

_FORMULAS = (
    'Formulas: Akhmedov, Naumov, Linearization of the dependence of the cable hydrodynamic drag '
    'force from the speed. C V is the force with the same figure C and the speed in m/s, as it is '
    'met in textbooks.'
)


def write_cable(path: Path, cable: Cable, tangent: Tangent, *, tolerance: float) -> None:
    """
    Write all of it as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    cable
    tangent
        Of its drag.
    tolerance
        Relative error that a line may have.
    """
    coefficient = picture(
        cable_pictures.coefficient_picture(cable),
        'Drag coefficient of cylinders along the flow, where it was measured.',
    )
    lines = picture(
        cable_pictures.tangent_picture(tangent, tolerance),
        'The drag and two lines in place of it, and by how much these err; shaded: where the '
        f'tangent errs by {100.0 * tolerance:.3g} % at most.',
    )
    tables = (
        ('Figures of the cable', facts(cable, tangent, tolerance)),
        ('Errors of the lines: each over the drag, less one', errors(tangent, tolerance)),
    )
    write_page(
        path,
        'Drag of a towed cable, and a line in place of it',
        [
            Section(pictures=(lines,), tables=tables),
            Section('Before it is used', lines=notes(cable)),
            Section(pictures=(coefficient,)),
        ],
        sentence=f'{sentence(cable, tangent)} {line(tangent, tolerance)}',
        foot=_FORMULAS,
    )
