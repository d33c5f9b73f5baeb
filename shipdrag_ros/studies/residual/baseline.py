# SPDX-License-Identifier: Apache-2.0
"""A fitted form as the wave resistance that a ship file states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.errors import DataError
from shipdrag_ros.ship import CoefficientBaseline, CoefficientSd, Ship
from shipdrag_ros.studies.residual.fit import Hulls, ResidualFit

_POINTS = 15  # Froude numbers tried
_VAGUE = 1.0  # of the value: a larger sd makes it no baseline
_LARGEST = 0.1  # a coefficient above this is one in other units


def with_residual(ship: Ship, fitted: ResidualFit, *, lcb: float | None) -> Ship:
    """
    Return the ship with the fitted coefficient as her wave resistance.

    Parameters
    ----------
    ship
        With breadth, draught and a baseline of coefficients, of which friction
        and allowance are kept.
    fitted
        To c_R on the wetted surface.
    lcb
        Centre of buoyancy over L, where the form needs it.

    Raises
    ------
    DataError
        If a particular is missing, the hull is outside the data, or the values
        are no coefficients.

    Notes
    -----
    c_R is what friction of a flat plate leaves, so the form factor becomes 0. The
    table holds only Froude numbers at which the guard accepts this hull; the
    largest relative standard deviation among them is stated for all.
    """
    base = ship.baseline
    missing = [name for name in ('breadth_m', 'draught_m') if getattr(ship, name) is None]
    problems = [f'{name}: missing, the hull is described by its ratios' for name in missing]
    if not isinstance(base, CoefficientBaseline):
        problems.append('baseline: expected one of coefficients, its friction is kept')
    if fitted.form.needs_lcb and lcb is None:
        problems.append(f'lcb: the form {fitted.form.name} needs it; give --lcb')
    if problems:
        raise DataError(ship.name or 'ship file', problems)
    assert isinstance(base, CoefficientBaseline)
    assert ship.breadth_m is not None
    assert ship.draught_m is not None
    froude = np.linspace(fitted.hulls.Fr.min(), fitted.hulls.Fr.max(), _POINTS)
    found = fitted.predict(_hull(ship, ship.breadth_m, ship.draught_m, lcb).at(froude))
    # the longest stretch that the guard accepts
    changes = np.flatnonzero(np.diff([each.inside for each in found])) + 1
    stretches = [part for part in np.split(np.arange(_POINTS), changes) if found[part[0]].inside]
    rows = max(stretches, key=len, default=np.arange(0))
    if len(rows) < 2:
        # of the Froude number that comes nearest to being accepted
        reasons = min((each.reasons for each in found), key=len)
        raise DataError(f'{ship.name or "ship"}: the fit may not be used for this hull', reasons)
    kept = [found[i] for i in rows]
    value = np.array([each.value for each in kept])
    relative = float(np.max([each.sd / each.value for each in kept]))
    if value.max() > _LARGEST:
        problems.append(
            f'wave_coefficient: {value.max():.3g}, expected at most {_LARGEST:g}; the target '
            'must be c_R itself on the wetted surface, neither times 1000 nor a force'
        )
    elif relative > _VAGUE:
        problems.append(
            f'wave_coefficient: the sd is up to {relative:.2g} times the value, expected at '
            f'most {_VAGUE:g}; the data do not determine it'
        )
    if problems:
        raise DataError(ship.name or 'ship file', problems)
    low, high = froude[rows[0]], froude[rows[-1]]
    return replace(
        ship,
        baseline=replace(
            base,
            form_factor=0.0,
            wave_froude=tuple(froude[rows].tolist()),
            wave_coefficient=tuple(value.tolist()),
            relative_sd=CoefficientSd(friction=base.relative_sd.friction, wave=relative),
            source=f'wave: form {fitted.form.name} fitted to {fitted.count} hulls, accepted for '
            f'Fr {low:.3g} to {high:.3g}; friction: {base.source}',
        ),
    )


def _hull(ship: Ship, breadth_m: float, draught_m: float, lcb: float | None) -> Hulls:
    ratios = {
        'L_B': ship.length_m / breadth_m,
        'B_T': breadth_m / draught_m,
        'slenderness': ship.slenderness,
        'Fr': 1.0,
        **({} if lcb is None else {'lcb': lcb}),
    }
    return Hulls.of(ship.name, tuple(ratios), np.array([list(ratios.values())]))
