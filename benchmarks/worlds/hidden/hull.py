# SPDX-License-Identifier: Apache-2.0
"""The hulls: what their ship files state, and what their resistance really is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

GRAVITY = 9.81
AIR_DENSITY = 1.225
SHAPE_TERMS = 4  # cosines over the range of speeds
WAVE_FROUDE = (0.0, 0.10, 0.14, 0.18, 0.22, 0.26, 0.30, 0.36)


@dataclass(frozen=True, kw_only=True)
class Hull:
    """
    A ship as its ship file states it; SI units.

    Attributes
    ----------
    merchant
        The added mass is the published polynomial for merchant ships; else the
        constant `n_r`.
    froude
        At which the engine is stopped.
    friction_sd, wave_sd, n_r_sd, run_down_sd
        What the ship file states of its own uncertainty.
    """

    length_m: float
    breadth_m: float
    draught_m: float
    volume_m3: float
    surface_m2: float
    density_kg_m3: float
    viscosity_m2_s: float
    merchant: bool
    n_r: float
    frontal_m2: float
    air_coefficient: float
    diameter_m: float
    run_down_s: float
    form_factor: float
    allowance: float
    wave_coefficient: tuple[float, ...]
    froude: float
    shaft_rad_s: float
    friction_sd: float = 0.02
    wave_sd: float = 0.10
    n_r_sd: float = 0.02
    run_down_sd: float = 2.0

    @property
    def mass_kg(self) -> float:
        """Of the displaced water."""
        return self.density_kg_m3 * self.volume_m3

    @property
    def speed_m_s(self) -> float:
        """At which the engine is stopped."""
        return self.froude * float(np.sqrt(GRAVITY * self.length_m))

    @property
    def disc_m2(self) -> float:
        """Area of the propeller's disc."""
        return 0.25 * np.pi * self.diameter_m**2

    def friction_n(self, speed: Array) -> Array:
        """
        Return 0.5 rho S v^2 C_V [N] at speeds >= 0.
        """
        line = 0.075 / (np.log10(self.reynolds(speed)) - 2.0) ** 2
        return self.pressure(speed) * ((1.0 + self.form_factor) * line + self.allowance)

    def wave_n(self, speed: Array) -> Array:
        """
        Return 0.5 rho S v^2 C_W [N] at speeds >= 0.
        """
        table = PchipInterpolator(WAVE_FROUDE, self.wave_coefficient)
        froude = speed / np.sqrt(GRAVITY * self.length_m)
        return self.pressure(speed) * table(np.minimum(froude, WAVE_FROUDE[-1]))

    def air_n(self, relative: Array) -> Array:
        """
        Return the drag [N] of air that comes from ahead with a speed.
        """
        area = self.frontal_m2 * self.air_coefficient
        return 0.5 * AIR_DENSITY * area * relative * np.abs(relative)

    def still_n(self, speed: Array) -> Array:
        """
        Return the whole resistance [N] that the ship file states.
        """
        return self.friction_n(speed) + self.wave_n(speed) + self.air_n(speed)

    def pressure(self, speed: Array) -> Array:
        """
        Return 0.5 rho S v^2 [N].
        """
        return 0.5 * self.density_kg_m3 * self.surface_m2 * speed**2

    def reynolds(self, speed: Array) -> Array:
        """
        Return the Reynolds number of the length, 1e5 at least.
        """
        return np.maximum(speed * self.length_m / self.viscosity_m2_s, 1e5)

    def added_mass(self, speed: Array) -> Array:
        """
        Return n_r, the surge added mass over the mass.

        Notes
        -----
        S1 (2) where `merchant`.
        """
        if not self.merchant:
            return np.full_like(speed, self.n_r)
        psi = self.length_m / self.volume_m3 ** (1.0 / 3.0)
        froude = speed / np.sqrt(GRAVITY * self.length_m)
        at_rest = 0.2017 + psi * (-0.0321 + psi * 0.0010)
        slope = -0.4871 + psi * (0.1193 - psi * 0.0034)
        bend = 5.9608 + psi * (-1.3184 + psi * 0.0679)
        return at_rest + froude * (slope + froude * bend)

    def shape(self, speed: Array, amplitudes: Array) -> Array:
        """
        Return a smooth relative error of the resistance.

        Parameters
        ----------
        speed : (n,)
        amplitudes : (SHAPE_TERMS,)
            Of cosines with 1, 2, .. half waves over the speeds of a coastdown.
        """
        part = np.clip(speed / self.speed_m_s, 0.0, 1.2)
        waves = np.cos(np.pi * np.outer(part, np.arange(1, SHAPE_TERMS + 1)))
        return waves @ amplitudes

    def ship_file(self) -> str:
        """
        Return the ship file (YAML).
        """
        added = (
            {'model': 'merchant', 'sd': self.n_r_sd}
            if self.merchant
            else {'model': 'constant', 'value': self.n_r, 'sd': self.n_r_sd}
        )
        return yaml.safe_dump(
            {
                'name': 'hull',
                'length_m': self.length_m,
                'displaced_volume_m3': self.volume_m3,
                'breadth_m': self.breadth_m,
                'draught_m': self.draught_m,
                'wetted_surface_m2': self.surface_m2,
                'water': {
                    'density_kg_m3': self.density_kg_m3,
                    'kinematic_viscosity_m2_s': self.viscosity_m2_s,
                },
                'added_mass': added,
                'air': {
                    'frontal_area_m2': self.frontal_m2,
                    'drag_coefficient': self.air_coefficient,
                },
                'propeller': {'diameter_m': self.diameter_m, 'state_in_baseline': 'free'},
                'propulsion': {'run_down_s': self.run_down_s, 'sd': self.run_down_sd},
                'baseline': {
                    'source': 'model tests',
                    'form_factor': self.form_factor,
                    'correlation_allowance': self.allowance,
                    'wave_froude': list(WAVE_FROUDE),
                    'wave_coefficient': list(self.wave_coefficient),
                    'relative_sd': {'friction': self.friction_sd, 'wave': self.wave_sd},
                },
                'effects': [],
            },
            sort_keys=False,
        )


@dataclass(frozen=True)
class _Type:
    """Length, breadth, draught [m], block and wetted-surface coefficients, Froude number."""

    length_m: float
    breadth_m: float
    draught_m: float
    block: float
    froude: tuple[float, float]
    front: float  # height of the frontal area above water, over the draught
    n_r: float | None  # None: merchant polynomial


_TYPES = (
    _Type(150.0, 21.6, 8.6, 0.72, (0.17, 0.22), 2.2, None),  # cargo ship
    _Type(320.0, 58.0, 20.8, 0.81, (0.12, 0.15), 1.0, 0.05),  # tanker
    _Type(230.0, 32.2, 10.8, 0.65, (0.18, 0.25), 2.8, None),  # container ship
    _Type(120.0, 20.0, 6.0, 0.62, (0.19, 0.26), 3.0, 0.06),  # ferry
    _Type(85.0, 13.0, 5.2, 0.72, (0.16, 0.21), 1.8, None),  # coaster
    _Type(55.0, 11.0, 4.2, 0.58, (0.18, 0.25), 2.4, 0.07),  # research vessel
)


def draw_hull(rng: np.random.Generator) -> Hull:
    """
    Draw one of six types of ships, and vary it.
    """
    kind = _TYPES[int(rng.integers(len(_TYPES)))]
    size = rng.uniform(0.92, 1.08)
    length, breadth, draught = (
        size * side * rng.uniform(0.98, 1.02)
        for side in (kind.length_m, kind.breadth_m, kind.draught_m)
    )
    volume = length * breadth * draught * kind.block * rng.uniform(0.98, 1.02)
    # Mumford's formula
    surface = 1.7 * length * draught + volume / draught
    rise = rng.uniform(0.7, 1.3)
    waves = rise * np.array([0.0, 3e-5, 9e-5, 2.6e-4, 7.5e-4, 1.8e-3, 3.2e-3, 6e-3])
    froude = rng.uniform(*kind.froude)
    diameter = 0.65 * draught
    speed = froude * np.sqrt(GRAVITY * length)
    rounded = {
        'length_m': length,
        'breadth_m': breadth,
        'draught_m': draught,
        'surface_m2': surface,
        'volume_m3': volume,
        'diameter_m': diameter,
        'frontal_m2': kind.front * draught * breadth,
    }
    return Hull(
        **{name: float(f'{value:.4g}') for name, value in rounded.items()},
        density_kg_m3=1025.0,
        viscosity_m2_s=1.19e-6,
        merchant=kind.n_r is None,
        n_r=kind.n_r or 0.0,
        air_coefficient=round(rng.uniform(0.6, 0.9), 2),
        run_down_s=round(rng.uniform(5.0, 12.0), 1),
        form_factor=round(rng.uniform(0.12, 0.28), 3),
        allowance=round(rng.uniform(1e-4, 4e-4), 6),
        wave_coefficient=tuple(round(float(value), 8) for value in waves),
        froude=froude,
        # advance ratio of 0.7 behind a wake of 0.25
        shaft_rad_s=2.0 * np.pi * 0.75 * speed / (0.7 * diameter),
    )
