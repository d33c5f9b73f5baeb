# SPDX-License-Identifier: Apache-2.0
"""`shipdrag cable`: drag of a towed cable, and the line that may replace it."""

from __future__ import annotations

import argparse
from typing import Any

from shipdrag_ros.cli.arguments import add_json, add_report, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.studies.cable import words
from shipdrag_ros.studies.cable.drag import (
    Cable,
    CableSurface,
    Tangent,
    compare_errors,
    tangent_range,
)
from shipdrag_ros.studies.cable.face import page as cable_page


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Drag of a cable that is towed along the flow, 0.5 rho C0 l d V^2, and the range of '
        'speeds in which its tangent at V0 may replace it. C0 is that of a smooth cylinder of '
        'the same length over diameter, unless --rough or --c0 is given.'
    )
    for name, meaning, unit, most in (
        ('--length', 'length of the cable', 'm', 1e6),
        ('--diameter', 'diameter of the cable', 'm', 10.0),
        ('--speed', 'V0, the speed of towing', 'm/s', 40.0),
    ):
        parser.add_argument(
            name,
            required=True,
            type=number(0.0, most, unit=unit, above=True),
            metavar='V0' if name == '--speed' else 'M',
            help=f'{meaning} [{unit}]',
        )
    surface = parser.add_mutually_exclusive_group()
    surface.add_argument(
        '--rough',
        action='store_const',
        const=CableSurface.ROUGH,
        default=CableSurface.SMOOTH,
        dest='drag',
        help='C0 of a very rough cylinder (a log) in place of a smooth one',
    )
    surface.add_argument(
        '--c0',
        type=number(0.0, 10.0, above=True),
        metavar='X',
        dest='drag',
        help='C0 on length times diameter [-]; ropes have 0.01 to 0.04',
    )
    parser.add_argument(
        '--tolerance',
        type=number(0.0, 10.0, above=True),
        default=0.1,
        metavar='X',
        help='relative error that the tangent may have [-]',
    )
    parser.add_argument(
        '--density',
        type=number(900.0, 1100.0, unit='kg/m^3'),
        default=1025.0,
        metavar='RHO',
        help='density of the water [kg/m^3]',
    )
    add_report(parser, of='result')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Compute and show it.
    """
    output = Output(options.json)
    cable = Cable(options.length, options.diameter, options.drag)
    tangent = Tangent(cable.in_water(options.density), options.speed)
    _show(output, cable, tangent, options.tolerance)
    if options.report is not None:
        cable_page.write_cable(options.report, cable, tangent, tolerance=options.tolerance)
        output.log(f'report in {options.report}')
    output.json(document(cable, tangent, options.tolerance))
    return 0


def document(cable: Cable, tangent: Tangent, tolerance: float) -> dict[str, Any]:
    """
    Return the document of a cable; ranges and rows are in u = V/V0.
    """
    return {
        'c0': cable.c0,
        'drag_n': tangent.drag_n,
        'linear_gain_n_per_m_s': tangent.gain_n_per_m_s,
        'linear_range': tangent_range(tolerance),
        'errors': compare_errors(tangent.speed_m_s, tolerance),
    }


def _show(output: Output, cable: Cable, tangent: Tangent, tolerance: float) -> None:
    output.say(words.sentence(cable, tangent))
    output.say(words.line(tangent, tolerance))
    output.table(words.facts(cable, tangent, tolerance))
    output.heading('Errors of the lines')
    output.table(words.errors(tangent, tolerance))
    for note in words.notes(cable):
        output.say(note)
    area = tangent.drag.drag_area_m2
    output.say(f'On a ship: shipdrag simulate --effect towed_cable={area:.6g} ...')
