# SPDX-License-Identifier: Apache-2.0
"""
Readings of exactly 0 while the ship moves: a speed below which a log stands still.

Zeros that come at any speed are drop-outs; a ship that drifts with the water has a
log that rightly reads 0, and one way over ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln, expit, logsumexp

from shipdrag_ros.diagnosis.legs import SailingRecord, Stretches
from shipdrag_ros.diagnosis.result import EffectEstimate, Where
from shipdrag_ros.diagnosis.sailing_model import ANY_SHIP, SailingFit
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.effects import EffectWay, ways_of
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY

_MOVES_M_S = 0.1  # slower is at rest, as positions show it
_SCATTER_M_S = 0.08  # of the way over ground while the log reads 0, that no drift explains
_APART = 3.0  # stretches in which a wheel sticks once: neighbours are no new evidence
_LAPSES = (0.01, 0.05)  # readings that are otherwise than the speed says
_WIDTHS = (0.02, 0.05, 0.1)  # of the speed at which a wheel begins to turn, relative
_Z = np.linspace(-5.0, 5.0, 401)  # of that speed


@dataclass(frozen=True)
class StandingLog:
    """
    What zeros say of a log that stands still below some speed.

    Attributes
    ----------
    way
        The dead band.
    log_factor
        Logarithm of its Bayes factor over zeros that come at any speed.
    z, sd
        Of the speed.
    at_m_s : (k,)
        Speeds over ground of the stretches in which the log reads 0.
    share
        Of the stretches below that speed, in which it does.
    length_s
        Of the longest record.
    """

    way: EffectWay
    log_factor: float
    z: float
    sd: float
    at_m_s: Float64
    share: float
    length_s: float

    @classmethod
    def of(cls, records: Sequence[SailingRecord], parameters: Parameters) -> StandingLog | None:
        """
        Look at the zeros of a log; None where there are none, or the water may move the ship.

        Parameters
        ----------
        records
            With frozen readings of 0.
        parameters
            For the convention of the heading.

        Raises
        ------
        DiagnosisError
            If there is no log, or nothing over ground.
        """
        stretches = Stretches.of(records, parameters)
        moving = np.abs(stretches.way_m_s) > _MOVES_M_S
        way, zero = stretches.way_m_s[moving], stretches.zero[moving]
        speed = np.abs(way)
        if not zero.any() or zero.all() or _drifts(way[zero], stretches.by_place):
            return None
        (effect,) = (e for e in LIBRARY.values() if WithoutBaseline.ZEROS in e.without_baseline)
        (band,) = effect.parameters
        bands = np.array([band.prior.at(z) for z in _Z.tolist()])
        weight = np.exp(-0.5 * _Z**2)
        each = np.log(weight / weight.sum()) + _log_likelihood(bands, speed, zero) / _APART
        n, k = len(zero), int(zero.sum())
        at_any_speed = float(betaln(k / _APART + 1.0, (n - k) / _APART + 1.0))
        weight = np.exp(each - logsumexp(each))
        z = float(weight @ _Z)
        below = speed < band.prior.at(z)
        return cls(
            next(ways_of(effect, ANY_SHIP, 0.0, 1)),
            float(logsumexp(each)) - at_any_speed,
            z,
            math.sqrt(float(weight @ (_Z - z) ** 2)),
            speed[zero],
            float(zero[below].mean()) if below.any() else 0.0,
            stretches.length_s,
        )

    def joined(self, fit: SailingFit) -> SailingFit:
        """Return a hypothesis about the readings that are not 0, with the dead band in it."""
        ways = fit.hypothesis.ways
        place = sum(len(way.unknowns) for way in ways)
        return replace(
            fit,
            hypothesis=replace(fit.hypothesis, ways=(*ways, self.way)),
            z=np.insert(fit.z, place, self.z),
            sd=np.insert(fit.sd, place, self.sd),
            log_evidence=fit.log_evidence + self.log_factor,
        )

    @property
    def named(self) -> EffectEstimate:
        """The dead band, as probable as the zeros alone make it, whatever else there is."""
        (band,) = self.way.unknowns
        size = Parameter(band.prior.at(self.z), band.prior.slope(self.z) * self.sd)
        probability = float(expit(self.log_factor + self.way.log_odds))
        return EffectEstimate(self.way.effect.name, probability, {band.name: size})

    @property
    def note(self) -> str:
        """For the reader."""
        band = self.way.unknowns[0].prior.at(self.z)
        return (
            f'the log reads exactly 0 in {len(self.at_m_s)} stretches in which she moved over '
            f'ground, at {self.at_m_s.min():.2f} to {self.at_m_s.max():.2f} m/s: in '
            f'{100.0 * self.share:.0f} % of all below {band:.2f} m/s'
        )

    @property
    def where(self) -> Where:
        """Where it shows."""
        span = float(self.at_m_s.min()), float(self.at_m_s.max())
        return Where('log', (0.0, self.length_s), span)

    @property
    def rms_m_s(self) -> float:
        """Of the speed that the log does not show."""
        return float(np.sqrt(np.mean(self.at_m_s**2)))


def _drifts(way: NDArray[np.complex128], by_place: bool) -> bool:
    """Say whether one velocity of the water may be all that moves the ship."""
    if not by_place:
        way = np.abs(way).astype(np.complex128)
    return float(np.sqrt(np.mean(np.abs(way - way.mean()) ** 2))) < _SCATTER_M_S


def _log_likelihood(bands: Float64, speed: Float64, zero: NDArray[np.bool_]) -> Float64:
    """Return that of zeros below each band, averaged over lapses and widths, (bands,)."""
    found = []
    for lapse in _LAPSES:
        for width in _WIDTHS:
            below = expit((1.0 - speed / bands[:, None]) / width)
            chance = lapse + (1.0 - 2.0 * lapse) * below
            found.append(np.log(np.where(zero, chance, 1.0 - chance)).sum(axis=1))
    total: Float64 = logsumexp(np.array(found), axis=0) - np.log(len(found))
    return total
