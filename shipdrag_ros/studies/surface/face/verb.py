# SPDX-License-Identifier: Apache-2.0
"""`shipdrag surface`: a polynomial surface of measured coefficients, and its degree."""

from __future__ import annotations

import argparse
import keyword
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros.cli.arguments import add_json, add_report, new_file
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import DataError
from shipdrag_ros.regression import Prediction, Surface, fit_surface
from shipdrag_ros.regression import words as fit_words
from shipdrag_ros.regression.surface import LOWEST, MAX_DEGREE
from shipdrag_ros.sources.numbers import read_numbers
from shipdrag_ros.studies.surface.face.page import write_surface


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Fit a polynomial surface to a table of measured or computed coefficients, in any '
        'number of inputs. The degree is raised while that lowers the residual variance by '
        'more than chance: the rule of the order of a coastdown fit. Inputs are scaled inside; '
        'the coefficients are those of raw powers.'
    )
    parser.add_argument('data', type=Path, metavar='DATA.csv', help='table with a header')
    parser.add_argument(
        '--inputs',
        required=True,
        type=_names,
        metavar='COLUMN[,COLUMN]...',
        help='columns that the surface is over, alpha,beta for instance',
    )
    parser.add_argument(
        '--target', required=True, metavar='COLUMN', help='column of what was measured'
    )
    parser.add_argument(
        '--max-degree',
        type=_degree,
        default=MAX_DEGREE,
        metavar='N',
        help='highest degree to try',
    )
    parser.add_argument(
        '--predict',
        type=Path,
        metavar='NEW.csv',
        help='table with the same inputs, for which the surface is evaluated',
    )
    parser.add_argument(
        '--export',
        type=new_file('.py'),
        metavar='FILE.py',
        help='write the surface and its derivatives as plain Python functions of the inputs',
    )
    add_report(parser, of='surface')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Fit and show it.
    """
    output = Output(options.json)
    inputs, target = options.inputs, options.target
    if target in inputs:
        raise DataError('--target', [f'{target!r} is one of the inputs too; name another column'])
    if options.export is not None:
        _check_names((*inputs, target))
    data = read_numbers(options.data, (*inputs, target))
    points, values = data.values[:, :-1], data.values[:, -1]
    found = fit_surface(points, values, inputs=inputs, max_degree=options.max_degree)
    asked = None if options.predict is None else read_numbers(options.predict, inputs).values
    predictions = [] if asked is None else found.predict(asked)
    _show(output, found, target, predictions)
    if options.export is not None:
        options.export.write_text(found.source(target), encoding='utf-8')
        output.log(f'function in {options.export}')
    if options.report is not None:
        write_surface(
            options.report,
            found,
            source=f'{options.data.name}, {len(values)} rows',
            target=target,
            points=points,
            values=values,
            predictions=predictions,
        )
        output.log(f'report in {options.report}')
    content = document(found)
    if asked is not None:
        slopes = found.polynomial.gradient(asked).tolist()
        content['predictions'] = [
            {**each, 'gradient': dict(zip(inputs, slope))}
            for each, slope in zip(prediction_documents(predictions), slopes)
        ]
    output.json(content)
    return 0


def document(found: Surface) -> dict[str, Any]:
    """
    Return the document of a surface.
    """
    table = found.table
    return {
        'degree': found.degree,
        'table': [
            {'degree': degree, 'terms': terms, 'sse': sse, 'rmse': rmse, 'f': f, 'p': p}
            for degree, terms, sse, rmse, f, p in zip(
                found.degrees,
                table.coefficients.tolist(),
                table.sse.tolist(),
                np.sqrt(table.variance).tolist(),
                table.f.tolist(),
                table.p.tolist(),
            )
        ],
        'coefficients': [
            {'powers': powers, 'value': value, 'sd': sd}
            for powers, value, sd in zip(
                found.polynomial.powers.tolist(), found.coefficients.tolist(), found.sd.tolist()
            )
        ],
        'domain': found.domain.ranges,
        'notes': found.notes,
    }


def prediction_documents(found: Sequence[Prediction]) -> list[dict[str, Any]]:
    """
    Return the documents of predictions.
    """
    return [
        {
            'value': each.value,
            'sd': each.sd,
            'inside': each.inside,
            'reasons': list(each.reasons),
        }
        for each in found
    ]


def _show(output: Output, found: Surface, target: str, predictions: Sequence[Prediction]) -> None:
    output.say(fit_words.sentence(found, target))
    output.heading('Degrees tried')
    output.table(fit_words.degrees(found))
    output.heading('Coefficients of raw powers')
    output.table(fit_words.coefficients(found))
    if predictions:
        output.heading('Predictions')
        output.table(fit_words.predictions(predictions))
    for note in found.notes:
        output.say(f'NOTE: {note}')


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(','))
    if not all(names) or len(set(names)) < len(names):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected different columns separated by commas'
        )
    return names


def _degree(text: str) -> int:
    if not text.isdecimal() or int(text) < LOWEST:
        raise argparse.ArgumentTypeError(f'{text!r}, expected a whole number, {LOWEST} or more')
    return int(text)


def _check_names(names: Sequence[str]) -> None:
    problems = [
        f'{name!r} is no name in Python; rename the column'
        for name in names
        if not name.isidentifier() or keyword.iskeyword(name)
    ]
    if problems:
        raise DataError('--export', problems)
