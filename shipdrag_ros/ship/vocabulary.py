# SPDX-License-Identifier: Apache-2.0
"""What the file of an effect may say: channels, variables, names and units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from shipdrag_ros.parameter import Shape
from shipdrag_ros.ship.expression import PURE, Unit
from shipdrag_ros.ship.sections import GRAVITY_M_S2

SCOPES = ('hull', 'earth', 'sensor', 'run')
SHAPES = ('constant', 'power', 'step', 'ramp', 'hump', 'decay', 'periodic')
VARIABLES = {'speed': 'u', 'time': 't', 'heading': 'psi', 'date': 'd', 'depth': 'h'} | (
    dict.fromkeys(('relative_angle', 'shaft', 'wind', 'position'), '')
)
"""What a term goes by, and what a formula calls it; nothing: it cannot be simulated."""
_SPEED: Unit = (0.0, 1.0, -1.0)
_LENGTH: Unit = (0.0, 1.0, 0.0)
_TIME: Unit = (0.0, 0.0, 1.0)
_FORCE: Unit = (1.0, 1.0, -2.0)
_MASS: Unit = (1.0, 0.0, 0.0)
_GAIN: Unit = (0.0, 1.0, -2.0)
UNITS: Mapping[str, Unit] = {
    **dict.fromkeys(('1', 'rad'), PURE),
    'm': _LENGTH,
    **dict.fromkeys(('m2', 'm^2'), (0.0, 2.0, 0.0)),
    's': _TIME,
    'm/s': _SPEED,
    'm/s2': _GAIN,
    'kg': _MASS,
    'N': _FORCE,
}


class TermChannel(NamedTuple):
    """
    What something adds to.

    Attributes
    ----------
    most
        What a formula may be worth on a ship of 100 m, by its unit.
    by
        The variables by which it can be simulated; only by speed: also by nothing.
    during
        Those of u and t that may change it during a run.
    is_vector
    """

    most: Mapping[Unit, float]
    by: tuple[str, ...] = ('speed',)
    during: str = ''
    is_vector: bool = False


CHANNELS: Mapping[str, TermChannel] = {
    'force': TermChannel({_FORCE: 1e8}, ('speed', 'time', 'heading', 'date', 'depth'), 'ut'),
    'water': TermChannel({_SPEED: 50.0}, ('speed', 'time'), 't', is_vector=True),
    'air': TermChannel({_SPEED: 200.0}, is_vector=True),
    'log': TermChannel({_SPEED: 50.0, PURE: 10.0}, ('speed', 'time'), 'ut'),
    'ground': TermChannel({PURE: 10.0}),
    'inertia': TermChannel({PURE: 10.0, _MASS: 1e8}),
    'clock': TermChannel({_TIME: 1e4}),
    'filter': TermChannel({_TIME: 1e4}),
    'shaft': TermChannel({_SPEED: math.inf}),
    'depth': TermChannel({_LENGTH: 2e4}),
}
"""
Of a resistance; of the velocity of water and air, along the first run and to port of it; of what
the log reads too much, or its share of the speed; of the share by which distances over ground are
too long; of what n_r is larger by, or the mass; of the time by which the log is late, and that of
its filter; of the speed below which the flow does not turn the propeller; of the depth.
"""


class FormulaName(NamedTuple):
    """
    What a formula may hold.

    Attributes
    ----------
    unit
    usual
        On a ship of 100 m.
    ends
        Between what it lies on any ship, cut into boxes in which ranges are looked at.
    power
        Of the length of the ship, that the ends are times of.
    """

    unit: Unit
    usual: float
    ends: tuple[float, ...]
    power: int = 0


def _even(low: float, high: float, boxes: int) -> tuple[float, ...]:
    return tuple(np.linspace(low, high, boxes + 1).tolist())


NAMES: Mapping[str, FormulaName] = {
    'rho': FormulaName((1.0, -3.0, 0.0), 1025.0, (990.0, 1035.0)),
    'g': FormulaName(_GAIN, GRAVITY_M_S2, (GRAVITY_M_S2, GRAVITY_M_S2)),
    'L': FormulaName(_LENGTH, 100.0, (2.0, 10.0, 30.0, 100.0, 200.0, 400.0)),
    'nabla': FormulaName((0.0, 3.0, 0.0), 9000.0, (1e-4, 0.1), 3),
    'B_WL': FormulaName(_LENGTH, 18.0, (0.05, 0.6), 1),
    'T_M': FormulaName(_LENGTH, 7.0, (0.01, 0.3), 1),
    'D_P': FormulaName(_LENGTH, 5.0, (0.005, 0.2), 1),
    'n_r': FormulaName(PURE, 0.1, (0.0, 1.0)),
    'R_T': FormulaName(_FORCE, 3e5, (0.0, 1e10)),
    'R_V': FormulaName(_FORCE, 2e5, (0.0, 1e10)),
    'R_F': FormulaName(_FORCE, 2e5, (0.0, 1e10)),
    'u': FormulaName(_SPEED, 5.0, _even(0.0, 20.0, 16)),
    't': FormulaName(_TIME, 500.0, _even(0.0, 86400.0, 8)),
    't_end': FormulaName(_TIME, 1000.0, (1.0, 86400.0)),
    'psi': FormulaName(PURE, 0.3, (-math.pi, 0.0, math.pi)),
    'd': FormulaName(PURE, 20605.0, _even(0.0, 40000.0, 8)),
    'h': FormulaName(_LENGTH, 200.0, tuple(np.geomspace(0.5, 1e4, 17).tolist())),
    'pi': FormulaName(PURE, math.pi, (math.pi, math.pi)),
}
"""
Density, gravity; of the ship length, displaced volume, breadth, draught, diameter of the
propeller, n_r at half of her speed at the stop; her resistance at u in calm deep water without
that of the air, its viscous part and of that the friction (1 + k) C_F; speed through water, time
since the stop, that at the end of the record, yaw, days since 1970 and depth of the water at the
stop.
"""
OWN_UNITS = {name: each.unit for name, each in NAMES.items()}
BY_SPEED = ('R_T', 'R_V', 'R_F')
COUNTED_IN = {
    'V^(2/3)': 'nabla**(2/3)',
    'sqrt(g L)': 'sqrt(g*L)',
    'draught': 'T_M',
    'weight of the ship': 'rho*g*nabla',
}
"""What sizes may be counted in, so that one prior serves ships of all sizes."""
PRIORS = {
    'normal': Shape.NORMAL,
    'half-normal': Shape.HALF_NORMAL,
    'log-normal': Shape.LOG_NORMAL,
    'either-sign': Shape.EITHER_SIGN,
    'uniform': Shape.UNIFORM,
}
