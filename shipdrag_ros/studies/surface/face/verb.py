# SPDX-License-Identifier: Apache-2.0
"""
Fit a polynomial surface to a table of measured or computed coefficients, in any number of inputs.
The degree is raised while that lowers the residual variance by more than chance: the rule of the
order of a coastdown fit. Inputs are scaled inside; the coefficients are those of raw powers.

Options
-------
--report FILE.html
    write the surface with its pictures to one HTML file
DATA.csv
    table with a header
--inputs COLUMN[,COLUMN]...
    columns that the surface is over, alpha,beta for instance
--target COLUMN
    column of what was measured
--max-degree N
    highest degree to try
--predict NEW.csv
    table with the same inputs, for which the surface is evaluated
--export FILE.py
    write the surface and its derivatives as plain Python functions of the inputs
"""

from __future__ import annotations

import argparse
import keyword
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.cli.arguments import add, new_file, whole
from shipdrag_ros.cli.output import Output, Presentation, by_columns, show
from shipdrag_ros.display import Section, Table
from shipdrag_ros.errors import DataError
from shipdrag_ros.report.drawing import BLUE, VERMILION, one_axis
from shipdrag_ros.samples import Float64
from shipdrag_ros.sources.formats.csv.table import read_numbers
from shipdrag_ros.studies.surface.fit import LOWEST, MAX_DEGREE, Prediction, Surface, fit_surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def degree_picture(surface: Surface) -> Figure:
    """
    Draw the residual standard deviation against the degree.
    """
    from matplotlib.ticker import MaxNLocator

    with one_axis(9.0, 2.8) as (figure, axis):
        axis.plot(surface.degrees, np.sqrt(surface.table.variance), color=BLUE, marker='o')
        if np.all(surface.table.variance > 0.0):
            axis.set_yscale('log')
        label = f'chosen: {surface.degree}'
        axis.axvline(surface.degree, color=VERMILION, linestyle='--', label=label)
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set(xlabel='degree', ylabel='RMSE')
        axis.legend()
    return figure


def residual_picture(fitted: Float64, measured: Float64, target: str) -> Figure:
    """
    Draw what a fit leaves, against what it says.
    """
    with one_axis(9.0, 2.8) as (figure, axis):
        axis.plot(fitted, measured - fitted, '.', color='#888888', markersize=4, rasterized=True)
        axis.axhline(0.0, color=BLUE, linewidth=1.0)
        axis.set(xlabel=f'{target}, fitted', ylabel='measured - fitted')
    return figure


def contour_picture(surface: Surface, points: Float64, target: str) -> Figure:
    """
    Draw a surface over two inputs.
    """
    low, high = surface.domain.lower, surface.domain.upper
    x, y = np.meshgrid(np.linspace(low[0], high[0], 61), np.linspace(low[1], high[1], 61))
    value = surface.polynomial(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    with one_axis(6.5, 4.6) as (figure, axis):
        drawn = axis.contourf(x, y, value, levels=16, cmap='cividis')
        figure.colorbar(drawn, label=target)
        axis.plot(points[:, 0], points[:, 1], '.', color='white', markersize=2, rasterized=True)
        axis.set(xlabel=surface.inputs[0], ylabel=surface.inputs[1])
    return figure


def left_out_picture(error: Float64, leverage: Float64, target: str) -> Figure:
    """
    Draw how far each hull is off when the others predict it.

    Parameters
    ----------
    error, leverage : (n,)
        Of hulls left out, the leverage over the largest of the others.
    target
        What is predicted.
    """
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    inside = leverage <= 1.0
    with one_axis(9.0, 3.0) as (figure, axis):
        beyond = leverage[~inside], error[~inside]
        axis.semilogx(leverage[inside], error[inside], '.', color=BLUE, label='within')
        axis.semilogx(*beyond, 'x', color=VERMILION, label='beyond the data')
        axis.axvline(1.0, color='#777777', linestyle='--')
        axis.axhline(0.0, color='#777777', linewidth=1.0)
        axis.set_xlabel('leverage over the largest of the other hulls [1]')
        axis.xaxis.set_major_formatter(ScalarFormatter())
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_ylabel(f'{target}, predicted - measured')
        axis.legend()
    return figure


_FIT = 'The fit'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('data', type=Path, metavar='DATA.csv')
    parser.add_argument('--inputs', required=True, type=_names, metavar='COLUMN[,COLUMN]...')
    parser.add_argument('--target', required=True, metavar='COLUMN')
    parser.add_argument('--max-degree', type=whole(LOWEST), default=MAX_DEGREE, metavar='N')
    parser.add_argument('--predict', type=Path, metavar='NEW.csv')
    parser.add_argument('--export', type=new_file('.py'), metavar='FILE.py')
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Fit and show it.
    """
    output = Output(options.json)
    inputs, target = options.inputs, options.target
    if target in inputs:
        raise DataError('--target', [f'{target!r} is one of the inputs too; name another column'])
    if options.export is not None and (
        problems := [
            f'{name!r} is no name in Python; rename the column'
            for name in (*inputs, target)
            if not name.isidentifier() or keyword.iskeyword(name)
        ]
    ):
        raise DataError('--export', problems)
    data = read_numbers(options.data, (*inputs, target))
    points, values = data.values[:, :-1], data.values[:, -1]
    found = fit_surface(points, values, inputs=inputs, max_degree=options.max_degree)
    asked = None if options.predict is None else read_numbers(options.predict, inputs).values
    predictions = [] if asked is None else found.predict(asked)
    source = f'{options.data.name}, {len(values)} rows'
    seen = shown(found, points, values, predictions, target=target, source=source)
    show(output, seen, options.report)
    if options.export is not None:
        options.export.write_text(found.source(target), encoding='utf-8')
        output.log(f'function in {options.export}')
    content = _document(found)
    if asked is not None:
        slopes = found.polynomial.gradient(asked)
        content['predictions'] = [
            {**each, 'gradient': dict(zip(inputs, slope))}
            for each, slope in zip(prediction_documents(predictions), slopes)
        ]
    output.json(content)
    return 0


def _document(found: Surface) -> dict[str, Any]:
    """Return the document of a surface."""
    table = found.table
    tried = (table.coefficients, table.sse, np.sqrt(table.variance), table.f, table.p)
    terms = (found.polynomial.powers, found.coefficients, found.sd)
    heads = ('degree', 'terms', 'sse', 'rmse', 'f', 'p')
    return {
        'degree': found.degree,
        'table': [dict(zip(heads, row)) for row in zip(found.degrees, *tried)],
        'coefficients': [dict(zip(('powers', 'value', 'sd'), row)) for row in zip(*terms)],
        'domain': found.domain.ranges,
        'notes': found.notes,
    }


def prediction_documents(found: Sequence[Prediction]) -> list[dict[str, Any]]:
    """
    Return the documents of predictions.
    """
    keys = ('value', 'sd', 'inside', 'reasons')
    return [{key: getattr(each, key) for key in keys} for each in found]


def shown(
    surface: Surface,
    points: Float64,
    values: Float64,
    predictions: Sequence[Prediction],
    *,
    target: str,
    source: str,
) -> Presentation:
    """
    Return what is printed, and shown on a page.

    Parameters
    ----------
    surface
    points : (n, d)
        Data.
    values : (n,)
        Measured there.
    predictions
        May be empty.
    target, source
        What was measured, and where the data come from.
    """

    def pictures() -> Iterator[tuple[str, Figure, str]]:
        degrees = (
            'Residual standard deviation against the degree; the lowest degree on the plateau '
            'is chosen.'
        )
        yield _FIT, degree_picture(surface), degrees
        rest = residual_picture(surface.polynomial(points), values, target)
        yield _FIT, rest, 'What the surface leaves of the data.'
        if len(surface.inputs) == 2:
            drawn = contour_picture(surface, points, target)
            yield _FIT, drawn, 'The surface; dots are the data.'

    asked = [('Predictions', predictions_table(predictions))] if predictions else []
    tables = (
        ('Degrees tried; F and p of the step from the degree before', degrees_table(surface)),
        ('Coefficients of raw powers', coefficients_table(surface)),
        *asked,
    )
    notes = 'What these data can and cannot show' if surface.notes else ''
    return Presentation(
        f'Surface of {target} over {", ".join(surface.inputs)}',
        surface.summary(target)[0],
        [Section(notes, lines=surface.notes), Section(_FIT, tables=tables)],
        pictures(),
        source=source,
    )


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(','))
    if not all(names) or len(set(names)) < len(names):
        why = f'{text!r}, expected different columns separated by commas'
        raise argparse.ArgumentTypeError(why)
    return names


def degrees_table(surface: Surface) -> Table:
    """
    Show all degrees tried, as the table of S5 with the test beside it.
    """
    table = surface.table
    return by_columns(
        {
            'degree': map(str, surface.degrees),
            'terms': map(str, table.coefficients),
            'SSE': (f'{sse:.4g}' for sse in table.sse),
            'RMSE': (f'{rmse:.4g}' for rmse in np.sqrt(table.variance)),
            'F': ('-' if np.isnan(f) else f'{f:.3g}' for f in table.f),
            'p': ('-' if np.isnan(p) else f'{p:.2g}' for p in table.p),
            '': ('chosen' if degree == surface.degree else '' for degree in surface.degrees),
        }
    )


def coefficients_table(surface: Surface) -> Table:
    """
    Show the coefficients of raw powers of the inputs.
    """
    return by_columns(
        {
            'term': (_term(surface.inputs, each) for each in surface.polynomial.powers.tolist()),
            'coefficient': (f'{value:.6g}' for value in surface.coefficients),
            'sd': (f'{sd:.2g}' for sd in surface.sd),
        }
    )


def predictions_table(found: Sequence[Prediction]) -> Table:
    """
    Show predictions and why some may not be used.
    """
    return by_columns(
        {
            'row': (f'{number}' for number in range(1, 1 + len(found))),
            'value': (f'{each.value:.6g}' for each in found),
            'sd': (f'{each.sd:.2g}' if np.isfinite(each.sd) else 'open' for each in found),
            'use': ('yes' if each.inside else 'NO: ' + '; '.join(each.reasons) for each in found),
        }
    )


def _term(inputs: Sequence[str], powers: Sequence[int]) -> str:
    factors = [
        name if power == 1 else f'{name}^{power}' for name, power in zip(inputs, powers) if power
    ]
    return ' '.join(factors) or '1'
