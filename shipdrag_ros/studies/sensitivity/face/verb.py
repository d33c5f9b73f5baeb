# SPDX-License-Identifier: Apache-2.0
"""
Change one number of a model at a time, by 10 and 50 per cent up and down, and show how far the
motion moves: root mean square of its differences. With a manoeuvring model: which derivatives
matter in a zigzag or a turning circle, a check of the model without the others, and which
manoeuvre shows which derivative. With a ship file: which of its values must be known well for a
coastdown to be judged right, and which effect a wrong one is taken for.

Options
-------
--report FILE.html
    write the result with its pictures to one HTML file
--model
    manoeuvring model (default: {_MODEL})
--ship FILE
    ship file with a baseline, in its place
--manoeuvre NAME
    zigzag:ANGLE or turn:ANGLE [degrees of rudder]; with --ship {KIND} or
    {KIND}:SPEED [m/s] (default: {_MANOEUVRE}; with --ship {KIND} from
    {_FRACTION:g} of the highest speed of the baseline)
--keep N
    how many to keep (default: {_KEEP} derivatives; with --ship those values of which 10 per cent
    move the record beyond its noise)
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.face import Presentation, show
from shipdrag_ros.studies.manoeuvring import mariner, parse
from shipdrag_ros.studies.sensitivity.coasting import (
    KIND,
    SPEED_FRACTION,
    parse_coast,
    study_coast,
)
from shipdrag_ros.studies.sensitivity.face import coasting, steering
from shipdrag_ros.studies.sensitivity.steering import experiment, study

_MODELS = {'mariner': mariner}
_MODEL, _MANOEUVRE, _KEEP, _FRACTION = 'mariner', 'zigzag:15', 24, SPEED_FRACTION


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    subject = parser.add_mutually_exclusive_group()
    # without a default of argparse, which would not say that both are given
    subject.add_argument('--model', choices=list(_MODELS))
    subject.add_argument('--ship', type=Path, metavar='FILE')
    parser.add_argument('--manoeuvre', metavar='NAME')
    parser.add_argument('--keep', type=int, metavar='N')
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Analyse and show it.
    """
    output = Output(options.json)
    shown, document = (_steering if options.ship is None else _coasting)(options)
    show(output, shown, options.report)
    output.json(document)
    return 0


def _steering(options: argparse.Namespace) -> tuple[Presentation, dict[str, Any]]:
    ship = _MODELS[options.model or _MODEL]()
    manoeuvre = parse(_MANOEUVRE if options.manoeuvre is None else options.manoeuvre)
    found = study(ship, manoeuvre, keep=_KEEP if options.keep is None else options.keep)
    sailed = experiment(ship)
    return steering.shown(found, sailed), {**found.to_dict(), 'experiment': sailed.to_dict()}


def _coasting(options: argparse.Namespace) -> tuple[Presentation, dict[str, Any]]:
    ship = Ship.load(options.ship)
    asked = KIND if options.manoeuvre is None else options.manoeuvre
    found = study_coast(ship, parse_coast(ship, asked), keep=options.keep)
    return coasting.shown(found), found.to_dict()
