# SPDX-License-Identifier: Apache-2.0
"""
What may be hidden, and how large a crew would think it.

The ranges are those that manuals would give, wider than what the cases are drawn from; how often
each kind is hidden is as in the cases.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.worlds.hidden_b.cases import SEED, Known
from benchmarks.worlds.hidden_b.effects import FREE, LIBRARY
from benchmarks.worlds.hidden_b.plans import plans_of
from benchmarks.worlds.hidden_b.strangers import OUTSIDE

Names = tuple[str, ...]


@dataclass(frozen=True)
class Size:
    """
    A number that an effect's maker draws, and what a crew may expect of it.

    Attributes
    ----------
    low, high
        Of its size, between which the logarithm has the spread of an even chance.
    sign
        It may be of either sign.
    level
        The number itself has that spread, not its logarithm.
    """

    low: float
    high: float
    sign: bool = False
    level: bool = False

    def at(self, z: float, sign: float) -> float:
        """
        Return the number at a standard normal number.
        """
        low, high = (self.low, self.high) if self.level else np.log((self.low, self.high))
        value = 0.5 * (low + high) + (high - low) / 12.0**0.5 * z
        return float(value if self.level else sign * np.exp(value))


# in the order in which the maker draws them; a sign of its own goes into the size
SIZES: dict[str, tuple[Size, ...]] = {
    'fouling': (Size(0.03, 1.5),),
    'shallow_water': (Size(0.12, 0.68),),
    'towed_cable': (Size(0.02, 0.6),),
    'locked_propeller': (),
    'windmilling_propeller': (Size(0.2, 0.75), Size(0.015, 0.08)),
    'residual_thrust': (Size(0.03, 0.7), Size(0.1, 1.5)),
    'wind': (Size(2.0, 20.0, sign=True), Size(-1.3, 1.3, level=True)),
    'waves': (Size(0.02, 0.5), Size(1.0, 1.0, sign=True)),
    'current': (Size(0.015, 0.25, sign=True), Size(-0.09, 0.09, level=True)),
    'log_scale': (Size(0.015, 0.4, sign=True),),
    'log_offset': (Size(0.01, 0.15, sign=True),),
    'radar_scale': (Size(0.015, 0.2, sign=True),),
    'turning': (
        Size(0.01, 0.4),
        Size(0.1, 0.6),
        Size(0.1, 2.0),
        Size(-15.0, 15.0, level=True),
    ),
    'log_lag': (Size(0.02, 0.4),),
    'log_dead_band': (Size(0.2, 0.7),),
    'time_offset': (Size(0.015, 0.25, sign=True),),
    'current_change': (Size(0.015, 0.2, sign=True),),
    'added_mass': (Size(0.03, 0.4),),
    'displacement': (Size(0.03, 0.4, sign=True),),
}
_SIGN_FIRST = ('current', 'current_change', 'log_scale', 'log_offset', 'radar_scale',
               'time_offset', 'displacement')  # fmt: skip


def drawn(name: str, x: list[float]) -> list[float]:
    """
    Return all that an effect's maker draws, of the numbers that may vary.
    """
    if name in _SIGN_FIRST:
        return [1.0, *x]
    if name in ('wind', 'turning'):
        return [*x, 1.0]
    return x


@cache
def shares() -> Counter[Names]:
    """
    Return how many cases there are of each kind.
    """
    return Counter(
        ('unknown',) if set(names) & set(OUTSIDE) else tuple(sorted(names))
        for names, _ in plans_of(SEED)
    )


def free(names: Names) -> list[int]:
    """
    Return which sizes may vary.
    """
    sizes = [size for name in names for size in SIZES[name]]
    return [k for k, size in enumerate(sizes) if size.low != size.high]


def possible(known: Known) -> Iterator[str]:
    """
    Yield the names that a ship may have.
    """
    for name, (_, drives) in LIBRARY.items():
        needs = FREE if name in ('residual_thrust', 'locked_propeller') else drives
        if needs and known.screw.drive not in needs:
            continue
        if name != 'radar_scale' or known.kit.fix == 'radar':
            yield name
