# SPDX-License-Identifier: Apache-2.0
"""
Resistance that the ship is expected to have.

Clean hull in calm, deep water without true wind. The baseline is stated as
coefficients or as a table; outside its tables it refuses to answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.fields import (
    Kind,
    Problems,
    choice,
    declare,
    number,
    numbers,
    section,
    text,
)
from shipdrag_ros.samples import Float64

NO_CLEAN_HULL = (
    'Fouling cannot be judged without a clean hull: the ship file states no `baseline`. Add one '
    'from model tests, or learn it from runs of the clean hull with `shipdrag baseline`.'
)
"""What is said first of a ship without a baseline."""

# Below this the flow along the hull is laminar and the ITTC line, singular at 100, means
# nothing: C_F is held, so that the resistance falls to 0 with the square of the speed.
REYNOLDS_MIN = 1e5

_KNOWN = declare(
    choice('resistance', 'retardation'),
    'what relative_sd is of; retardation, R / (mass (1 + n_r)), where coastdowns have shown it: '
    'the error of n_r is no part of it',
    default='resistance',
)
_SCATTER = declare(
    number(0.0, 1.0),
    'by how much single runs differ, relative: sd of the resistance from run to run',
    default=0.0,
)


@dataclass(frozen=True)
class CoefficientSd:
    """
    Relative standard deviations of the coefficients.
    """

    friction: float = declare(number(0.0, 1.0), 'of C_V as a whole, C_A included')
    wave: float = declare(number(0.0, 2.0), 'of C_W')
    correlation: float = declare(number(-0.999, 0.999), 'of the two', default=0.0)


@dataclass(frozen=True)
class CoefficientBaseline:
    """
    Resistance from coefficients on the wetted surface.

    Notes
    -----
    R = 0.5 rho S v |v| (C_V + C_W) + still-air drag,
    C_V = (1 + form_factor) C_F + correlation_allowance.
    """

    form_factor: float = declare(number(0.0, 1.0), 'k in (1 + k) C_F')
    correlation_allowance: float = declare(number(-5e-4, 2e-3), 'C_A')
    wave_froude: tuple[float, ...] = declare(
        numbers(0.0, 2.0, ascending=True), 'Froude numbers of the wave coefficients'
    )
    wave_coefficient: tuple[float, ...] = declare(numbers(0.0, 0.1), 'C_W, at each of wave_froude')
    relative_sd: CoefficientSd = declare(section(CoefficientSd), 'how well they are known')
    relative_sd_of: str = _KNOWN
    run_scatter: float = _SCATTER
    source: str = declare(text(), 'where the figures come from', default='')

    @cached_property
    def _wave(self) -> Any:
        from scipy.interpolate import PchipInterpolator  # slow to import

        return PchipInterpolator(self.wave_froude, self.wave_coefficient)

    def wave(self, froude: Float64) -> Float64:
        """
        Return C_W at Froude numbers >= 0.

        Raises
        ------
        ShipdragError
            Outside the table.
        """
        return _inside(self._wave, froude, 'baseline.wave_froude', self.wave_froude, '')

    def viscous(self, reynolds: Float64) -> Float64:
        """
        Return C_V at Reynolds numbers of the length.
        """
        return (1.0 + self.form_factor) * ittc57(reynolds) + self.correlation_allowance


@dataclass(frozen=True)
class TableBaseline:
    """
    Resistance as a table, still-air drag included.
    """

    speed_m_s: tuple[float, ...] = declare(
        numbers(0.0, 40.0, 'm/s', ascending=True), 'speeds through water'
    )
    resistance_n: tuple[float, ...] = declare(
        numbers(0.0, 1e8, 'N'), 'resistance at each of speed_m_s'
    )
    relative_sd: float = declare(number(0.0, 1.0), 'relative standard deviation of the table')
    relative_sd_of: str = _KNOWN
    run_scatter: float = _SCATTER
    source: str = declare(text(), 'where the figures come from', default='')

    @cached_property
    def _resistance(self) -> Any:
        from scipy.interpolate import PchipInterpolator  # slow to import

        return PchipInterpolator(self.speed_m_s, self.resistance_n)

    def resistance(self, speed: Float64) -> Float64:
        """
        Return the resistance [N] at speeds >= 0 [m/s].

        Raises
        ------
        ShipdragError
            Outside the table.
        """
        table = self.speed_m_s
        return _inside(self._resistance, speed, 'baseline.speed_m_s', table, ' m/s')


Baseline = CoefficientBaseline | TableBaseline


def baseline() -> Kind:
    """
    Expect one of the two forms, known by their keys.
    """

    def read(value: object, path: str, problems: Problems) -> object:
        is_table = isinstance(value, dict) and ('speed_m_s' in value or 'resistance_n' in value)
        form = section(TableBaseline if is_table else CoefficientBaseline)
        return form.read(value, path, problems)

    return Kind(read, 'coefficients or a table')


def ittc57(reynolds: Float64) -> Float64:
    """
    Return the friction coefficient C_F of the ITTC-57 line.

    Notes
    -----
    C_F = 0.075 / (log10 Re - 2)^2, held below `REYNOLDS_MIN`.
    """
    return 0.075 / (np.log10(np.maximum(reynolds, REYNOLDS_MIN)) - 2.0) ** 2


def _inside(table: Any, at: Float64, key: str, points: tuple[float, ...], unit: str) -> Float64:
    # the last digit of a Froude number made from a speed may lie outside
    near = np.clip(at, points[0], points[-1])
    outside = ~(np.abs(at - near) <= 1e-12 * points[-1])
    result: Float64 = table(near)
    if np.any(outside):
        worst = float(np.asarray(at)[outside].flat[0])
        raise ShipdragError(
            f'{key}: asked for {worst:.4g}{unit}, the table has '
            f'{points[0]:g}..{points[-1]:g}{unit}; add points or stay inside'
        )
    return result
