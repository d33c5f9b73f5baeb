# SPDX-License-Identifier: Apache-2.0
"""
What an estimator returns: the tuple (8) of S1, owning its uncertainty.

Also the range in which its curve r(v) may be used, and what it says at its end.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.display import short_repr
from shipdrag_ros.posterior.weather import Reference
from shipdrag_ros.samples import Float64, Int64, kind_of

SIGNIFICANT = 2.0  # fall or rise of dr/dFr, in its standard deviations


class FroudeMax(Enum):
    """How the upper end of the valid range was found."""

    INFLECTION = 'inflection'  # a maximum of dr/dFr whose fall is significant
    BRANCH_TOP = 'branch_top'  # no such maximum: the top of the monotone branch


@dataclass(frozen=True)
class ForceCurve:
    """
    Specific resistance against speed, ascending in speed, of one coastdown or several together.

    Attributes
    ----------
    speed_m_s : (m,)
        Speed through water, strictly ascending [m/s].
    resistance_m_s2 : (m,)
        Specific resistance r, retarding positive [m/s^2 = N/kg].
    sigma_m_s2 : (m,)
        Standard deviation of r, S1 (13), the error of n_r included [m/s^2].
    sigma_repeatable_m_s2 : (m,)
        The same without the error of n_r, which repeats from run to run.
    froude : (m,)
        speed / sqrt(g L).
    """

    __repr__ = short_repr

    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64
    sigma_repeatable_m_s2: Float64
    froude: Float64

    def __len__(self) -> int:
        return len(self.speed_m_s)


@dataclass(frozen=True)
class ResistanceCurve(ForceCurve):
    """
    That of one coastdown.

    Attributes
    ----------
    slope, slope_sigma : (m,)
        dr/dFr and its standard deviation [m/s^2].
    by_current_1_s : (m,)
        Covariance of r and the current found along the track, over the variance of the current.
    """

    __repr__ = short_repr

    slope: Float64
    slope_sigma: Float64
    by_current_1_s: Float64

    def between(self, froude_min: float, froude_max: float) -> ResistanceCurve:
        """
        Return the part with froude_min <= Fr <= froude_max.
        """
        keep = (self.froude >= froude_min) & (self.froude <= froude_max)
        return ResistanceCurve(**{name: each[keep] for name, each in vars(self).items()})


@dataclass(frozen=True)
class OrderTrial:
    """One row of the order table: S1 (11) at one number of coefficients."""

    order: int
    variance: float  # s^2 of the problem solved
    variance_speed: float  # of the speed channel, (m/s)^2; NaN if not used
    variance_position: float  # of the position channel, m^2; NaN if not used
    f: float  # F of the step from the order before; NaN at the first
    p: float  # its probability by chance


@dataclass(frozen=True)
class Track:
    """
    One channel as measured and as fitted, for pictures and for residuals.

    Attributes
    ----------
    time_ns : (n,) int64
    measured, fitted : (n,)
        [m/s], or [m] along the track.
    """

    time_ns: Int64
    measured: Float64
    fitted: Float64


@dataclass(frozen=True)
class Estimate:
    """
    An estimate of r(v) from one window.

    Attributes
    ----------
    estimator
        Which problem was solved, `s1_joint` for instance.
    start_ns, end_ns
        First and last stamp used [ns].
    order
        Number of coefficients; None without an order.
    orders
        The order table.
    samples
        How many samples of each input were used.
    noise_sd
        Estimated standard deviation of each input, in its unit.
    calm, conditions
        r(v) on the whole monotone branch of v: of the ship in calm deep water by a true log,
        and in the wind and depth of the run. The same where an estimator takes neither out.
    whole
        All that slows her in the run: that in its conditions, and a force that no input shows.
    froude_valid
        [Fr_min, Fr_max]: where r(v) may be used.
    froude_max_by
        Which rule gave Fr_max.
    froude_max_argmax
        argmax dr/dFr over the branch, as S1 has it.
    max_relative_sigma
        max sigma_r / max r over the valid range, S1's figure of merit; of the
        repeatable sigma, as in S1. It says nothing about bias.
    last_speed_m_s, last_speed_sigma_m_s, last_resistance_m_s2, last_sigma_m_s2
        Estimates at `end_ns`.
    last_thrust_m_s2
        Thrust that is left at `end_ns`, no part of any curve; how well it is known is in theirs.
    tracks
        Measured and fitted values of each input used.
    current_m_s, current_sigma_m_s
        Current along the track; None where it is not estimated.
    reorthogonalised
        How many basis columns needed a second orthogonalisation.
    notes
        What a reader must know to judge the figures, a sentence each.
    reference
        What is known of the conditions of the run.
    sigma_parts
        Parts of the sigma of `calm` by cause (m,) [m/s^2], whose squares add up to its
        square; none where they are not known.
    sigma_shared_m_s2
        Part of the sigma of `calm` (m,) that other runs of the ship have too, by the prior of her
        curve and of her instruments; empty where it is not known.
    """

    __repr__ = short_repr

    estimator: str
    start_ns: int
    end_ns: int
    order: int | None
    orders: tuple[OrderTrial, ...]
    samples: dict[str, int]
    noise_sd: dict[str, float]
    calm: ResistanceCurve
    conditions: ResistanceCurve
    whole: ResistanceCurve
    froude_valid: tuple[float, float]
    froude_max_by: FroudeMax
    froude_max_argmax: float
    max_relative_sigma: float
    last_speed_m_s: float
    last_speed_sigma_m_s: float
    last_resistance_m_s2: float
    last_sigma_m_s2: float
    tracks: dict[str, Track]
    current_m_s: float | None = None
    current_sigma_m_s: float | None = None
    reorthogonalised: int = 0
    notes: tuple[str, ...] = field(default=())
    reference: Reference = field(default_factory=Reference)
    sigma_parts: dict[str, Float64] = field(default_factory=dict)
    sigma_shared_m_s2: Float64 = field(default_factory=lambda: np.empty(0))
    last_thrust_m_s2: float = 0.0

    @property
    def curve(self) -> ResistanceCurve:
        """r(v) as it is shown: in calm deep water where wind and depth are known."""
        return self.conditions if self.reference.unknown else self.calm

    @property
    def valid_curve(self) -> ResistanceCurve:
        """r(v) inside the valid range."""
        return self.curve.between(*self.froude_valid)

    @property
    def valid_calm(self) -> ResistanceCurve:
        """r(v) in calm deep water inside the valid range."""
        return self.calm.between(*self.froude_valid)

    @property
    def valid_conditions(self) -> ResistanceCurve:
        """r(v) in the conditions of the run inside the valid range."""
        return self.conditions.between(*self.froude_valid)

    @property
    def by_log(self) -> bool:
        """Whether a speed through water was measured."""
        return 'speed_through_water' in map(kind_of, self.samples)

    @property
    def by_position(self) -> bool:
        """Whether positions were used."""
        return 'position' in map(kind_of, self.samples)

    def tracks_of(self, *kinds: str) -> dict[str, Track]:
        """
        Return the tracks of kinds of input by name, as `Window.each` has them in order.
        """
        return {
            name: track
            for kind in kinds
            for name, track in self.tracks.items()
            if kind_of(name) == kind
        }

    @property
    def duration_s(self) -> float:
        """Length of the window [s]."""
        return float(np.int64(self.end_ns) - np.int64(self.start_ns)) * 1e-9


def froude_max(curve: ResistanceCurve) -> tuple[float, FroudeMax]:
    """
    Return the upper end of the valid range, and what gave it.

    Notes
    -----
    S1 takes argmax dr/dFr: above that inflection the curve still carries the
    transient of the start. Over everything that is the transient itself, so:
    the first maximum from which dr/dFr falls, before it rises above it again,
    by more than `SIGNIFICANT` of its standard deviations (of the larger one of
    the two places). Polynomials also wiggle at low speed by more than their
    standard deviation says; a maximum that is exceeded by as much further up
    is such a wiggle. Many hulls have none: then the top of the branch.
    """
    top = _inflection(curve.slope, curve.slope_sigma)
    if top < 0:
        return float(curve.froude[-1]), FroudeMax.BRANCH_TOP
    return float(curve.froude[top]), FroudeMax.INFLECTION


@compiled('i8(f8[:], f8[:])')
def _inflection(slope: Float64, sigma: Float64) -> int:
    """Find the first significant maximum; -1: there is none."""
    for top in range(1, len(slope) - 1):
        if not slope[top - 1] < slope[top] >= slope[top + 1]:
            continue
        falls = exceeded = False
        for i in range(top + 1, len(slope)):
            fall, doubt = slope[top] - slope[i], max(sigma[top], sigma[i])
            if fall < -SIGNIFICANT * doubt:
                falls = False
                break
            exceeded = exceeded or fall < 0.0
            falls = falls or (not exceeded and fall > SIGNIFICANT * doubt)
        if falls:
            return top
    return -1


class ValidRange(NamedTuple):
    """
    Where a curve may be used, and what S1 would say of it, as `Estimate` has it.

    Attributes
    ----------
    froude_valid
        [Fr_min, Fr_max].
    froude_max_by
        Which rule gave Fr_max.
    froude_max_argmax
        argmax dr/dFr over the whole branch.
    max_relative_sigma
        max sigma_r / max r over the range, of the repeatable sigma.
    """

    froude_valid: tuple[float, float]
    froude_max_by: FroudeMax
    froude_max_argmax: float
    max_relative_sigma: float

    @classmethod
    def of_branch(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the whole branch.
        """
        return cls._up_to(curve, float(curve.froude[-1]), FroudeMax.BRANCH_TOP)

    @classmethod
    def of_polynomial(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the part below the transient of the start, `froude_max`.
        """
        return cls._up_to(curve, *froude_max(curve))

    @classmethod
    def _up_to(cls, curve: ResistanceCurve, top: float, by: FroudeMax) -> ValidRange:
        inside = slice(0, int(np.searchsorted(curve.froude, top, side='right')))
        return cls(
            (float(curve.froude[0]), top),
            by,
            float(curve.froude[np.argmax(curve.slope)]),
            float(curve.sigma_repeatable_m_s2[inside].max() / curve.resistance_m_s2[inside].max()),
        )


class AtEnd(NamedTuple):
    """
    Speed through water [m/s] and r [m/s^2] at the end of a window, with their sigmas, and the
    thrust that is left [m/s^2].
    """

    last_speed_m_s: float
    last_speed_sigma_m_s: float
    last_resistance_m_s2: float
    last_sigma_m_s2: float
    last_thrust_m_s2: float = 0.0
