# SPDX-License-Identifier: Apache-2.0
"""Forces on the hull that several effects are fractions or multiples of."""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.ship.model import usual_wetted_surface_m2
from shipdrag_ros.ship.sections import ittc57

ROPES = (0.01, 0.04)  # C0 of towed ropes in practice
USUAL_FORM_FACTOR = 0.2  # where the baseline is a table


def friction_n(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return (1 + k) C_F times the pressure on the wetted surface [N].

    Parameters
    ----------
    speed_m_s
        Through water, 0 or more.

    Notes
    -----
    ITTC-57. A baseline that is a table has no form factor: k = 0.2.
    """
    base = ship.baseline
    k = base.form_factor if isinstance(base, CoefficientBaseline) else USUAL_FORM_FACTOR
    reynolds = speed_m_s * ship.length_m / ship.water.kinematic_viscosity_m2_s
    return (1.0 + k) * ittc57(reynolds) * _force_n(ship, speed_m_s)


def viscous_n(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return the friction with the correlation allowance [N].
    """
    base = ship.baseline
    allowance = base.correlation_allowance if isinstance(base, CoefficientBaseline) else 0.0
    return friction_n(ship, speed_m_s) + allowance * _force_n(ship, speed_m_s)


def drag_n(ship: Ship, drag_area_m2: float, speed_m_s: Float64) -> Float64:
    """
    Return 0.5 rho A v^2 [N] in the water of a ship.
    """
    return QuadraticDrag(drag_area_m2, ship.water.density_kg_m3).force_n(speed_m_s)


@dataclass(frozen=True)
class QuadraticDrag:
    """
    A drag that grows with the square of the speed.

    Attributes
    ----------
    drag_area_m2
        C0 l d.
    density_kg_m3
        Of the water.
    """

    drag_area_m2: float
    density_kg_m3: float

    def force_n(self, speed_m_s: Float64) -> Float64:
        """
        Return 0.5 rho A v^2 [N] at speeds of 0 or more; S2 (11).
        """
        return 0.5 * self.density_kg_m3 * self.drag_area_m2 * speed_m_s**2


def _force_n(ship: Ship, speed_m_s: Float64) -> Float64:
    return drag_n(ship, surface_m2(ship), speed_m_s)


def surface_m2(ship: Ship) -> float:
    """
    Return the wetted surface, the usual one of her length and volume where none is stated.
    """
    return ship.wetted_surface_m2 or usual_wetted_surface_m2(
        ship.length_m, ship.displaced_volume_m3
    )
