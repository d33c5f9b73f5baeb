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
from math import pi
from typing import Any

import numpy as np

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.fields import (
    Kind,
    Problems,
    declare,
    keys_of,
    named,
    number,
    parse,
    read_keys,
    section,
    text,
)
from shipdrag_ros.samples import Float64

# powers of the change of speed u, sway v, yaw rate r and rudder d, as the names spell them
FORM = (
    *('Xu', 'Xuu', 'Xuuu', 'Xvv', 'Xrr', 'Xdd', 'Xudd', 'Xrv', 'Xvd', 'Xuvd'),
    *('Yv', 'Yr', 'Yvvv', 'Yvvr', 'Yvu', 'Yru', 'Yd', 'Yddd', 'Yud', 'Yuud', 'Yvdd', 'Yvvd'),
    *('Y0', 'Y0u', 'Y0uu'),
    *('Nv', 'Nr', 'Nvvv', 'Nvvr', 'Nvu', 'Nru', 'Nd', 'Nddd', 'Nud', 'Nuud', 'Nvdd', 'Nvvd'),
    *('N0', 'N0u', 'N0uu'),
)
_PURE = number(-10.0, 10.0)


@dataclass(frozen=True)
class RudderMachine:
    """
    How the rudder follows an order: with a lag, a largest rate, a limit.
    """

    limit_rad: float = declare(number(0.0, pi / 2.0, 'rad'), 'largest angle')
    rate_rad_s: float = declare(number(1e-4, 10.0, 'rad/s'), 'largest rate')
    lag_s: float = declare(number(0.1, 100.0, 's'), 'time constant below that rate')


@dataclass(frozen=True)
class AddedMasses:
    """
    The five inertial derivatives.
    """

    Xudot: float = declare(_PURE, 'surge force by surge acceleration')
    Yvdot: float = declare(_PURE, 'sway force by sway acceleration')
    Yrdot: float = declare(_PURE, 'sway force by yaw acceleration')
    Nvdot: float = declare(_PURE, 'yaw moment by sway acceleration')
    Nrdot: float = declare(_PURE, 'yaw moment by yaw acceleration')


def _derivatives() -> Kind:
    """Expect a value for each derivative of the form."""
    values = named(_PURE)

    def read(value: object, path: str, problems: Problems) -> Any:
        found = values.read(value, path, problems)
        if isinstance(found, dict) and set(found) != set(FORM):
            wrong = ', '.join(sorted(set(found) ^ set(FORM)))
            problems.append(f'{path}: {wrong} missing or unknown, expected {", ".join(FORM)}')
        return found

    return Kind(read, f'a value for each of {", ".join(FORM)}')


@dataclass(frozen=True, kw_only=True)
class SteeredShip:
    """
    Abkowitz's whole-ship model in surge, sway and yaw.

    All but length, speed and rudder machine are pure numbers of the prime
    system.

    Notes
    -----
    S3; Fossen (1994).
    """

    name: str = declare(text(), 'name of the ship')
    source: str = declare(text(), 'where the values come from')
    length_m: float = declare(number(0.5, 500.0, 'm'), 'length')
    speed_m_s: float = declare(number(0.1, 40.0, 'm/s'), 'speed that the derivatives are about')
    mass: float = declare(number(1e-5, 1.0), 'mass')
    yaw_inertia: float = declare(number(1e-6, 1.0), 'moment of inertia in yaw')
    gravity_centre: float = declare(number(-0.5, 0.5), 'centre of gravity, ahead of amidships')
    rudder: RudderMachine = declare(section(RudderMachine), 'rudder machine')
    inertial: AddedMasses = declare(section(AddedMasses), 'added masses')
    viscous: Mapping[str, float] = declare(
        _derivatives(), 'forces on the hull and the rudder', hashed=False
    )
    multiples: Mapping[str, str] = declare(
        named(text()), 'derivatives that are exact multiples of another', hashed=False
    )

    @classmethod
    def from_yaml(cls, content: str, *, subject: str) -> SteeredShip:
        """
        Read the text of a model file; `subject` names it in errors.

        Raises
        ------
        ShipFileError
            Naming every problem of the text at once.
        """
        problems: list[str] = []
        data = parse(content, subject=subject, error=ShipFileError)
        accepted = read_keys(keys_of(cls), data, '', problems)
        if problems:
            raise ShipFileError(subject, problems)
        return cls(**accepted)

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
    content = files('shipdrag_ros').joinpath('data', 'mariner.yaml').read_text(encoding='utf-8')
    return SteeredShip.from_yaml(content, subject='mariner.yaml')
