# SPDX-License-Identifier: Apache-2.0
"""
The one law of the hull, r(u) = (1 + theta_f) r_f + (1 + theta_w) r_w + s(u), as tables.

r_f and r_w are those of the ship file; without a baseline the same two parts from length and
volume alone, whose waves have humps. s is a spline relative to r, orthogonal to both parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.motion import Forces
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, CoefficientSd, Ship
from shipdrag_ros.ship.model import (
    USUAL_FORM_FACTOR,
    drag_n,
    friction_n,
    surface_m2,
    viscous_n,
)
from shipdrag_ros.ship.sections import TableBaseline

_NODES = 97  # of the grid of speeds
ABOVE = 1.25  # of the highest speed that a fit may try
_SPLINE_FROUDE, _MOST = 0.02, 14  # spacing and largest number of splines
_UNIT = 0.2  # size of s by itself over that of what both parts leave of it, from Fr 0.05 to 0.2
_ALIKE, _OWN = 5.0, 0.02  # spacings over which neighbours are alike, and the part that is not
_NEGLIGIBLE = 0.03  # size of a column, of the largest
# without a baseline C_W = _WAVE (Fr / _WAVE_FROUDE)^4, which falls beyond the hump at _HUMP_FROUDE
_WAVE, _WAVE_FROUDE, _WAVE_POWER = 8e-4, 0.22, 4
_HUMP_FROUDE, _HUMP_POWER = 0.5, 8
_HIGHEST_FROUDE = 1.0  # of the same as a table, for simulations
HELD, WIND, DEPTH = 'held_force', 'wind', 'depth'
"""Names of influences."""


class InfluenceState(NamedTuple):
    """
    Probability of a state of an influence, and what it says of its columns (w,).
    """

    chance: float
    mean: Float64
    sd: Float64


class Influence(NamedTuple):
    """
    What wind, depth or a force from outside adds to r, and is no part of the hull.

    Attributes
    ----------
    name
        Of the cause.
    known : (m,)
        Without an unknown [m/s^2].
    columns : (w, m)
    states
    inertia
        What it adds to 1 + n_r.
    """

    name: str
    known: Float64
    columns: Float64
    states: tuple[InfluenceState, ...]
    inertia: float = 0.0


@dataclass(frozen=True)
class HullLaw:
    """
    The law over a grid of speeds.

    Attributes
    ----------
    speed_m_s : (m,)
    parts : (2, m)
        r_f and r_w [m/s^2].
    shapes : (k, m)
        Columns of s per unit size [m/s^2].
    humps : (h, m)
        Columns of the humps of the wave part, per unit of it [m/s^2]; none where a
        baseline states that part.
    dry : (d, m)
        A constant force and one in proportion to the speed, as large as the generic hull's
        at the highest speed; none where a baseline is stated.
    stated
        Whether the ship file states a baseline.
    """

    speed_m_s: Float64
    parts: Float64
    shapes: Float64
    humps: Float64
    dry: Float64
    stated: bool

    @classmethod
    def of(cls, ship: Ship, low_m_s: float, top_m_s: float) -> HullLaw:
        """
        Tabulate the law.

        Parameters
        ----------
        ship
        low_m_s, top_m_s
            Speeds of the run, over which s is spread.
        """
        speed = np.linspace(0.0, ABOVE * top_m_s, _NODES)
        stated = ship.baseline is not None
        parts = parts_n(ship, speed) / ship.mass_kg
        spacing = _SPLINE_FROUDE * float(ship.speed(1.0))
        shapes, humps = _shapes(speed, spacing, parts, low_m_s, top_m_s)
        at_top = np.interp(top_m_s, speed, parts.sum(axis=0))
        dry = at_top * np.stack([np.ones(_NODES), speed / top_m_s])
        none = 0 if stated else None
        return cls(speed, parts, shapes, humps[:none], dry[:none], stated)

    def forces(self, ship: Ship, tau_s: float, influences: Sequence[Influence] = ()) -> Forces:
        """
        Return what the motion takes.

        Parameters
        ----------
        ship
        tau_s
            Of the shaft; see `motion.Forces`.
        influences
            What else acts.
        """
        step = float(self.speed_m_s[1])
        others = [each.columns for each in influences]
        columns = np.concatenate([self.parts, self.shapes, self.humps, self.dry, *others])
        columns[0] += wave_with_friction(ship) * self.parts[1]

        def with_slope(value: Float64) -> Float64:
            return np.stack([value, np.gradient(value, step, axis=-1, edge_order=2)])

        known = sum((each.known for each in influences), self.parts.sum(axis=0))
        inertia = 1.0 + sum(each.inertia for each in influences)
        return Forces(
            step,
            with_slope(known),
            with_slope(columns),
            with_slope(inertia + ship.n_r(self.speed_m_s)),
            tau_s,
        )


def parts_n(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return friction and wave part (2, m) of the ship file, or of her length and volume [N].
    """
    return (_generic if ship.baseline is None else _stated)(ship, speed_m_s)


def _inside(ship: Ship, speed: Float64) -> Float64:
    """Return the nearest speeds of which the baseline is stated, above 0."""
    low, high = ship.baseline_range_m_s
    return np.clip(speed, max(low, 1e-3 * float(speed.max())), high)


def stated_r(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return r of a baseline [m/s^2]; outside of what it states with the square of the speed.
    """
    inside = _inside(ship, speed_m_s)
    result: Float64 = ship.resistance_n(inside) / ship.mass_kg * (speed_m_s / inside) ** 2
    return result


def _stated(ship: Ship, speed: Float64) -> Float64:
    """Return friction and wave part [N]; outside the tables with the square of the speed."""
    inside = _inside(ship, speed)
    total = ship.resistance_n(inside)
    if isinstance(ship.baseline, TableBaseline):
        # a table has no parts: its one scale is that of the friction
        parts = np.stack([total, np.zeros_like(total)])
    else:
        wave = total - viscous_n(ship, inside) - ship.air_drag_n(inside)
        parts = np.stack([total - wave, wave])
    result: Float64 = parts * (speed / inside) ** 2
    return result


def _generic(ship: Ship, speed: Float64) -> Float64:
    wave = _usual_wave(ship.froude(speed))
    return np.stack([friction_n(ship, speed), wave * drag_n(ship, surface_m2(ship), speed)])


def _usual_wave(froude: Float64) -> Float64:
    """Return C_W without a baseline."""
    rising = _WAVE * (froude / _WAVE_FROUDE) ** _WAVE_POWER
    result: Float64 = rising / (1.0 + (froude / _HUMP_FROUDE) ** _HUMP_POWER)
    return result


def wave_with_friction(ship: Ship) -> float:
    """
    Return by how much the wave part is off where the friction is, both relative, as stated.
    """
    base = ship.baseline
    if not isinstance(base, CoefficientBaseline) or base.relative_sd.correlation == 0.0:
        return 0.0
    sd = base.relative_sd
    return sd.correlation * sd.wave / sd.friction if sd.friction > 0.0 else 0.0


def usual_baseline(ship: Ship) -> Ship:
    """
    Return a ship with a baseline down to rest.

    Where her file states none, it has the two parts of any hull; below the lowest speed of one
    that it states, r goes with the square of the speed, as the law of the hull has it.
    """
    base, part = ship.baseline, np.linspace(0.0, 0.9, 10)
    if isinstance(base, TableBaseline) and base.speed_m_s[0] > 0.0:
        speed, force = base.speed_m_s, base.resistance_n
        base = replace(
            base,
            speed_m_s=(*(part * speed[0]).tolist(), *speed),
            resistance_n=(*(part**2 * force[0]).tolist(), *force),
        )
    elif isinstance(base, CoefficientBaseline) and base.wave_froude[0] > 0.0:
        wave = base.wave_coefficient
        base = replace(
            base, wave_froude=(0.0, *base.wave_froude), wave_coefficient=(wave[0], *wave)
        )
    if base is not None:
        return replace(ship, baseline=base)
    froude = np.linspace(0.0, _HIGHEST_FROUDE, 13)
    base = CoefficientBaseline(
        USUAL_FORM_FACTOR,
        0.0,
        tuple(froude.tolist()),
        tuple(_usual_wave(froude).tolist()),
        CoefficientSd(priors.GENERIC_FRICTION.sd, priors.GENERIC_WAVE.sd),
    )
    return replace(ship, baseline=base, wetted_surface_m2=surface_m2(ship))


def _shapes(
    speed: Float64, spacing: float, parts: Float64, low_m_s: float, top_m_s: float
) -> tuple[Float64, Float64]:
    """
    Return columns of s, and of the humps of the wave part: cubic B-splines, less both parts.

    Neighbours of s are alike; humps stand by themselves, in proportion to the wave part.
    """
    total = np.maximum(parts.sum(axis=0), 1e-12)
    first_m_s, last_m_s = 0.9 * low_m_s, 1.05 * top_m_s
    inside = (speed >= first_m_s) & (speed <= last_m_s)
    spacing = max(spacing, (last_m_s - first_m_s) / (_MOST - 1))
    count = int(np.ceil((last_m_s - first_m_s) / spacing)) + 1
    d = np.abs((speed - first_m_s) / spacing - np.arange(count)[:, None])
    splines = np.where(d < 1.0, 2 / 3 - d**2 + d**3 / 2, np.maximum(2.0 - d, 0.0) ** 3 / 6)
    apart = np.arange(count)[:, None] - np.arange(count)
    alike = np.exp(-0.5 * (apart / _ALIKE) ** 2) + _OWN * np.eye(count)
    rooted = np.asarray(np.linalg.cholesky(alike).T @ splines, np.float64) / _UNIT
    humps = splines * (parts[1] / total)
    shares = parts / total
    return _columns(rooted, shares, inside) * total, _columns(humps, shares, inside) * total


def _columns(shapes: Float64, shares: Float64, inside: NDArray[np.bool_]) -> Float64:
    """Return the same sums of squares by few columns, less what both parts say."""
    shares = shares[shares.any(axis=1)]
    of_parts = np.linalg.lstsq(shares[:, inside].T, shapes[:, inside].T, rcond=None)[0]
    shapes = shapes - of_parts.T @ shares
    # a flat end beyond the speeds of the run: nothing is known there
    first, last = np.flatnonzero(inside)[[0, -1]]
    shapes = shapes[:, np.clip(np.arange(shapes.shape[1]), first, last)]
    left, size, _ = np.linalg.svd(shapes, full_matrices=False)
    kept = size > _NEGLIGIBLE * size[0]
    result: Float64 = left[:, kept].T @ shapes
    return result
