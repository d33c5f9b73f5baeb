# SPDX-License-Identifier: Apache-2.0
"""
Parts of hypotheses about coastdowns, each with its unknowns.

A `Term` acts on the ship and is simulated; a `MeasurementTerm` adds to what is
measured, and needs no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar, Protocol

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import gammainc

from shipdrag_ros.diagnosis.model import Part
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.terms import EffectTerm, cubic_bsplines
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION
from shipdrag_ros.parameter import Parameter, flat, free, heavy_tailed, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.baseline import CoefficientBaseline
from shipdrag_ros.simulation import Action
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.hydrodynamics import viscous_n

SHAPE_SD = 0.01  # of a baseline's form, beyond what its coefficients can follow
FREE_SHAFT, FREE_SHAFT_SD = 0.5, 0.15  # shaft speed of a free propeller over that under power
# B-splines: of a baseline's form over the speed; of what has no name, over speed or time; and of
# the departure of an effect from its formula, over the run
_SHAPES, _DISCREPANCIES, _FORMS = 5, 6, 4
_FORCE_SD = 0.15  # of an unknown force, relative to the resistance at the steady speed
_FALLS, _FALL_SD = 3, 0.5  # of thrust beside an exponential fall, relative to the steady one
_CLOCKS_SD_S = 1.0  # by which stamps of two instruments that are in order differ
_SPEED_SD = 0.05  # of an unknown error of log or radar, relative to the steady speed


class Term(Part, Protocol):
    """A part that acts on the ship."""

    def acts_in(self, run: int) -> bool:
        """Say whether it does anything in a run."""

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return what it does in a run."""


@dataclass(frozen=True)
class BaselineTerm:
    """
    What is not known of the baseline, as far as its file says.

    Attributes
    ----------
    ship
    top_m_s
        Highest speed of the runs.
    run_down_change_s
        By how much the thrust of each run is known to run down more slowly
        than the ship file says.
    run_down_sd_s
        Of the thrust; 0: known.
    """

    ship: Ship
    top_m_s: float
    run_down_change_s: tuple[float, ...]
    run_down_sd_s: float
    one_size: ClassVar[Sequence[int]] = ()

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Scales of its parts, its shape, n_r, run-down."""
        base = self.ship.baseline
        assert base is not None
        if isinstance(base, CoefficientBaseline):
            scales = {'friction': base.relative_sd.friction, 'wave': base.relative_sd.wave}
        else:
            scales = {'resistance': base.relative_sd}
        found = [free(name, heavy_tailed(sd)) for name, sd in scales.items()]
        found += [free(f'shape {k}', normal(SHAPE_SD)) for k in range(_SHAPES)]
        # a retardation that is known stays so whatever n_r is
        known = base.relative_sd_of == 'retardation'
        found.append(free('n_r', normal(0.0 if known else self.ship.added_mass.sd)))
        found.append(free('run-down', normal(self.run_down_sd_s)))
        found.append(free('free shaft', normal(FREE_SHAFT_SD, mean=FREE_SHAFT)))
        return tuple(found)

    def acts_in(self, run: int) -> bool:
        """Say that the ship is the same in all runs."""
        return True

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return the departure from the stated baseline."""
        *given, n_r, run_down_s, free_shaft = values
        scales = np.array(given)
        base = self.ship.baseline
        if isinstance(base, CoefficientBaseline) and base.relative_sd.correlation:
            # the scale of the wave resistance is stated as if that of friction were right
            rho, sd = base.relative_sd.correlation, base.relative_sd
            scales[1] *= (1.0 - rho**2) ** 0.5
            if sd.friction > 0.0:
                scales[1] += rho * sd.wave / sd.friction * scales[0]
        return Action(
            resistance=(lambda speed: self._departure(frame.ship, speed, scales),),
            n_r_change=n_r,
            run_down_change_s=self.run_down_change_s[run] + run_down_s,
            free_shaft=free_shaft,
        )

    def _departure(self, ship: Ship, speed_m_s: Float64, scales: Float64) -> Float64:
        result: Float64 = scales @ baseline_parts(ship, self.top_m_s, speed_m_s.tobytes())
        return result


@lru_cache(maxsize=8)
def baseline_parts(ship: Ship, top_m_s: float, speeds: bytes) -> Float64:
    """
    Return what each scale and shape of a baseline adds [N], (p, n).

    Kept, as speeds recur, hence the bytes of an array.

    Parameters
    ----------
    ship
        With a baseline.
    top_m_s
        Highest speed of the runs, over which the shapes are spread [m/s].
    speeds
        Bytes of an array (n,) of speeds through water [m/s].

    Returns
    -------
    (p, n)
        Scales first, then shapes [N].
    """
    speed_m_s = np.frombuffer(speeds)
    total = ship.resistance_n(speed_m_s)
    parts = [total]
    if isinstance(ship.baseline, CoefficientBaseline):
        viscous = viscous_n(ship, speed_m_s)
        parts = [viscous, total - ship.air_drag_n(speed_m_s) - viscous]
    return np.vstack([*parts, total * cubic_bsplines(speed_m_s / top_m_s, _SHAPES)])


@dataclass(frozen=True)
class ForceTerm:
    """
    Any smooth resistance beyond the baseline, as a function of the speed.
    """

    ship: Ship
    top_m_s: float
    one_size: ClassVar[Sequence[int]] = range(_DISCREPANCIES)

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Its sizes about some speeds [N]."""
        sd = _FORCE_SD * float(self.ship.resistance_n(self.top_m_s))
        return tuple(free(f'force {k}', normal(sd)) for k in range(_DISCREPANCIES))

    def acts_in(self, run: int) -> bool:
        """Say that it acts in all runs."""
        return True

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return the extra resistance."""
        sizes = np.array(values)

        def extra(speed_m_s: Float64) -> Float64:
            result: Float64 = sizes @ _bumps(self.top_m_s, speed_m_s.tobytes())
            return result

        return Action(resistance=(extra,))


@dataclass(frozen=True)
class Predicted:
    """
    What one column of a simulation predicts of a run.

    Attributes
    ----------
    along, across : (n,), (k,)
        Rows.
    speed, log, ground, over_ground : (m,)
        Speed through water, as it is and as the log shows it, speed over ground as it is
        shown, and velocity along the heading over ground, at the times of the observation.
    distance : (m,)
        Over ground, along the heading.
    """

    along: Float64
    across: Float64
    speed: Float64
    log: Float64
    ground: Float64
    over_ground: Float64
    distance: Float64


@dataclass(frozen=True)
class ModelErrorTerm:
    """
    How far an effect may depart from its formula, smoothly over the run.

    Attributes
    ----------
    term
        The effect.
    sd
        Relative.
    """

    term: EffectTerm
    sd: float
    one_size: ClassVar[Sequence[int]] = ()

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Departures about some times, relative to the trace of the effect."""
        return tuple(free(f'form {k}', normal(self.sd)) for k in range(_FORMS))

    def columns(
        self, seen: Observation, trace: tuple[Float64, Float64]
    ) -> tuple[Float64, Float64]:
        """Return (4, n) of the rows along and (4, k) of those across, per unit value."""
        bumps = _over_run(seen, _FORMS)
        along = bumps[:, seen.along.at] * trace[0]
        if seen.across is None:
            return along, np.zeros((_FORMS, 0))
        return along, bumps[:, seen.across.at] * trace[1]


class MeasurementTerm(Part, Protocol):
    """A part that adds to what is measured."""

    def columns(self, seen: Observation, run: int, base: Predicted) -> tuple[Float64, Float64]:
        """Return (p, n) of the rows along and (p, k) of those across, per unit value."""


@dataclass(frozen=True)
class RunNuisance:
    """
    Per-run nuisance parameters: where it began, its heading, when the engine stopped.

    Attributes
    ----------
    run
    heading_sd_rad, stop_sd_s
    scatter
        Of the resistance from run to run, relative.
    fall_sd
        Of thrust beside an exponential fall, relative to the steady one.
    stop_s
        Where the stop was taken for at first, after where the run was seen to begin.

    Notes
    -----
    A coastdown under 1 + c times the resistance is the same motion, 1 + c
    times as fast in time. Thrust that falls in another way than
    exp(-t / run_down_s), as s^k exp(-s) / k! with s = t / run_down_s, leaves
    the integral of that behind, which fades as a quadratic resistance lets it.
    """

    run: int
    heading_sd_rad: float
    stop_sd_s: float
    has_positions: bool
    scatter: float = 0.0
    fall_sd: float = _FALL_SD
    stop_s: float = 0.0
    place_of_stop: ClassVar[int] = 3  # among the unknowns
    one_size: ClassVar[Sequence[int]] = ()

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Place [m], heading [rad], stop [s], factor - 1, clocks [s], fall of the thrust."""
        # where no row shows it, a place with a prior leaves the evidence as it is
        place = flat() if self.has_positions else normal(1.0)
        return (
            free('ahead', place),
            free('to port', place),
            free('heading', normal(self.heading_sd_rad)),
            free('stop', normal(self.stop_sd_s, mean=self.stop_s)),
            free('factor', normal(self.scatter)),
            free('log late', normal(_CLOCKS_SD_S if self.has_positions else 0.0)),
            *(free(f'fall {k}', normal(self.fall_sd)) for k in range(_FALLS)),
        )

    def columns(self, seen: Observation, run: int, base: Predicted) -> tuple[Float64, Float64]:
        """Return (6 + 3, n) and (6 + 3, k): of what all runs have, and of forms of the thrust."""
        along, across = _nothing(seen, 6 + _FALLS)
        if run != self.run:
            return along, across
        kind, at = seen.along.rows.kind, seen.along.at
        position = kind == POSITION
        along[0, position] = 1.0
        after = seen.time_s >= seen.lead_in_s
        shown = np.gradient(np.array([base.log, base.ground, base.speed]), seen.time_s, axis=1)
        slowing, slowing_ground = np.where(after, shown[:2], 0.0)
        shown_at = np.where(kind == OVER_GROUND, slowing_ground[at], slowing[at])
        gained = np.where(after, base.over_ground[0] - base.over_ground, 0.0)
        along[3] = np.where(position, gained[at], -shown_at)
        since = np.maximum(seen.time_s - seen.lead_in_s, 0.0)
        way = cumulative_trapezoid(np.where(after, base.speed, 0.0), since, initial=0.0)
        along[4] = np.where(position, (since * base.speed - way)[at], since[at] * shown_at)
        along[5] = np.where(kind == LOG, -slowing[at], 0.0)
        faster = self._fall(since, base.speed, -float(shown[2].min()), seen.run_down_s)
        ahead = cumulative_trapezoid(faster, since, initial=0.0)
        along[6:] = np.where(position, ahead[:, at], faster[:, at])
        if seen.across is not None:
            across[1] = 1.0
            across[2] = base.distance[seen.across.at]
        return along, across

    def _fall(
        self, since_s: Float64, speed_m_s: Float64, steady_m_s2: float, run_down_s: float
    ) -> Float64:
        """Return the speed that each form of thrust adds, (3, m)."""
        if run_down_s <= 0.0:
            return np.zeros((_FALLS, len(since_s)))
        order = 1.0 + np.arange(_FALLS)[:, None]
        fading = (speed_m_s / speed_m_s[0]) ** 2
        found: Float64 = gammainc(order, since_s / run_down_s) * fading
        return steady_m_s2 * run_down_s * found


@dataclass(frozen=True)
class SpeedErrorTerm:
    """
    Any smooth error of the log, or of radar and GNSS, as a function of time.
    """

    run: int
    of_log: bool
    speed_m_s: float
    one_size: ClassVar[Sequence[int]] = range(_DISCREPANCIES)

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Its sizes about some times [m/s]."""
        sd = _SPEED_SD * self.speed_m_s
        what = 'log' if self.of_log else 'radar'
        return tuple(free(f'{what} {k}', normal(sd)) for k in range(_DISCREPANCIES))

    def columns(self, seen: Observation, run: int, base: Predicted) -> tuple[Float64, Float64]:
        """Return (6, n) and (6, k)."""
        along, across = _nothing(seen, _DISCREPANCIES)
        if run != self.run:
            return along, across
        # one for the lead-in, the others over the coastdown
        error = _over_run(seen, _DISCREPANCIES)
        kind, at = seen.along.rows.kind, seen.along.at
        if self.of_log:
            along[:, kind == LOG] = error[:, at[kind == LOG]]
            return along, across
        along[:, kind == OVER_GROUND] = error[:, at[kind == OVER_GROUND]]
        steps = 0.5 * (error[:, 1:] + error[:, :-1]) * np.diff(seen.time_s)
        way = np.concatenate([np.zeros((_DISCREPANCIES, 1)), np.cumsum(steps, axis=1)], axis=1)
        along[:, kind == POSITION] = way[:, at[kind == POSITION]]
        return along, across


def _over_run(seen: Observation, count: int) -> Float64:
    """Return bumps over a coastdown, (count, m); the first one holds all that was before."""
    after = np.clip((seen.time_s - seen.lead_in_s) / seen.duration_s, 0.0, 1.0)
    return _kept_bsplines(after.tobytes(), count)


@lru_cache(maxsize=32)
def _kept_bsplines(x: bytes, count: int) -> Float64:
    return cubic_bsplines(np.frombuffer(x), count)


@lru_cache(maxsize=8)
def _bumps(top_m_s: float, speeds: bytes) -> Float64:
    return cubic_bsplines(np.frombuffer(speeds) / top_m_s, _DISCREPANCIES)


def _nothing(seen: Observation, unknowns: int) -> tuple[Float64, Float64]:
    across = 0 if seen.across is None else len(seen.across)
    return np.zeros((unknowns, len(seen.along))), np.zeros((unknowns, across))
