# SPDX-License-Identifier: Apache-2.0
"""
A cable towed along the flow, and the lines that stand in for its drag.

Controllers and transfer functions want a force that is linear in the speed;
the drag of a cable is quadratic. Here is how large it is, and over which
speeds a line may replace it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.model import ROPES, QuadraticDrag

SHORTEST = 20.0  # l/d; the formulas hold above it
LONGEST = 1000.0  # l/d; beyond it nothing was measured, and a C0 should be stated
PUBLISHED_RANGE = (0.7, 1.5)  # of u, said to hold for 10 %; it does not


class CableSurface(StrEnum):
    """What the flow finds, for the coefficient of a cylinder along it."""

    SMOOTH = 'smooth'
    ROUGH = 'rough'


# of the base (a disc across the flow), and of l/d
_COEFFICIENTS = {CableSurface.SMOOTH: (0.99, 0.0099), CableSurface.ROUGH: (0.98, 0.0392)}


def base_coefficient(slenderness: ArrayLike, surface: CableSurface) -> Float64:
    """
    Return zeta0, the drag coefficient on the area of the base.

    Parameters
    ----------
    slenderness
        l/d, of any shape; the formula holds above 20 and for finite values.
    surface

    Notes
    -----
    S2 (10): 0.99 + 0.0099 l/d smooth, 0.98 + 0.0392 l/d rough (a log).
    """
    base, side = _COEFFICIENTS[surface]
    return base + side * np.asarray(slenderness, np.float64)


def drag_coefficient(slenderness: ArrayLike, surface: CableSurface) -> Float64:
    """
    Return C0, the drag coefficient on the area l d.

    Parameters
    ----------
    slenderness
        l/d, of any shape; the formula holds above 20 and for finite values.
    surface

    Notes
    -----
    S2 (11) with (10) unrounded; its (12) rounds to 0.777 d/l + 0.008 and
    0.769 d/l + 0.031.
    """
    zeta0 = base_coefficient(slenderness, surface)
    return 0.25 * math.pi * zeta0 / np.asarray(slenderness, np.float64)


@dataclass(frozen=True)
class Cable:
    """
    A cable along the flow.

    Attributes
    ----------
    length_m, diameter_m
        l, d.
    drag
        A surface, for which the length and diameter give C0, or C0 itself.

    Raises
    ------
    SimulationError
        Naming every value that is impossible; for a surface also if l/d is
        not above 20.

    Notes
    -----
    Source: S2, Akhmedov, Naumov: R = 0.5 rho C0 l d V^2 along the flow.

    Examples
    --------
    >>> from shipdrag_ros.studies.cable.drag import Cable
    >>> drag = Cable(length_m=100.0, diameter_m=0.05, drag=0.02).in_water(1025.0)
    >>> f'{drag.force_n(2.0):.0f} N'
    '205 N'
    """

    length_m: float
    diameter_m: float
    drag: CableSurface | float

    def __post_init__(self) -> None:
        given = ('length_m', self.length_m), ('diameter_m', self.diameter_m), ('C0', self.drag)
        problems = [
            f'{name} is {value!r}, expected above 0 and finite'
            for name, value in given
            if not (isinstance(value, CableSurface) or 0.0 < value < math.inf)
        ]
        known = problems or SHORTEST < self.slenderness < math.inf
        if isinstance(self.drag, CableSurface) and not known:
            problems.append(
                f'length over diameter is {self.slenderness:.4g}, and C0 of a {self.drag} one '
                f'is known above {SHORTEST:g}; state C0 (--c0)'
            )
        if problems:
            raise SimulationError('cable: ' + '; '.join(problems))

    @property
    def slenderness(self) -> float:
        """Length over diameter, lambda."""
        return self.length_m / self.diameter_m

    @property
    def c0(self) -> float:
        """Drag coefficient on the area l d."""
        if isinstance(self.drag, CableSurface):
            return float(drag_coefficient(self.slenderness, self.drag))
        return self.drag

    def in_water(self, density_kg_m3: float) -> QuadraticDrag:
        """
        Return the drag in water of a density.
        """
        return QuadraticDrag(self.c0 * self.length_m * self.diameter_m, density_kg_m3)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why C0 may not be what the cable has."""
        low, high = ROPES
        if isinstance(self.drag, CableSurface) and self.slenderness > LONGEST:
            return (
                f'length over diameter is {self.slenderness:.4g}; the formula for a {self.drag} '
                f'cylinder does not hold much beyond {LONGEST:g}: state C0 (--c0), for ropes '
                f'{low:g} to {high:g}',
            )
        if not isinstance(self.drag, CableSurface) and not low <= self.drag <= high:
            return (f'C0 is {self.drag:g}; ropes along the flow have {low:g} to {high:g}',)
        return ()


@dataclass(frozen=True)
class Tangent:
    """
    The line that touches a quadratic drag at one speed.

    Attributes
    ----------
    drag
    speed_m_s
        V0, above 0.

    Notes
    -----
    S2 (15), (16): C V0 (2 V - V0) in place of C V^2.
    """

    drag: QuadraticDrag
    speed_m_s: float

    def __post_init__(self) -> None:
        if not 0.0 < self.speed_m_s < math.inf:
            raise SimulationError(
                f'speed_m_s of a tangent is {self.speed_m_s!r}, expected above 0 and finite: '
                'at rest the line is zero everywhere'
            )

    @property
    def drag_n(self) -> float:
        """Drag at V0; at rest the line is as much below zero."""
        return float(self.drag.force_n(np.array(self.speed_m_s)))

    @property
    def gain_n_per_m_s(self) -> float:
        """Slope of the line, 2 C V0."""
        return 2.0 * self.drag_n / self.speed_m_s

    def force_n(self, speed_m_s: Float64) -> Float64:
        """
        Return the line's force.
        """
        return self.gain_n_per_m_s * (speed_m_s - 0.5 * self.speed_m_s)


def naive_error(speed_m_s: ArrayLike) -> Float64:
    """
    Return the relative error of C V in place of C V^2.

    Notes
    -----
    S2 (14): 1/V - 1, V in m/s; zero at 1 m/s alone.
    """
    return 1.0 / np.asarray(speed_m_s, np.float64) - 1.0


def tangent_error(u: ArrayLike) -> Float64:
    """
    Return the relative error of the tangent at u = V/V0.

    Notes
    -----
    S2 (18), 2/u - 1/u^2 - 1, written as the square that it is: never above 0.
    """
    return 0.0 - (1.0 - 1.0 / np.asarray(u, np.float64)) ** 2


def tangent_range(tolerance: float) -> tuple[float, float]:
    """
    Return the u between which the tangent errs by a tolerance at most.

    Parameters
    ----------
    tolerance
        Relative, above 0.

    Returns
    -------
    low, high
        1/(1 + s) and 1/(1 - s), s = sqrt(tolerance). The error tends to -1 as
        u grows, so from a tolerance of 1 on there is no upper end: inf.

    Raises
    ------
    SimulationError
        If the tolerance is not above 0.

    Notes
    -----
    Source: S2; the relative error of the tangent is -(1 - 1/u)^2.

    Examples
    --------
    >>> from shipdrag_ros.studies.cable.drag import tangent_range
    >>> [f'{u:.2f}' for u in tangent_range(0.1)]
    ['0.76', '1.46']
    """
    root = math.sqrt(_possible(tolerance))
    return 1.0 / (1.0 + root), 1.0 / (1.0 - root) if root < 1.0 else math.inf


def naive_range_m_s(tolerance: float) -> tuple[float, float]:
    """
    Return the speeds between which C V errs by a tolerance at most.

    Parameters
    ----------
    tolerance
        Relative, above 0.

    Returns
    -------
    low, high
        1/(1 + tolerance) and 1/(1 - tolerance) in m/s; inf from 1 on.
    """
    _possible(tolerance)
    return 1.0 / (1.0 + tolerance), 1.0 / (1.0 - tolerance) if tolerance < 1.0 else math.inf


def compare_errors(speed_m_s: float, tolerance: float) -> Float64:
    """
    Return the errors of both lines over speeds about V0.

    Parameters
    ----------
    speed_m_s
        V0, above 0.
    tolerance
        Whose ends are among the rows.

    Returns
    -------
    (n, 3) array
        u = V/V0 from 0.5 to 2 by 0.1, with the finite ends of the range; error
        of C V; error of the tangent. Errors are relative.
    """
    ends = [end for end in tangent_range(tolerance) if math.isfinite(end)]
    u = np.union1d(np.arange(5, 21) / 10.0, ends)
    return np.column_stack((u, naive_error(u * speed_m_s), tangent_error(u)))


def _possible(tolerance: float) -> float:
    if not 0.0 < tolerance < math.inf:
        raise SimulationError(
            f'tolerance is {tolerance!r}, expected above 0 and finite: 0.1 is 10 %'
        )
    return tolerance
