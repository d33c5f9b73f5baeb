# SPDX-License-Identifier: Apache-2.0
"""A ship whose coastdown has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.ship import ConstantAddedMass, Propeller, Ship, TableBaseline

N_R = 0.08
DRAG_1_M = 3e-4


def quadratic(drag_1_m: float = DRAG_1_M, **changes: object) -> Ship:
    """Return a ship with r = drag_1_m v^2 and nothing else, of a table that PCHIP meets."""
    ship = Ship(
        length_m=150.0,
        displaced_volume_m3=20200.0,
        breadth_m=21.6,
        draught_m=8.6,
        propeller=Propeller(5.6, 'none'),
        added_mass=ConstantAddedMass(value=N_R),
    )
    speed = np.linspace(0.0, 10.0, 2001)
    table = TableBaseline(tuple(speed), tuple(drag_1_m * speed**2 * ship.mass_kg), 0.01)
    return replace(ship, baseline=table, **changes)
