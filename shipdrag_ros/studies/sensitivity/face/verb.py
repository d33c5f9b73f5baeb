# SPDX-License-Identifier: Apache-2.0
"""`shipdrag sensitivity`: which derivatives, or which values of a ship file, matter."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros.cli.arguments import add_json, add_report
from shipdrag_ros.cli.output import Output
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.manoeuvring.manoeuvre import parse
from shipdrag_ros.studies.manoeuvring.ship import mariner
from shipdrag_ros.studies.sensitivity import coasting_words, steering_words
from shipdrag_ros.studies.sensitivity.coast import KIND, SPEED_FRACTION, parse_coast
from shipdrag_ros.studies.sensitivity.coasting import CoastStudy, study_coast
from shipdrag_ros.studies.sensitivity.face import coasting_page, steering_page
from shipdrag_ros.studies.sensitivity.loss import Losses
from shipdrag_ros.studies.sensitivity.steering import Experiment, SteeringStudy, experiment, study

_MODELS = {'mariner': mariner}
_MODEL, _MANOEUVRE, _KEEP = 'mariner', 'zigzag:15', 24
_COLUMNS = ('+10', '-10', '+50', '-50', '+sd', '-sd')  # of a table of losses


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Change one number of a model at a time, by 10 and 50 per cent up and down, and show how '
        'far the motion moves: root mean square of its differences. With a manoeuvring model: '
        'which derivatives matter in a zigzag or a turning circle, a check of the model without '
        'the others, and which manoeuvre shows which derivative. With a ship file: which of its '
        'values must be known well for a coastdown to be judged right, and which effect a wrong '
        'one is taken for.'
    )
    subject = parser.add_mutually_exclusive_group()
    # without a default of argparse, which would not say that both are given
    subject.add_argument(
        '--model', choices=list(_MODELS), help=f'manoeuvring model (default: {_MODEL})'
    )
    subject.add_argument(
        '--ship', type=Path, metavar='FILE', help='ship file with a baseline, in its place'
    )
    parser.add_argument(
        '--manoeuvre',
        metavar='NAME',
        help='zigzag:ANGLE or turn:ANGLE [degrees of rudder]; with --ship '
        f'{KIND} or {KIND}:SPEED [m/s] (default: {_MANOEUVRE}; with --ship {KIND} from '
        f'{SPEED_FRACTION:g} of the highest speed of the baseline)',
    )
    parser.add_argument(
        '--keep',
        type=int,
        metavar='N',
        help=f'how many to keep (default: {_KEEP} derivatives; with --ship those values of which '
        '10 per cent move the record beyond its noise)',
    )
    add_report(parser, of='result')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Analyse and show it.
    """
    output = Output(options.json)
    if options.ship is None:
        _steering(options, output)
    else:
        _coasting(options, output)
    if options.report is not None:
        output.log(f'report in {options.report}')
    return 0


def _steering(options: argparse.Namespace, output: Output) -> None:
    ship = _MODELS[options.model or _MODEL]()
    manoeuvre = parse(_MANOEUVRE if options.manoeuvre is None else options.manoeuvre)
    found = study(ship, manoeuvre, keep=_KEEP if options.keep is None else options.keep)
    shown = experiment(ship)
    words = steering_words
    output.say(words.sentence(found))
    for note in words.notes(found):
        output.say(f'- {note}')
    for heading, table in (
        (words.LOSSES, words.loss_table(found)),
        (words.CHECK, words.check_table(found)),
        (words.DESIGN, words.design_table(shown)),
        (words.MEANINGS, words.meaning_table(found)),
    ):
        output.heading(heading)
        output.table(table)
    if options.report is not None:
        steering_page.write_steering(options.report, found, shown)
    output.json(steering_document(found, shown))


def _coasting(options: argparse.Namespace, output: Output) -> None:
    ship = Ship.load(options.ship)
    coast = parse_coast(ship, KIND if options.manoeuvre is None else options.manoeuvre)
    found = study_coast(ship, coast, keep=options.keep)
    words = coasting_words
    output.say(words.sentence(found))
    for note in words.notes(found):
        output.say(f'- {note}')
    for heading, table in (
        (words.LOSSES, words.loss_table(found)),
        (words.MIMICS, words.mimic_table(found)),
    ):
        output.heading(heading)
        output.table(table)
    if options.report is not None:
        coasting_page.write_coasting(options.report, found)
    output.json(coasting_document(found))


def steering_document(found: SteeringStudy, shown: Experiment) -> dict[str, Any]:
    """
    Return the document of a manoeuvring model.
    """
    full, reduced = np.degrees(found.check.overshoots_rad[0]), found.check.overshoots_rad[1]
    return {
        'manoeuvre': found.manoeuvre.name,
        'loss': _losses(found.losses, found.losses.mean),
        'kept': found.selection.kept,
        'dropped': found.selection.dropped,
        'threshold': found.selection.threshold,
        'check': {
            'manoeuvre': found.check.manoeuvre.name,
            'overshoot_full_deg': full,
            'overshoot_reduced_deg': np.degrees(reduced),
            'rms_difference': found.check.rms_difference,
        },
        'mean_norm': _losses(found.mean_norms, found.mean_norms.mean),
        'independent': found.independent,
        'multiples': found.ship.multiples,
        'experiment': {
            name: dict(zip((m.name for m in shown.manoeuvres), row))
            for name, row in zip(shown.names, shown.loss.tolist())
        },
    }


def coasting_document(found: CoastStudy) -> dict[str, Any]:
    """
    Return the document of a ship file; no manoeuvre of hers has an overshoot.
    """
    check = found.check
    return {
        'manoeuvre': found.coast.name,
        'loss': _losses(found.losses, found.mean),
        'kept': found.selection.kept,
        'dropped': found.selection.dropped,
        'threshold': found.selection.threshold,
        'check': {
            'manoeuvre': check.coast.name,
            'overshoot_full_deg': [],
            'overshoot_reduced_deg': [],
            'rms_difference': {'speed_m_s': check.speed_m_s, 'position_m': check.position_m},
        },
        'resistance': {
            one.particular.key: {
                'estimated': one.estimated,
                'stated': one.stated,
                'know_within': one.tolerable,
            }
            for one in found.importance
        },
        'mimics': [
            {
                'effect': mimic.effect.name,
                'size': mimic.size,
                'distance_sd': mimic.distance,
                'value': mimic.particular.key,
                'wrong_by': mimic.error,
                'left': mimic.left,
            }
            for mimic in found.mimics
        ],
    }


def _losses(losses: Losses, means: np.ndarray[Any, Any]) -> dict[str, dict[str, float]]:
    return {
        name: {**dict(zip(_COLUMNS, row)), 'mean': mean}
        for name, row, mean in zip(losses.names, losses.table.tolist(), means.tolist())
    }
