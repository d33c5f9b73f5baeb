# SPDX-License-Identifier: Apache-2.0
"""A residual-resistance regression in sentences and tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipdrag_ros.display import Table
from shipdrag_ros.regression import Prediction
from shipdrag_ros.studies.residual.fit import ResidualFit


def sentence(found: ResidualFit, target: str, predictions: Sequence[Prediction]) -> str:
    """
    Say in words what was found.
    """
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


def technical(found: ResidualFit) -> str:
    """
    Say how well the data determine the form.
    """
    rank, count = found.fit.rank, len(found.fit.coefficients)
    open_ones = '' if rank == count else f': {count - rank} combination(s) of terms stay open'
    return (
        f'Residual criterion F = {found.criterion:.4g}; the data determine {rank} of {count} '
        f'terms{open_ones}; condition {found.fit.condition:.2g}.'
    )


def what_it_is(target: str) -> str:
    """
    Say what is fitted, and what the terms are made of.
    """
    return (
        f'{target} is residual resistance, in the measure of the data: what is left when friction '
        'is taken away, mostly waves. It is a sum of the terms in the table below, each times its '
        'coefficient. L, B and T are length, breadth and draught, C_B is the block coefficient, '
        'lcb the place of the centre of buoyancy, psi the slenderness L / V^(1/3), Fr the Froude '
        'number of the length (Fr_V: of V^(1/3), V the displaced volume).'
    )


def coefficients(found: ResidualFit) -> Table:
    """
    Show the coefficients of the form, by the terms that they stand before.
    """
    return Table(
        ('term', 'coefficient', 'sd'),
        tuple(
            (term, f'{value:.5g}', f'{sd:.2g}' if np.isfinite(sd) else 'open')
            for term, value, sd in zip(
                found.form.terms, found.fit.coefficients, found.coefficient_sd, strict=True
            )
        ),
    )


def domain(found: ResidualFit) -> Table:
    """
    Show the ranges of the data.
    """
    return Table(
        ('', 'from', 'to'),
        tuple(
            (name, f'{low:.4g}', f'{high:.4g}')
            for name, (low, high) in found.domain.ranges.items()
        ),
    )
