# SPDX-License-Identifier: Apache-2.0
"""Three hulls and their resistance: ITTC-57 friction, humped waves, air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

WATER_KG_M3 = 1025.0
VISCOSITY_M2_S = 1.19e-6
AIR_KG_M3 = 1.225
GRAVITY_M_S2 = 9.81
FROUDE_END = 0.05  # a glide is over below it


@dataclass(frozen=True)
class Hull:
    """
    A hull, the room it leaves for propellers, and what its crew sails it at.

    Attributes
    ----------
    form, allowance
        Form factor 1 + k and C_A on ITTC-57 friction.
    wave
        a, b, h of C_W = a exp(-b / Fr^2) (1 + h cos(1 / Fr^2)).
    added_mass
        Surge added mass over mass.
    disc_m2, pitch_ratio
        Area of all propeller discs together, and P/D at 0.7 R.
    wake, thrust_deduction
        Fractions.
    turn_loss
        Retardation in a turn over half L times the rate of turn squared.
    """

    name: str
    length_m: float
    volume_m3: float
    breadth_m: float
    draught_m: float
    surface_m2: float
    form: float
    allowance: float
    wave: tuple[float, float, float]
    air_area_m2: float
    added_mass: float
    service_m_s: float
    shafts: int
    disc_m2: float
    pitch_ratio: float
    wake: float
    thrust_deduction: float
    turn_loss: float

    @property
    def mass_kg(self) -> float:
        """Of the ship, without added mass [kg]."""
        return WATER_KG_M3 * self.volume_m3

    @property
    def end_m_s(self) -> float:
        """Speed at which a glide is over [m/s]."""
        return float(FROUDE_END * np.sqrt(GRAVITY_M_S2 * self.length_m))

    @property
    def law(self) -> np.ndarray:
        """What `water_drag` needs."""
        return np.array([self.length_m, self.surface_m2, self.form, self.allowance, *self.wave])

    def drag_n(self, speed_m_s: float) -> float:
        """
        Return the drag in calm water and still air [N].
        """
        return float(water_drag(speed_m_s, self.law) + air_drag(speed_m_s, self.air_area_m2))


@njit
def water_drag(v, law):  # type: ignore[no-untyped-def]
    """Drag of the hull in calm deep water [N], odd in the speed [m/s]."""
    length, surface, form, allowance, a, b, h = law
    s = abs(v)
    if s < 1e-3:
        return 0.0
    reynolds = max(s * length / VISCOSITY_M2_S, 1e4)
    friction = 0.075 / (np.log10(reynolds) - 2.0) ** 2
    inverse = GRAVITY_M_S2 * length / s**2
    wave = 0.0
    if b * inverse < 60.0:
        wave = a * np.exp(-b * inverse) * (1.0 + h * np.cos(inverse))
    return 0.5 * WATER_KG_M3 * surface * v * s * (form * friction + allowance + wave)


@njit
def air_drag(wind, area):  # type: ignore[no-untyped-def]
    """Drag of the air [N] at a relative wind from ahead [m/s]."""
    return 0.5 * AIR_KG_M3 * 0.8 * area * wind * abs(wind)


HULLS = {
    hull.name: hull
    for hull in (
        Hull(
            name='tanker', length_m=130.0, volume_m3=11700.0, breadth_m=19.5, draught_m=6.2,
            surface_m2=3260.0, form=1.22, allowance=3.0e-4, wave=(3.4e-3, 0.068, 0.05),
            air_area_m2=350.0, added_mass=0.055, service_m_s=6.7, shafts=1, disc_m2=18.1,
            pitch_ratio=0.75, wake=0.30, thrust_deduction=0.20, turn_loss=1.4,
        ),
        Hull(
            name='ferry', length_m=90.0, volume_m3=3510.0, breadth_m=16.0, draught_m=4.2,
            surface_m2=1520.0, form=1.14, allowance=4.0e-4, wave=(7.6e-3, 0.11, 0.15),
            air_area_m2=230.0, added_mass=0.045, service_m_s=8.2, shafts=2, disc_m2=13.2,
            pitch_ratio=1.05, wake=0.12, thrust_deduction=0.12, turn_loss=1.5,
        ),
        Hull(
            name='workboat', length_m=23.0, volume_m3=140.0, breadth_m=6.8, draught_m=2.2,
            surface_m2=190.0, form=1.20, allowance=4.0e-4, wave=(1.25e-2, 0.13, 0.20),
            air_area_m2=40.0, added_mass=0.08, service_m_s=4.8, shafts=2, disc_m2=2.6,
            pitch_ratio=0.90, wake=0.14, thrust_deduction=0.13, turn_loss=1.6,
        ),
    )
}  # fmt: skip
