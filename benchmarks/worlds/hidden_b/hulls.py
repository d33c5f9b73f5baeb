# SPDX-License-Identifier: Apache-2.0
"""
Hulls: their resistance, and what a ship file says of it.

Friction after Katsui et al. (2005). Form factor, wetted surface, allowance and waves of ships
after Holtrop (1984); waves of slender craft by Michell's integral for a parabolic hull.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.80665
SEA = (1025.0, 1.19e-6)
AIR = 1.225
GRID = 400
REACH = 1.7  # of the first speed; shallow water asks for more than she sails


@dataclass(frozen=True)
class Family:
    """
    What craft of a kind have in common: ranges to draw from.
    """

    name: str
    law: str
    length_m: tuple[float, float]
    slender: tuple[float, float]  # length over breadth
    flat: tuple[float, float]  # breadth over draught
    block: tuple[float, float]
    froude: tuple[float, float]
    windage: tuple[float, float]  # frontal area over breadth squared
    drives: tuple[str, ...]
    shafts: tuple[int, ...]


FAMILIES = (
    Family('tanker', 'holtrop', (170, 320), (5.5, 6.4), (2.5, 3.2), (0.79, 0.84), (0.13, 0.17),
           (0.35, 0.6), ('direct', 'locked', 'declutched'), (1,)),
    Family('container ship', 'holtrop', (120, 290), (6.3, 8.0), (2.6, 3.3), (0.58, 0.67),
           (0.19, 0.25), (0.8, 1.2), ('direct', 'locked', 'declutched'), (1,)),
    Family('ferry', 'holtrop', (70, 170), (5.0, 6.8), (3.2, 4.4), (0.53, 0.62), (0.20, 0.28),
           (0.9, 1.4), ('cpp', 'declutched', 'electric'), (1, 2, 2)),
    Family('coaster', 'holtrop', (60, 110), (5.0, 6.5), (2.2, 2.9), (0.66, 0.76), (0.17, 0.23),
           (0.5, 0.9), ('declutched', 'cpp', 'electric'), (1,)),
    Family('small craft', 'michell', (16, 32), (3.6, 4.8), (2.6, 3.4), (0.45, 0.52),
           (0.24, 0.31), (0.7, 1.0), ('declutched', 'electric'), (1, 2)),
    Family('yacht', 'michell', (10, 18), (3.2, 3.9), (4.0, 5.2), (0.38, 0.44), (0.24, 0.31),
           (0.8, 1.2), ('folding', 'declutched', 'locked'), (1,)),
)  # fmt: skip
WEIGHTS = (0.2, 0.2, 0.2, 0.2, 0.1, 0.1)


def katsui(reynolds: Array) -> Array:
    """
    Return the friction coefficient of a smooth plate, after Katsui.
    """
    log = np.log10(np.maximum(reynolds, 1e6))
    return 0.0066577 / (log - 4.3762) ** (0.042612 * log + 0.56725)


def ittc57(reynolds: Array) -> Array:
    """
    Return the friction coefficient of the line that ship files are stated in.
    """
    return 0.075 / (np.log10(np.maximum(reynolds, 1e5)) - 2.0) ** 2


@dataclass(frozen=True)
class Hull:
    """
    One hull, as she is.

    Attributes
    ----------
    speed_m_s
        Of the steady sailing before the stop.
    n_r
        Added mass in surge over her mass.
    grid_m_s, still_n
        Resistance, still-air drag included, without propeller.
    friction_n
        The part of it that scales with friction.
    drive
        How she is propelled, see `screws`.
    """

    family: str
    length_m: float
    breadth_m: float
    draught_m: float
    block: float
    volume_m3: float
    wetted_m2: float
    speed_m_s: float
    n_r: float
    frontal_m2: float
    air_drag: float
    diameter_m: float
    shafts: int
    drive: str
    form: float
    grid_m_s: Array
    still_n: Array
    friction_n: Array

    @property
    def mass_kg(self) -> float:
        """Mass."""
        return SEA[0] * self.volume_m3

    @property
    def time_s(self) -> float:
        """Momentum over resistance at the first speed."""
        resistance = float(np.interp(self.speed_m_s, self.grid_m_s, self.still_n))
        return self.mass_kg * self.speed_m_s / resistance

    @property
    def end_m_s(self) -> float:
        """Speed below which nobody looks."""
        return 0.05 * float(np.sqrt(GRAVITY * self.length_m))


def draw_hull(rng: np.random.Generator, drives: tuple[str, ...] = ()) -> Hull:
    """
    Draw a hull.

    Parameters
    ----------
    rng
    drives
        Those that will do; any by default.
    """
    fit = [not drives or bool(set(drives) & set(kind.drives)) for kind in FAMILIES]
    weights = np.array(WEIGHTS) * fit
    kind = FAMILIES[int(rng.choice(len(FAMILIES), p=weights / weights.sum()))]
    choices = [drive for drive in kind.drives if not drives or drive in drives]
    length = float(np.exp(rng.uniform(*np.log(kind.length_m))))
    breadth = length / rng.uniform(*kind.slender)
    draught = breadth / rng.uniform(*kind.flat)
    block = rng.uniform(*kind.block)
    volume = block * length * breadth * draught
    speed = rng.uniform(*kind.froude) * float(np.sqrt(GRAVITY * length))
    frontal = breadth**2 * rng.uniform(*kind.windage)
    air_drag = rng.uniform(0.6, 0.95)
    grid = np.linspace(0.0, REACH * speed, GRID)
    waves = holtrop if kind.law == 'holtrop' else michell
    form, wetted, allowance, wave = waves(length, breadth, draught, block, grid)
    form *= rng.uniform(0.92, 1.08)
    pressure = 0.5 * SEA[0] * wetted * grid**2
    friction = pressure * (1.0 + form) * katsui(grid * length / SEA[1])
    # appendages, and a transom that drags less once it runs dry
    transom = 0.5 * SEA[0] * rng.uniform(0.0, 0.02) * breadth * draught
    dry = grid / np.sqrt(GRAVITY * 0.15 * draught)
    rest = pressure * allowance + transom * grid**2 / (1.0 + (dry / 5.0) ** 2)
    air = 0.5 * AIR * frontal * air_drag * grid**2
    soeding = 2.7 * volume ** (2.0 / 3.0) / length**2
    return Hull(
        family=kind.name,
        length_m=length,
        breadth_m=breadth,
        draught_m=draught,
        block=block,
        volume_m3=volume,
        wetted_m2=wetted,
        speed_m_s=speed,
        n_r=min(float(soeding * rng.uniform(0.75, 1.15)), 0.2),
        frontal_m2=frontal,
        air_drag=air_drag,
        diameter_m=draught * rng.uniform(0.55, 0.72) / (1.0 if length > 40.0 else 1.3),
        shafts=int(rng.choice(kind.shafts)),
        drive=str(rng.choice(choices)),
        form=form,
        grid_m_s=grid,
        still_n=friction + rest + wave * rng.uniform(0.85, 1.15) + air,
        friction_n=friction,
    )


def holtrop(
    length: float, breadth: float, draught: float, block: float, speed: Array
) -> tuple[float, float, float, Array]:
    """
    Return form factor k, wetted surface, allowance and wave resistance, after Holtrop (1984).

    Without bulb and without immersed transom, centre of buoyancy amidships.
    """
    middle = min(0.995, 0.93 + 0.08 * block)
    prismatic = block / middle
    plane = 0.18 + 0.86 * prismatic
    volume = block * length * breadth * draught
    run = length * (1.0 - prismatic)
    slender = length**3 / volume
    wetted = (
        length * (2.0 * draught + breadth) * np.sqrt(middle)
        * (0.453 + 0.4425 * block - 0.2862 * middle - 0.003467 * breadth / draught
           + 0.3696 * plane)
    )  # fmt: skip
    form = (
        -0.07
        + 0.487118
        * (breadth / length) ** 1.06806
        * (draught / length) ** 0.46106
        * (length / run) ** 0.121563
        * slender**0.36486
        * (1.0 - prismatic) ** -0.604247
    )
    entrance = 1.0 + 89.0 * np.exp(
        -((length / breadth) ** 0.80856)
        * (1.0 - plane) ** 0.30484
        * (1.0 - prismatic) ** 0.6367
        * (run / breadth) ** 0.34574
        * (100.0 / slender) ** 0.16302
    )
    ratio = breadth / length
    c7 = ratio if ratio > 0.11 else 0.229577 * ratio ** (1.0 / 3.0)
    c1 = 2223105.0 * c7**3.78613 * (draught / breadth) ** 1.07961 * (90.0 - entrance) ** -1.37565
    c16 = (
        8.07981 * prismatic - 13.8673 * prismatic**2 + 6.984388 * prismatic**3
        if prismatic < 0.8
        else 1.73014 - 0.7067 * prismatic
    )
    m1 = 0.0140407 * length / draught - 1.75254 / slender ** (1.0 / 3.0) - 4.79323 * ratio - c16
    c15 = -1.69385 if slender < 512.0 else -1.69385 + (slender ** (1.0 / 3.0) - 8.0) / 2.36
    froude = np.maximum(speed, 1e-3) / np.sqrt(GRAVITY * length)
    m4 = 0.4 * c15 * np.exp(-0.034 * froude**-3.29)
    wavy = 1.446 * prismatic - 0.03 * length / breadth
    wave = (
        c1 * volume * SEA[0] * GRAVITY
        * np.exp(m1 * froude**-0.9 + m4 * np.cos(wavy / froude**2))
    )  # fmt: skip
    allowance = 0.006 * (length + 100.0) ** -0.16 - 0.00205
    return float(form), float(wetted), float(allowance), wave


def michell(
    length: float, breadth: float, draught: float, block: float, speed: Array
) -> tuple[float, float, float, Array]:
    """
    Return the same as `holtrop`, the waves by Michell's integral for a parabolic hull.

    Viscosity washes the humps out: averaged over six percent of the speed.
    """
    top = float(speed[-1])
    knots = np.linspace(0.25 * top, 1.06 * top, 90)
    wave = np.array([michell_integral(length, breadth, draught, float(v)) for v in knots])
    smooth = np.array(
        [np.average(wave, weights=np.exp(-0.5 * ((knots / v - 1) / 0.06) ** 2)) for v in knots]
    )
    wetted = length * (1.7 * draught + block * breadth) * 1.05
    found = 0.7 * np.interp(speed, knots, smooth)
    found = np.where(speed < knots[0], found * (speed / knots[0]) ** 6, found)
    return 0.12, wetted, 5e-4, found


def michell_integral(length: float, breadth: float, draught: float, speed: float) -> float:
    """
    Return the wave resistance of a parabolic hull on ideal water [N].
    """
    wave_number = GRAVITY / speed**2
    s = np.linspace(0.0, 3.5, 1200)
    secant = np.cosh(s)
    depth, weight = np.polynomial.legendre.leggauss(20)
    depth, weight = 0.5 * draught * (depth + 1.0), 0.5 * draught * weight
    fade = np.exp(-wave_number * secant[:, None] ** 2 * depth)
    down = fade @ (weight * (1.0 - (depth / draught) ** 2))
    k = wave_number * secant
    along = 2.0 * (np.sin(k * length / 2) / k**2 - length / 2 * np.cos(k * length / 2) / k)
    q = 4.0 * breadth / length**2 * along * down
    whole = np.trapezoid(q**2 * secant**2, s)
    return float(4.0 * SEA[0] * GRAVITY**2 / (np.pi * speed**2) * whole)
