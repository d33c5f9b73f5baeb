# SPDX-License-Identifier: Apache-2.0
"""`shipdrag residual`: residual resistance from shape, and where it may not be used."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shipdrag_ros.cli.arguments import add_json, add_report, number, unused_file
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import DataError
from shipdrag_ros.regression import Prediction
from shipdrag_ros.regression import words as fit_words
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources.numbers import read_numbers
from shipdrag_ros.studies.residual.baseline import with_residual
from shipdrag_ros.studies.residual.face.page import write_residual
from shipdrag_ros.studies.residual.fit import AUTO, ResidualFit, fit_residual
from shipdrag_ros.studies.residual.forms import FORMS
from shipdrag_ros.studies.residual.hulls import OPTIONAL, REQUIRED, Hulls
from shipdrag_ros.studies.residual.words import coefficients, domain, sentence, technical
from shipdrag_ros.studies.surface.face.verb import prediction_documents


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Fit a published form of the residual-resistance coefficient to tests of several hulls, '
        'and predict others. Such a form meets the hulls it was made from and misleads for '
        'others, so every prediction says whether it may be used: not outside the convex hull '
        'of the data, not beyond their leverage, not where the data leave it open, and not where '
        'a trend contradicts physics. Columns: L_B, B_T, Fr, and C_B or slenderness '
        '(L / V^(1/3)), the other follows; lcb (x_c / L) for Sakhnovsky.'
    )
    parser.add_argument('data', type=Path, metavar='DATA.csv', help='table with a header')
    parser.add_argument(
        '--form',
        required=True,
        choices=(*FORMS, AUTO),
        help=f'{AUTO}: the one that predicts left-out hulls best',
    )
    parser.add_argument(
        '--target',
        required=True,
        metavar='COLUMN',
        help='column of the residual resistance: coefficient c_R, or force per weight',
    )
    parser.add_argument(
        '--predict', type=Path, metavar='NEW.csv', help='table of hulls and Froude numbers'
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file with a baseline of coefficients, to which --write gives the fitted c_R '
        'as wave resistance',
    )
    parser.add_argument(
        '--lcb',
        type=number(-0.2, 0.2),
        metavar='X',
        help='centre of buoyancy of that ship over L, as in the data',
    )
    parser.add_argument(
        '--write',
        type=unused_file('.yaml'),
        metavar='FILE',
        help='ship file to write; holds the Froude numbers at which the hull is accepted, '
        'refused if there are none',
    )
    add_report(parser, of='fit')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Fit, predict and show it.
    """
    output = Output(options.json)
    if (options.ship is None) != (options.write is None):
        raise DataError('--write', ['--ship FILE and --write FILE belong together; give both'])
    ship = None if options.ship is None else Ship.load(options.ship)
    needed: tuple[str, ...] = REQUIRED
    if options.form != AUTO and FORMS[options.form].needs_lcb:
        needed = (*REQUIRED, 'lcb')
    if options.target in (*REQUIRED, *OPTIONAL):
        raise DataError(
            '--target',
            [f'{options.target!r} is a ratio of the hull; name the column of its resistance'],
        )
    table = read_numbers(options.data, (*needed, options.target), optional=OPTIONAL)
    hulls = Hulls.of(str(options.data), table.names, table.values)
    values = table.column(options.target)
    found = fit_residual(hulls, values, form=options.form)
    predictions = [] if options.predict is None else _predictions(options.predict, found)
    _show(output, found, options.target, predictions)
    if options.report is not None:
        write_residual(
            options.report,
            found,
            source=f'{options.data.name}, {len(values)} rows',
            target=options.target,
            values=values,
            predictions=predictions,
        )
        output.log(f'report in {options.report}')
    if ship is not None:
        written = with_residual(ship, found, lcb=options.lcb)
        options.write.write_text(written.to_yaml(), encoding='utf-8')
        output.log(f'ship file with the fitted wave resistance in {options.write}')
    output.json(document(found, predictions))
    return 0


def document(found: ResidualFit, predictions: Sequence[Prediction]) -> dict[str, Any]:
    """
    Return the document of a fit and its predictions.
    """

    def named(values: Sequence[float]) -> dict[str, float]:
        return {f'b{i}': value for i, value in enumerate(values)}

    return {
        'form': found.form.name,
        'terms': {f'b{i}': term for i, term in enumerate(found.form.terms)},
        'coefficients': named(found.fit.coefficients.tolist()),
        'coefficient_sd': named(found.coefficient_sd.tolist()),
        'F': found.criterion,
        'left_out_rms': math.sqrt(found.left_out),
        'rank': found.fit.rank,
        'condition': found.fit.condition,
        'hulls': found.count,
        'domain': found.domain.ranges,
        'predictions': prediction_documents(predictions),
        'notes': found.notes,
    }


def _predictions(path: Path, found: ResidualFit) -> list[Prediction]:
    needed = (*REQUIRED, 'lcb') if found.form.needs_lcb else REQUIRED
    table = read_numbers(path, needed, optional=OPTIONAL)
    return found.predict(Hulls.of(str(path), table.names, table.values))


def _show(
    output: Output, found: ResidualFit, target: str, predictions: Sequence[Prediction]
) -> None:
    output.say(sentence(found, target, predictions))
    output.say(technical(found))
    output.heading('Coefficients')
    output.table(coefficients(found))
    output.heading('Ranges of the data')
    output.table(domain(found))
    if predictions:
        output.heading('Predictions')
        output.table(fit_words.predictions(predictions))
    for note in found.notes:
        output.say(f'NOTE: {note}')
