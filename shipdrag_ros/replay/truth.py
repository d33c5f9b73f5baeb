# SPDX-License-Identifier: Apache-2.0
"""The true curve of a simulation, as its bag carries it in `truth.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import short_repr
from shipdrag_ros.errors import BagError
from shipdrag_ros.samples import Float64

ATTACHMENT = 'truth.yaml'


@dataclass(frozen=True)
class TrueCurve:
    """
    Specific resistance that the simulation used, ascending in speed.

    Attributes
    ----------
    speed_m_s : (m,)
    resistance_m_s2 : (m,)
        r = R / m, retarding positive [m/s^2 = N/kg].
    settings
        What the simulation was asked for, names carrying their units.
    """

    __repr__ = short_repr

    speed_m_s: Float64
    resistance_m_s2: Float64
    settings: Mapping[str, Any]

    def at(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return r at these speeds [m/s^2]; NaN outside the curve.
        """
        return np.interp(
            np.asarray(speed_m_s, np.float64),
            self.speed_m_s,
            self.resistance_m_s2,
            left=np.nan,
            right=np.nan,
        )

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back, digit for digit.
        """
        return strict_yaml.dump(
            {
                'settings': dict(self.settings),
                'speed_m_s': self.speed_m_s.tolist(),
                'resistance_m_s2': self.resistance_m_s2.tolist(),
            },
        )

    @classmethod
    def from_yaml(cls, text: str, *, subject: str) -> TrueCurve:
        """
        Read the text of a `truth.yaml`.

        Raises
        ------
        BagError
            If it is not one.
        """
        try:
            values = strict_yaml.load(text)
            speed = np.array(values['speed_m_s'], np.float64)
            resistance = np.array(values['resistance_m_s2'], np.float64)
            settings = dict(values['settings'])
        except (KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{subject}: {ATTACHMENT} cannot be read ({error}); '
                'write the bag anew with `shipdrag simulate`'
            ) from error
        if speed.ndim != 1 or speed.shape != resistance.shape or not np.all(np.diff(speed) > 0):
            raise BagError(
                f'{subject}: {ATTACHMENT} has {speed.shape} speeds and {resistance.shape} '
                'resistances, expected as many of each, the speeds ascending'
            )
        return cls(speed, resistance, settings)
