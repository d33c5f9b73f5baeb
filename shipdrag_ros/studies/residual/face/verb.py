# SPDX-License-Identifier: Apache-2.0
"""
Fit a published form of the residual-resistance coefficient to tests of several hulls, and predict
others. Such a form meets the hulls it was made from and misleads for others, so every prediction
says whether it may be used: not outside the convex hull of the data, not beyond their leverage,
not where the data leave it open, and not where a trend contradicts physics. Columns: L_B, B_T,
Fr, and C_B or slenderness (L / V^(1/3)), the other follows; lcb (x_c / L) for Sakhnovsky.

Options
-------
--report FILE.html
    write the fit with its pictures to one HTML file
DATA.csv
    table with a header
--form
    {fit.AUTO}: the one that predicts left-out hulls best
--target COLUMN
    column of the residual resistance: coefficient c_R, or force per weight
--predict NEW.csv
    table of hulls and Froude numbers
--ship FILE
    ship file with a baseline of coefficients, to which --write gives the fitted c_R as wave
    resistance
--lcb X
    centre of buoyancy of that ship over L, as in the data
--write FILE
    ship file to write; holds the Froude numbers at which the hull is accepted, refused if there
    are none
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shipdrag_ros.cli.arguments import add, number, unused_file
from shipdrag_ros.cli.output import Output, Presentation, by_columns, show
from shipdrag_ros.display import Section, Table
from shipdrag_ros.errors import DataError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources.formats.csv.table import Numbers, read_numbers
from shipdrag_ros.studies.residual import fit
from shipdrag_ros.studies.residual.fit import with_residual
from shipdrag_ros.studies.surface.face import verb
from shipdrag_ros.studies.surface.fit import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIT = 'The fit'
_ABOUT = (
    'is residual resistance, in the measure of the data: what is left when friction '
    'is taken away, mostly waves. It is a sum of the terms in the table below, each times its '
    'coefficient. L, B and T are length, breadth and draught, C_B is the block coefficient, '
    'lcb the place of the centre of buoyancy, psi the slenderness L / V^(1/3), Fr the Froude '
    'number of the length (Fr_V: of V^(1/3), V the displaced volume).'
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('data', type=Path, metavar='DATA.csv')
    parser.add_argument('--form', required=True, choices=(*fit.FORMS, fit.AUTO))
    parser.add_argument('--target', required=True, metavar='COLUMN')
    parser.add_argument('--predict', type=Path, metavar='NEW.csv')
    parser.add_argument('--ship', type=Path, metavar='FILE')
    parser.add_argument('--lcb', type=number(-0.2, 0.2), metavar='X')
    parser.add_argument('--write', type=unused_file('.yaml'), metavar='FILE')
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Fit, predict and show it.
    """
    output = Output(options.json)
    if (options.ship is None) != (options.write is None):
        raise DataError('--write', ['--ship FILE and --write FILE belong together; give both'])
    if options.lcb is not None and options.ship is None:
        raise DataError(
            '--lcb', ['is of the ship of --ship FILE; give it too, or leave --lcb out']
        )
    ship = None if options.ship is None else Ship.load(options.ship)
    if options.target in (*fit.REQUIRED, *fit.OPTIONAL):
        raise DataError(
            '--target',
            [f'{options.target!r} is a ratio of the hull; name the column of its resistance'],
        )
    table, hulls = _read(options.data, fit.FORMS.get(options.form), options.target)
    values = table.column(options.target)
    found = fit.fit_residual(hulls, values, form=options.form)
    predictions = []
    if options.predict is not None:
        predictions = found.predict(_read(options.predict, found.form)[1])
    source = f'{options.data.name}, {len(values)} rows'
    seen = shown(found, predictions, values, target=options.target, source=source)
    show(output, seen, options.report)
    if ship is not None:
        written = with_residual(ship, found, lcb=options.lcb)
        options.write.write_text(written.to_yaml(), encoding='utf-8')
        output.log(f'ship file with the fitted wave resistance in {options.write}')
    output.json({**found.to_dict(), 'predictions': verb.prediction_documents(predictions)})
    return 0


def _read(path: Path, form: fit.RegressionForm | None, *more: str) -> tuple[Numbers, fit.Hulls]:
    """Read hulls with all that a form needs of them."""
    needed = (*fit.REQUIRED, 'lcb') if form is not None and form.needs_lcb else fit.REQUIRED
    table = read_numbers(path, (*needed, *more), optional=fit.OPTIONAL)
    return table, fit.Hulls.of(str(path), table.names, table.values)


def shown(
    found: fit.ResidualFit,
    predictions: Sequence[Prediction],
    values: Float64,
    *,
    target: str,
    source: str,
) -> Presentation:
    """
    Return what is printed, and shown on a page.

    Parameters
    ----------
    found
    predictions
        May be empty.
    values : (n,)
        Measured.
    target, source
        What was measured, and where the data come from.
    """

    def pictures() -> Iterator[tuple[str, Figure, str]]:
        left = (
            'What the form leaves of its own data, a dot a row. Good: dots on both sides of '
            'the line everywhere; a bow or a slope shows a term that the form lacks.'
        )
        yield _FIT, verb.residual_picture(values - found.fit.residuals, values, target), left
        error, _, leverage = fit.leave_hulls_out(found.form, found.hulls, values)
        if np.any(np.isfinite(error)):
            caption = (
                'Each hull predicted from the others, so the error to expect of a new one. To the '
                'right of 1 a hull is more unusual (leverage) than any of the others: there the '
                'form goes beyond its data, and its predictions are marked as not to be used.'
            )
            yield _FIT, verb.left_out_picture(error, leverage, target), caption

    asked = [('Predictions', verb.predictions_table(predictions))] if predictions else []
    tables = (
        *asked,
        ('Coefficients of the form', coefficients(found)),
        ('Ranges of the data; outside their convex hull nothing is to be used', _domain(found)),
    )
    return Presentation(
        f'{target} by ratios of the hull',
        _sentence(found, target, predictions),
        [
            Section(text=(_technical(found), f'{target} {_ABOUT}')),
            Section(
                'What these data can and cannot show' if found.notes else '', lines=found.notes
            ),
            Section(_FIT, tables=tables),
        ],
        pictures(),
        source=source,
    )


def _sentence(found: fit.ResidualFit, target: str, predictions: Sequence[Prediction]) -> str:
    """Say in words what was found."""
    said = (
        f'{target} by the form of {found.form.name.capitalize()}, fitted to {found.count} hulls, '
        f'{len(found.hulls)} rows.'
    )
    if np.isfinite(found.left_out):
        said += f' A hull that is left out is missed by {np.sqrt(found.left_out):.2g} (rms).'
    if predictions:
        used = sum(each.inside for each in predictions)
        said += f' Of {len(predictions)} predictions {used} may be used.'
    return said


def _technical(found: fit.ResidualFit) -> str:
    """Say how well the data determine the form."""
    rank, count = found.fit.rank, len(found.fit.coefficients)
    open_ones = '' if rank == count else f': {count - rank} combination(s) of terms stay open'
    return (
        f'Residual criterion F = {found.criterion:.4g}; the data determine {rank} of {count} '
        f'terms{open_ones}; condition {found.fit.condition:.2g}.'
    )


def coefficients(found: fit.ResidualFit) -> Table:
    """
    Show the coefficients of the form, by the terms that they stand before.
    """
    deviations = found.coefficient_sd
    return by_columns(
        {
            'term': found.terms,
            'coefficient': (f'{value:.5g}' for value in found.fit.coefficients),
            'sd': (f'{sd:.2g}' if np.isfinite(sd) else 'open' for sd in deviations),
        }
    )


def _domain(found: fit.ResidualFit) -> Table:
    """Show the ranges of the data."""
    return by_columns(
        {
            '': found.domain.names,
            'from': (f'{low:.4g}' for low in found.domain.lower),
            'to': (f'{high:.4g}' for high in found.domain.upper),
        }
    )
