# SPDX-License-Identifier: Apache-2.0
"""The one place where a result is put together."""

from __future__ import annotations

from typing import Any, NamedTuple

from shipdrag_ros.estimation.curve import ValidRange, specific_resistance
from shipdrag_ros.estimation.motion import Motion, sigma
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.ship import Ship


class AtEnd(NamedTuple):
    """
    Speed through water [m/s] and r [m/s^2] at the end of a window, with their sigmas.
    """

    speed_m_s: float
    speed_sigma_m_s: float
    resistance_m_s2: float
    sigma_m_s2: float

    @classmethod
    def of(cls, motion: Motion, ship: Ship) -> AtEnd:
        """
        Return those of the last time of a motion.
        """
        end = motion[-1:]
        r, r_sigma, _ = specific_resistance(end, ship)
        speed_sigma = sigma(end.speed_error)
        return cls(float(end.speed[0]), float(speed_sigma[0]), float(r[0]), float(r_sigma[0]))


def assembled(estimator: str, valid: ValidRange, end: AtEnd, **others: Any) -> Estimate:
    """
    Put a result together.

    Parameters
    ----------
    estimator
        Its name.
    valid
        Where it may be used.
    end
        Of the window.
    **others
        The further fields of `Estimate`, by name.
    """
    return Estimate(
        estimator=estimator,
        froude_valid=valid.froude,
        froude_max_by=valid.by,
        froude_max_argmax=valid.argmax,
        max_relative_sigma=valid.max_relative_sigma,
        last_speed_m_s=end.speed_m_s,
        last_speed_sigma_m_s=end.speed_sigma_m_s,
        last_resistance_m_s2=end.resistance_m_s2,
        last_sigma_m_s2=end.sigma_m_s2,
        **others,
    )


def log_scale_note(scale: float, sd: float, which: str = 'log') -> str:
    """
    Say by how much a log is off, and that the band holds it.

    Parameters
    ----------
    scale, sd
        Mean and standard deviation of reading / speed - 1.
    which
        Log it is.
    """
    return (
        f'the {which} reads {100.0 * scale:+.2g} ± {200.0 * sd:.1g} % off (two standard '
        'deviations): taken out, and in the band'
    )
