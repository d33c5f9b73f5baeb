# SPDX-License-Identifier: Apache-2.0
"""
A ship that is steered: derivatives of her hull, and her rudder machine.

The values are data. Which derivatives there are is the form of the model and
stands in `FORM`, in the order in which the compiled integration takes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.strict_yaml import load

# powers of the change of speed u, sway v, yaw rate r and rudder d, as the names spell them
FORM = (
    *('Xu', 'Xuu', 'Xuuu', 'Xvv', 'Xrr', 'Xdd', 'Xudd', 'Xrv', 'Xvd', 'Xuvd'),
    *('Yv', 'Yr', 'Yvvv', 'Yvvr', 'Yvu', 'Yru', 'Yd', 'Yddd', 'Yud', 'Yuud', 'Yvdd', 'Yvvd'),
    *('Y0', 'Y0u', 'Y0uu'),
    *('Nv', 'Nr', 'Nvvv', 'Nvvr', 'Nvu', 'Nru', 'Nd', 'Nddd', 'Nud', 'Nuud', 'Nvdd', 'Nvvd'),
    *('N0', 'N0u', 'N0uu'),
)


@dataclass(frozen=True)
class RudderMachine:
    """
    How the rudder follows an order.

    Attributes
    ----------
    limit_rad, rate_rad_s
        Largest angle and rate.
    lag_s
        Time constant below that rate.
    """

    limit_rad: float
    rate_rad_s: float
    lag_s: float


@dataclass(frozen=True)
class AddedMasses:
    """
    The five inertial derivatives: surge, sway force and yaw moment by accelerations.
    """

    Xudot: float
    Yvdot: float
    Yrdot: float
    Nvdot: float
    Nrdot: float


@dataclass(frozen=True, kw_only=True)
class SteeredShip:
    """
    Abkowitz's whole-ship model in surge, sway and yaw.

    Attributes
    ----------
    name, source
        Of the ship, and where the values come from.
    length_m
    speed_m_s
        That the derivatives are about.
    mass, yaw_inertia
    gravity_centre
        Ahead of amidships.
    rudder, inertial
    viscous
        Forces on the hull and the rudder, by the names of `FORM`.
    multiples
        Derivatives that are exact multiples of another.

    Notes
    -----
    S3; Fossen (1994). All but length, speed and rudder machine are pure numbers of the prime
    system.
    """

    name: str
    source: str
    length_m: float
    speed_m_s: float
    mass: float
    yaw_inertia: float
    gravity_centre: float
    rudder: RudderMachine
    inertial: AddedMasses
    viscous: Mapping[str, float]
    multiples: Mapping[str, str]

    @property
    def values(self) -> Float64:
        """The viscous derivatives (40,), in the order of `FORM`."""
        return np.array([self.viscous[name] for name in FORM])

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Derivatives that are one measurement, under the first of each."""
        return tuple(
            (name, *(other for other in FORM if self.multiples.get(other) == name))
            for name in FORM
            if name not in self.multiples
        )


_FORCES = {'X': 'surge force', 'Y': 'sway force', 'N': 'yaw moment'}
_MOTIONS = {'u': 'change of speed', 'v': 'sway', 'r': 'yaw', 'd': 'rudder'}


def meaning(name: str) -> str:
    """
    Say in words what a derivative of the form is.

    Parameters
    ----------
    name
        One of `FORM`: the force, and the powers of the motions that it grows with.

    Examples
    --------
    >>> from shipdrag_ros.studies.manoeuvring.ship import meaning
    >>> meaning('Yvvr')
    'sway force by sway² x yaw'
    """
    force, motions = _FORCES[name[0]], name[1:].removeprefix('0')
    powers = {letter: motions.count(letter) for letter in dict.fromkeys(motions)}
    product = ' x '.join(
        _MOTIONS[letter] + {1: '', 2: '²', 3: '³'}[power] for letter, power in powers.items()
    )
    if name[1:2] != '0':
        return f'{force} by {product}'
    straight = f'{force} with the rudder amidships, sailing straight'
    return f'{straight}, by {product}' if product else straight


@cache
def mariner() -> SteeredShip:
    """
    Return the Mariner-class ship that comes with the package.
    """
    file = files('shipdrag_ros').joinpath('data', 'mariner.yaml')
    data = load(file.read_text(encoding='utf-8'))
    rudder, inertial = RudderMachine(**data.pop('rudder')), AddedMasses(**data.pop('inertial'))
    return SteeredShip(rudder=rudder, inertial=inertial, **data)
