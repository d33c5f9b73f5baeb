# SPDX-License-Identifier: Apache-2.0
"""A fit to measured numbers in sentences and tables, the same in the terminal and on a page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipdrag_ros.display import Table
from shipdrag_ros.studies.surface.fit import Prediction, Surface


def degrees(surface: Surface) -> Table:
    """
    Show all degrees tried, as the table of S5 with the test beside it.
    """
    table = surface.table
    rows = []
    for row, degree in enumerate(surface.degrees):
        first = np.isnan(table.f[row])
        rows.append(
            (
                f'{degree}',
                f'{table.coefficients[row]}',
                f'{table.sse[row]:.4g}',
                f'{np.sqrt(table.variance[row]):.4g}',
                '-' if first else f'{table.f[row]:.3g}',
                '-' if first else f'{table.p[row]:.2g}',
                'chosen' if degree == surface.degree else '',
            )
        )
    return Table(('degree', 'terms', 'SSE', 'RMSE', 'F', 'p', ''), tuple(rows))


def coefficients(surface: Surface) -> Table:
    """
    Show the coefficients of raw powers of the inputs.
    """
    return Table(
        ('term', 'coefficient', 'sd'),
        tuple(
            (_term(surface.inputs, powers), f'{value:.6g}', f'{sd:.2g}')
            for powers, value, sd in zip(
                surface.polynomial.powers.tolist(), surface.coefficients, surface.sd
            )
        ),
    )


def predictions(found: Sequence[Prediction]) -> Table:
    """
    Show predictions and why some may not be used.
    """
    return Table(
        ('row', 'value', 'sd', 'use'),
        tuple(
            (
                f'{number}',
                f'{each.value:.6g}',
                f'{each.sd:.2g}' if np.isfinite(each.sd) else 'open',
                'yes' if each.inside else 'NO: ' + '; '.join(each.reasons),
            )
            for number, each in enumerate(found, start=1)
        ),
    )


def _term(inputs: Sequence[str], powers: Sequence[int]) -> str:
    factors = [
        name if power == 1 else f'{name}^{power}' for name, power in zip(inputs, powers) if power
    ]
    return ' '.join(factors) or '1'
