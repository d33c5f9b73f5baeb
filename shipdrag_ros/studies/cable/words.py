# SPDX-License-Identifier: Apache-2.0
"""A towed cable in sentences and tables."""

from __future__ import annotations

import math

from shipdrag_ros.display import Table
from shipdrag_ros.studies.cable.drag import (
    PUBLISHED_RANGE,
    Cable,
    CableSurface,
    Tangent,
    compare_errors,
    naive_range_m_s,
    tangent_error,
    tangent_range,
)


def sentence(cable: Cable, tangent: Tangent) -> str:
    """
    Say what the drag is.
    """
    kind = (
        f'{cable.drag} cable' if isinstance(cable.drag, CableSurface) else 'cable with a stated C0'
    )
    return (
        f'A {kind}, {cable.length_m:g} m by {cable.diameter_m:g} m, towed along the flow at '
        f'{tangent.speed_m_s:g} m/s: {tangent.drag_n:.4g} N.'
    )


def line(tangent: Tangent, tolerance: float) -> str:
    """
    Say which line may replace the drag, and where.
    """
    low, high = tangent_range(tolerance)
    upward = f'to {high * tangent.speed_m_s:.4g} m/s (u = V/V0 from {low:.4f} to {high:.4f})'
    if not math.isfinite(high):
        upward = f'on (u = V/V0 from {low:.4f}, without upper end)'
    return (
        f'The tangent R = {tangent.gain_n_per_m_s:.4g} N/(m/s) V - {tangent.drag_n:.4g} N is '
        f'within {100.0 * tolerance:.3g} % of it from {low * tangent.speed_m_s:.4g} m/s {upward}; '
        'it is never above it.'
    )


def facts(cable: Cable, tangent: Tangent, tolerance: float) -> Table:
    """
    Show the figures of a cable.
    """
    low, high = tangent_range(tolerance)
    v0, percent = tangent.speed_m_s, f'{100.0 * tolerance:.3g} %'
    return Table(
        ('', ''),
        (
            ('length over diameter', f'{cable.slenderness:.5g}'),
            ('C0, on length times diameter', f'{cable.c0:.5g}'),
            ('drag area C0 l d', f'{tangent.drag.drag_area_m2:.5g} m²'),
            ('density of the water', f'{tangent.drag.density_kg_m3:g} kg/m³'),
            ('drag at V0', f'{tangent.drag_n:.5g} N'),
            ('slope of the tangent', f'{tangent.gain_n_per_m_s:.5g} N/(m/s)'),
            (f'tangent within {percent}, u = V/V0', _between(low, high)),
            (f'tangent within {percent}, V', f'{_between(low * v0, high * v0)} m/s'),
            (f'C V within {percent}, V', f'{_between(*naive_range_m_s(tolerance))} m/s'),
        ),
    )


def errors(tangent: Tangent, tolerance: float) -> Table:
    """
    Show what the lines err at speeds about V0.
    """
    rows = tuple(
        (
            f'{u:.4f}',
            f'{u * tangent.speed_m_s:.3f}',
            f'{100.0 * naive:+.1f}',
            f'{100.0 * touching:.1f}',
        )
        for u, naive, touching in compare_errors(tangent.speed_m_s, tolerance)
    )
    return Table(('u = V/V0', 'V [m/s]', 'C V: error [%]', 'tangent: error [%]'), rows)


def notes(cable: Cable) -> tuple[str, ...]:
    """
    Say what has to be known before the figures are used.
    """
    low, high = PUBLISHED_RANGE
    at_low, at_high = (f'{100.0 * float(tangent_error(u)):.1f} %' for u in PUBLISHED_RANGE)
    return (
        *(f'WARNING: {warning}' for warning in cable.warnings),
        f'The source states 10 % for u from {low:g} to {high:g}; by its own formula the tangent '
        f'errs by {at_low} at {low:g} and by {at_high} at {high:g}.',
        'The drag holds along the flow at large Reynolds numbers, without waves.',
    )


def _between(low: float, high: float) -> str:
    return f'{low:.5g} to {high:.5g}' if math.isfinite(high) else f'above {low:.5g}'
