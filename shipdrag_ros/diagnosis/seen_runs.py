# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says of the runs that it rests on, and of those of before."""

from __future__ import annotations

from dataclasses import dataclass

DOUBTED = 0.5  # probability that what was stated is wrong, from which the data contradict it


@dataclass(frozen=True)
class SeenRun:
    """
    A run that a diagnosis rests on.

    Attributes
    ----------
    name
        For the user.
    time_ns
        When it was stopped; without a coastdown, when the record begins [ns since the
        epoch].
    """

    name: str
    time_ns: int


@dataclass(frozen=True)
class CarriedEffect:
    """
    An effect that an earlier diagnosis found, and what has become of it.

    Attributes
    ----------
    name
    probability
        That it was there, then.
    stays
        That it is there still and as it was, if it was, before the runs at hand.
    now
        That it is there, with the runs at hand.
    resized
        Whether it is there, if it is, of another size or sign than was found then.
    """

    name: str
    probability: float
    stays: float
    now: float
    resized: bool = False

    @property
    def contradicted(self) -> bool:
        """Whether the runs at hand contradict it, or its size."""
        expected = self.probability * self.stays > DOUBTED
        return expected and (self.resized or self.now < DOUBTED)


@dataclass(frozen=True)
class WeighedEarlier:
    """
    An earlier diagnosis, and what of it counts.

    Attributes
    ----------
    name
        Of its file.
    runs
        That it holds.
    effects
        Of hull and instruments, that count; empty: it held none of them probable.
    unused
        What of it does not count, and why, a sentence each.
    used
        Whether it counts at all.
    before
        Runs of the diagnoses that were given to it, which it holds already.
    """

    name: str
    runs: tuple[SeenRun, ...]
    effects: tuple[CarriedEffect, ...] = ()
    unused: tuple[str, ...] = ()
    used: bool = True
    before: tuple[SeenRun, ...] = ()
