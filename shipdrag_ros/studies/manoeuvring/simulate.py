# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres of many ships in one compiled call."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.manoeuvring.kernel import STATES, Helm, HullModel, follow_columns
from shipdrag_ros.studies.manoeuvring.manoeuvre import Manoeuvre, Motions
from shipdrag_ros.studies.manoeuvring.ship import FORM, SteeredShip

_STEP_S = 0.5  # of the integration; the rudder, quickest of all, is followed exactly
_LONGEST_APPROACH_S = 3600.0


def steer(
    ship: SteeredShip,
    manoeuvre: Manoeuvre,
    derivatives: Float64 | None = None,
    *,
    sample_s: float = 0.5,
    samples: int = 1200,
    control_s: float = 0.1,
    approach_s: float = 0.0,
) -> Motions:
    """
    Simulate a manoeuvre of k ships that differ in their derivatives.

    Parameters
    ----------
    ship
        What they have in common; they begin in steady sailing at its speed.
    manoeuvre
        Rudder angles [rad] and headings [rad] at which they are ordered.
    derivatives : (k, 40), optional
        In the order of `FORM`; those of the ship alone by default.
    sample_s, samples
        How often and how many times to look at the motion, from the first
        order on.
    control_s
        How often the helmsman looks at the heading and orders the rudder; 0:
        he reverses it at the very moment.
    approach_s
        How long the rudder is amidships before the first order, to the nearest
        step of 0.5 s at most; the propeller alone turns the ship meanwhile.

    Returns
    -------
    Motions
        Not finite from where a ship cannot be simulated, as after a change
        of derivatives that makes her accelerate without end.

    Raises
    ------
    SimulationError
        If the rudder does not go as far as is ordered, the times do not fit each
        other, or the derivatives the form.

    Notes
    -----
    S3; equations and rudder machine after Fossen (1994): forces are polynomials
    in the dimensionless change of speed, sway, yaw rate and rudder angle, times
    powers of the momentary speed and the length.

    Examples
    --------
    >>> import math
    >>> from shipdrag_ros.studies.manoeuvring.manoeuvre import turn
    >>> from shipdrag_ros.studies.manoeuvring.ship import mariner
    >>> from shipdrag_ros.studies.manoeuvring.simulate import steer
    >>> ship = mariner()
    >>> motions = steer(ship, turn(math.radians(20.0)))
    >>> motions.position_m.shape
    (1, 1200, 2)
    """
    limit_rad = ship.rudder.limit_rad
    if not 0.0 < manoeuvre.rudder_rad <= limit_rad * (1.0 + 1e-9):
        raise SimulationError(
            f'manoeuvre {manoeuvre.name!r}, expected more than 0 and at most '
            f'{np.degrees(limit_rad):g} degrees of rudder, which is as far as it goes'
        )
    looks = round(sample_s / control_s) if control_s > 0.0 else 1
    look_s = control_s or sample_s
    # written so that NaN fails
    if not (0.0 < sample_s < np.inf and looks >= 1 and np.isclose(looks * look_s, sample_s)):
        raise SimulationError(
            f'sample_s is {sample_s!r} and control_s {control_s!r}, expected a sample after a '
            'whole number of looks, or 0 for control_s'
        )
    if not 0.0 <= approach_s <= _LONGEST_APPROACH_S:
        raise SimulationError(
            f'approach_s is {approach_s!r}, expected 0 to {_LONGEST_APPROACH_S:g} s'
        )
    if samples < 2:
        raise SimulationError(f'samples is {samples!r}, expected 2 or more')
    table = np.atleast_2d(ship.values if derivatives is None else derivatives)
    if table.ndim != 2 or table.shape[1] != len(FORM):
        raise SimulationError(
            f'derivatives have the shape {table.shape}, expected (k, {len(FORM)})'
        )
    steps = max(1, int(np.ceil(look_s / _STEP_S - 1e-9)))
    helm = Helm(
        manoeuvre.rudder_rad,
        manoeuvre.reverse_rad,
        manoeuvre.first.sign,
        attentive=control_s == 0.0,
        step_s=look_s / steps,
        approach=round(approach_s * steps / look_s),
    )
    paths = np.empty((len(table), samples, STATES))
    follow_columns(
        _hull(ship),
        helm,
        np.ascontiguousarray(table, np.float64),
        steps,
        looks,
        paths,
    )
    paths[..., 0] += ship.speed_m_s
    return Motions(
        sample_s * np.arange(samples, dtype=np.float64),
        paths[..., :3],
        paths[..., 3:5],
        paths[..., 5],
        -paths[..., 6],
    )


def _hull(ship: SteeredShip) -> HullModel:
    added, machine = ship.inertial, ship.rudder
    inertia = np.array(
        [
            [ship.mass - added.Yvdot, ship.mass * ship.gravity_centre - added.Yrdot],
            [ship.mass * ship.gravity_centre - added.Nvdot, ship.yaw_inertia - added.Nrdot],
        ]
    )
    (sway_by_y, sway_by_n), (yaw_by_y, yaw_by_n) = np.linalg.inv(inertia).tolist()
    return HullModel(
        length_m=ship.length_m,
        speed_m_s=ship.speed_m_s,
        surge_inertia=ship.mass - added.Xudot,
        sway_by_y=sway_by_y,
        sway_by_n=sway_by_n,
        yaw_by_y=yaw_by_y,
        yaw_by_n=yaw_by_n,
        rate_rad_s=machine.rate_rad_s,
        lag_s=machine.lag_s,
    )
