# SPDX-License-Identifier: Apache-2.0
"""
Effects of the library as unknowns of the model.

An effect is known by its `act` alone: what an action does to the motion is a force over the
speed (`retardation_of`), and all else, readings and context too, is the difference of two
simulations. So a new effect needs nothing here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import ndtri

from shipdrag_ros.parameter import Parameter, Prior, Shape
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation.effect import Action, Effect, Frame, Scope
from shipdrag_ros.simulation.effects import effects_of

_TRIAL_Z = 0.5  # of a size that may have either sign, or be 0
_APART = (-0.8, 0.8)  # z of parameters that are not found from one start
_PLACES = (-1.5, -0.9, -0.3, 0.3, 0.9, 1.5)  # the same of a speed at which something changes
_DELAYS = (0.0, -7.5, -4.5, -2.7, -1.5, 1.5, 2.7, 4.5, 7.5)  # z of a time: no small change
_SIZES = tuple(np.linspace(-1.6, 1.6, 17).tolist())  # where an effect has nothing else
_EVERYWHERE = (0.03, 0.08, 0.16, 0.27, 0.42, 0.58, 0.79)  # shares of the longest run
_MOST, _JUMP = 4.0, 0.8  # of z that is tried, and of z, from the linear response
_INSIDE = 0.3  # z of a size of one sign: away from its end


@dataclass(frozen=True)
class EffectWay:
    """
    One way in which an effect may be there, and where its fit begins.

    Attributes
    ----------
    effect
    unknowns
        Parameters in SI, given their signs, without those that are fixed.
    fixed
        Parameters that are a choice, by name.
    start : (q,)
        In z, standard normal under the prior.
    log_odds
        Prior log odds over nothing, of this way.
    run
        Where it is alone, of an effect of a single run; None: in all runs.
    stated
        Whether it is part of the ship as her file states it, and no hypothesis.
    kept
        Whether it is as an earlier diagnosis found it, with priors about what that found.
    nameless
        Whether many other causes leave the same trace, so that it is no name.
    """

    effect: Effect
    unknowns: tuple[Parameter, ...]
    fixed: tuple[tuple[str, float], ...]
    start: tuple[float, ...]
    log_odds: float
    run: int | None = None
    stated: bool = False
    kept: bool = False
    nameless: bool = False

    @property
    def mode(self) -> tuple[object, ...]:
        """What separates it from other ways of the effect, where its fit begins apart."""
        signs = tuple(q.prior.first > 0.0 for q in self.unknowns)
        return self.effect.name, self.fixed, signs, self.run, self.kept

    @property
    def components(self) -> list[int]:
        """Places of components, which may have either sign: where one is small, so are all."""
        found = [i for i, q in enumerate(self.unknowns) if q.prior.shape is Shape.NORMAL]
        known = self.stated or self.kept
        return found if len(found) > 1 and not known else []

    def acts_in(self, run: int) -> bool:
        """Say whether it does anything in a run."""
        return self.run is None or self.run == run

    def action(self, frame: Frame, z: Sequence[float], run: int | None = None) -> Action:
        """Return what it does at some z: in a run, or where it acts."""
        if run is not None and not self.acts_in(run):
            return Action()
        values = {q.name: q.prior.at(at) for q, at in zip(self.unknowns, z)} | dict(self.fixed)
        return self.effect.action(frame, *(values[q.name] for q in self.effect.parameters))

    def tried(self) -> list[float]:
        """Return z of a likely size, where its trace is looked at before it is fitted."""
        return [self.start[0] or _TRIAL_Z, *self.start[1:]]

    @property
    def power(self) -> float:
        """Of the size in its trace; 1 where it may be 0."""
        log_normal = self.unknowns[0].prior.shape is Shape.LOG_NORMAL
        return self.effect.size_power if log_normal else 1.0

    def size_of(self, amount: float) -> float:
        """Return the size of which there is so much of the trace that is tried."""
        tried = self.unknowns[0].prior.at(self.tried()[0])
        return tried * amount ** (1.0 / self.power) if amount > 0.0 else 0.0

    def z_of(self, amount: float) -> float:
        """Return z of the size of which there is so much of the trace that is tried."""
        return self.unknowns[0].prior.inverse(self.size_of(amount))

    def resized(self, amount: float) -> float:
        """Return z of the size of which there is so much more of the trace than is tried."""
        tried, first = self.tried()[0], self.unknowns[0].prior
        if self.kept:
            return self.start[0]
        if first.shape is Shape.HALF_NORMAL:
            amount = max(amount, 0.1)
        far = first.shape is Shape.NORMAL and self.start[0] != 0.0
        if (far and self.unknowns[0].unit == 's') or (
            first.shape is Shape.LOG_NORMAL and len(self.unknowns) == 1
        ):
            return tried  # starts stand close
        if first.shape is not Shape.LOG_NORMAL:
            return tried * min(max(amount, -_MOST), _MOST)
        more = self.z_of(min(max(amount, 0.05), 20.0)) - tried
        return tried + min(max(more, -_JUMP), _JUMP)


def stated_way(stated: StatedEffect, ship: Ship) -> EffectWay:
    """
    Return an effect of the ship file, as well known as the file says.
    """
    effect = effects_of(ship)[stated.name]
    unknowns = []
    for q in effect.parameters_of(ship):
        given = stated.parameters.get(q.name, Parameter(float(np.nan_to_num(q.value)), 0.0))
        unknowns.append(replace(q, prior=q.prior.about(given.value, given.sd)))
    return EffectWay(effect, tuple(unknowns), (), (0.0,) * len(unknowns), 0.0, stated=True)


def kept_way(effect: Effect, sizes: Sequence[Prior], ship: Ship) -> EffectWay:
    """
    Return an effect that is as an earlier diagnosis found it.

    Parameters
    ----------
    effect
    sizes
        Priors of its parameters, about what was found.
    ship
    """
    unknowns = tuple(
        replace(q, prior=prior) for q, prior in zip(effect.parameters_of(ship), sizes, strict=True)
    )
    start = (0.0,) * len(unknowns)
    return EffectWay(effect, unknowns, (), start, math.log(effect.odds), kept=True)


def ways_of(effect: Effect, ship: Ship, longest_s: float, runs: int) -> Iterator[EffectWay]:
    """
    Yield all ways and starts of an effect.

    Parameters
    ----------
    effect
        That can act on the ship.
    ship
    longest_s
        Length of the longest run: a uniform prior is that of a time.
    runs
        Number of runs.
    """
    yield from _alike(effect, effect.parameters_of(ship), longest_s, runs)
    if effect.nameless_at:
        fixed = tuple(effect.nameless_at.items())
        left = [q for q in effect.parameters_of(ship) if q.name not in effect.nameless_at]
        less = math.log(priors.UNNAMED_ODDS.mean / effect.odds)
        for way in _alike(effect, left, longest_s, runs):
            log_odds = way.log_odds + less
            yield replace(way, fixed=way.fixed + fixed, log_odds=log_odds, nameless=True)


def _alike(
    effect: Effect, parameters: Sequence[Parameter], longest_s: float, runs: int
) -> Iterator[EffectWay]:
    """Yield the ways of an effect by the parameters that are open."""
    free = [q for q in parameters if q.prior.shape is not Shape.CHOICE]
    choices = [q for q in parameters if q.prior.shape is Shape.CHOICE]
    signed = [q.name for q in free if q.prior.shape is Shape.EITHER_SIGN]
    signs = [dict(zip(signed, s)) for s in product((1.0, -1.0), repeat=len(signed))]
    words = list(product(*((q.prior.first, q.prior.second) for q in choices)))
    single = effect.scope is Scope.RUN and runs > 1
    places = (None, *range(runs)) if single else (None,)
    log_odds = math.log(effect.odds) - math.log(len(signs) * len(words) * len(places))
    starts = list(product(*(_starts(q, longest_s, free) for q in free)))
    for sign, word, run, start in product(signs, words, places, starts):
        unknowns = tuple(replace(q, prior=q.prior.of_sign(sign.get(q.name, 1.0))) for q in free)
        fixed = tuple((q.name, value) for q, value in zip(choices, word))
        yield EffectWay(effect, unknowns, fixed, start, log_odds, run)


def _starts(quantity: Parameter, longest_s: float, free: Sequence[Parameter]) -> tuple[float, ...]:
    shape = quantity.prior.shape
    if shape is Shape.UNIFORM:
        part = min(longest_s / (quantity.prior.second - quantity.prior.first), 1.0)
        return tuple(float(ndtri(part * each)) for each in _EVERYWHERE)
    if shape is Shape.HALF_NORMAL:
        return (_INSIDE,)
    if shape is not Shape.LOG_NORMAL:
        return _DELAYS if quantity.unit == 's' else (0.0,)
    if len(free) == 1:
        return _SIZES
    return _PLACES if quantity.unit == 'm/s' else _APART


def retardation_of(action: Action, frame: Frame, speed_m_s: Float64) -> tuple[Float64, float]:
    """
    Return what an action adds to r at some speeds, and to 1 + n_r.

    Parameters
    ----------
    action
    frame
        Of the run, on her first heading.
    speed_m_s : (m,)
        Through water.

    Returns
    -------
    retardation_m_s2 : (m,)
    inertia
        Of what acts for a time alone, and of thrust, there is nothing in it.
    """
    ship, heading = frame.ship, frame.scenario.heading_rad
    cos, sin = math.cos(heading), math.sin(heading)

    def turned(vector: tuple[float, float]) -> tuple[float, float]:
        return vector[0] * cos + vector[1] * sin, vector[1] * cos - vector[0] * sin

    r = action.resistance_n(speed_m_s) / ship.mass_kg
    (wind, across), (current, set_m_s) = turned(action.wind_m_s), turned(action.current_m_s)
    ahead, abeam = speed_m_s + current - wind, set_m_s - across
    air = float(ship.air_drag_n(1.0)) / ship.mass_kg
    r = r + air * (ahead * np.hypot(ahead, abeam) - speed_m_s * np.abs(speed_m_s))
    wave = math.hypot(*action.wave_force_n)
    if wave > 0.0:
        along = turned(action.wave_force_n)[0] / wave
        encounter = 1.0 - action.wave_encounter_s_m * speed_m_s * along
        r = r - wave / ship.mass_kg * along * encounter**2
    return r, action.n_r_change + action.mass_fraction
