# SPDX-License-Identifier: Apache-2.0
"""What a declared term does, as an effect of the simulation: of the library, or learnt."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

import numpy as np

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.fields import Problems, keys_of, parse, read_keys
from shipdrag_ros.parameter import Parameter, Prior, Shape
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import GRAVITY_M_S2, LearntTerm, Ship
from shipdrag_ros.ship.declared import TermParameter, TermPart, as_found, worth
from shipdrag_ros.ship.expression import PURE, Formula
from shipdrag_ros.ship.model import friction_n, viscous_n
from shipdrag_ros.simulation import effect
from shipdrag_ros.simulation.effect import Action
from shipdrag_ros.simulation.scenario import Turn

_KNOTS = 24  # of a force in time: straight between them
_FOR_EVER_S = 1e7
_STEP = 0.01  # of a speed, over which a power is looked at
_SIZE_SD, _SHAPE_SD = 0.5, 0.05  # of logarithms: a later size may differ, its form hardly
_SCALES = {scale.text: scale for scale in effect.SCALES}
_NEEDS = {'B_WL': 'breadth_m', 'T_M': 'draught_m', 'D_P': 'propeller'}
_ERRS_IN = {
    **dict.fromkeys(('log', 'clock', 'filter'), ('speed_through_water',)),
    'ground': ('position', 'speed_over_ground'),
}


def effects_in(file: Traversable) -> Iterator[effect.Effect]:
    """
    Yield the effects of a file of the library: terms, with what else an effect declares.

    Raises
    ------
    EffectFileError
        If it cannot be used; with every problem that was found.
    """
    problems: Problems = []
    data = parse(file.read_text(encoding='utf-8'), subject=file.name, error=EffectFileError)
    of_term, of_effect = keys_of(LearntTerm), keys_of(effect.Effect)
    for name, entry in data.items():
        given = read_keys(of_term | of_effect, {'name': name, **entry}, name, problems)
        if problems:
            raise EffectFileError(file.name, problems)
        term = LearntTerm(**{key: value for key, value in given.items() if key in of_term})
        more = {key: value for key, value in given.items() if key in of_effect}
        yield replace(effect_of(term), **more)


def stated(name: str, act: Callable[..., Action]) -> effect.Effect:
    """
    Return an effect of which a module says what it does, and a file of the library all else.
    """
    entry = _of_modules()[name]
    of_effect, problems = keys_of(effect.Effect), list[str]()
    given = {key: entry[key] for key in entry if key in of_effect}
    more = read_keys(of_effect, given, name, problems)
    if problems:
        raise EffectFileError(name, problems)
    return effect.Effect(
        name=name,
        scope=effect.Scope(entry['scope']),
        parameters=tuple(_stated(*each) for each in entry['parameters'].items()),
        act=act,
        nameless_at=entry.get('nameless_at', {}),
        **more,
    )


@cache
def _of_modules() -> dict[str, Any]:
    file = resources.files('shipdrag_ros') / 'data' / 'effects_of_modules.yaml'
    text = file.read_text(encoding='utf-8')
    return dict(parse(text, subject=file.name, error=EffectFileError))


def _stated(name: str, about: Mapping[str, Any]) -> Parameter:
    shape, *numbers = about['prior']
    return Parameter(
        about.get('value', math.nan),
        name=name,
        unit=about.get('unit', ''),
        meaning=about['meaning'],
        prior=Prior(Shape(shape), *numbers),
        low=about['bounds'][0],
        high=about['bounds'][1],
        words=about.get('words', {}),
        measured_in=_SCALES[about.get('counted_in', '')],
    )


def effect_of(term: LearntTerm) -> effect.Effect:
    """
    Return a term as an effect, as those of the library are.
    """
    size, *_ = term.parameters
    seen = len(term.evidence.runs) if term.evidence else 0
    # what it leaves of a run that it was not learnt on is how far its formula may be off
    left = 1.0 - term.evidence.held_out_gap_cut if term.evidence else 0.0
    names = {name for *_, text in term.formulas for name in Formula.parse(text).names}
    return effect.Effect(
        name=term.name,
        scope=effect.Scope(term.term.scope),
        parameters=tuple(
            _parameter(name, each, is_size=name == size) for name, each in term.parameters.items()
        ),
        formula=term.term.expression,
        source=f'learnt from {seen} runs' if seen else 'declared by a file',
        act=partial(_act, term),
        formula_sd=min(left, 1.0),
        needs=tuple(key for name, key in _NEEDS.items() if name in names)
        + (('air',) if any(part.channel == 'air' for part in term.parts) else ()),
        errs_in=_ERRS_IN.get(term.term.channel, ()),
        lasts_s=0.0 if term.term.scope == effect.Scope.RUN else 365.0 * effect.DAY_S,
    )


def _parameter(name: str, declared: TermParameter, *, is_size: bool) -> Parameter:
    value = math.nan if declared.value is None else declared.value
    least = (_SIZE_SD if is_size else _SHAPE_SD) * abs(value)  # by which later runs may differ
    low, high = declared.accepted
    return Parameter(
        value,
        name=name,
        unit='' if declared.unit == '1' else declared.unit,
        meaning=declared.meaning or ('size' if is_size else 'of its curve'),
        prior=declared.expected if declared.prior else as_found(value, max(declared.sd, least)),
        low=low,
        high=high,
        measured_in=_SCALES[declared.counted_in or ''],
    )


_OF_RUN: Mapping[str, Callable[[effect.Frame], float]] = {
    'rho': lambda frame: frame.ship.water.density_kg_m3,
    'g': lambda frame: GRAVITY_M_S2,
    'pi': lambda frame: math.pi,
    'L': lambda frame: frame.ship.length_m,
    'nabla': lambda frame: frame.ship.displaced_volume_m3,
    'B_WL': lambda frame: frame.ship.breadth_m or math.nan,
    'T_M': lambda frame: frame.ship.draught_m or math.nan,
    'D_P': lambda frame: frame.ship.propeller.diameter_m if frame.ship.propeller else math.nan,
    'n_r': lambda frame: float(frame.ship.n_r(0.5 * frame.scenario.speed_m_s)),
    't_end': lambda frame: max(frame.scenario.duration_s, 1.0),
    'psi': lambda frame: math.remainder(frame.scenario.heading_rad, math.tau),  # as was checked
    'd': lambda frame: frame.scenario.day,
    'h': lambda frame: frame.scenario.depth_m,
}


def _deep_n(ship: Ship, speed_m_s: Float64) -> Float64:
    return ship.resistance_n(speed_m_s) - ship.air_drag_n(speed_m_s)


_BY_SPEED = {'R_T': _deep_n, 'R_V': viscous_n, 'R_F': friction_n}


@dataclass(frozen=True, eq=False)
class _Acting:
    """A formula in a run, with sizes of its parameters."""

    text: str
    term: LearntTerm
    frame: effect.Frame
    values: tuple[float, ...]

    def at(self, speed_m_s: Float64 | float = 0.0, time_s: Float64 | float = 0.0) -> Float64:
        """Return what it is worth; speeds as they are, times inside of what is valid."""
        formula = Formula.parse(self.text)
        known: dict[str, Float64 | float] = dict(zip(self.term.parameters, self.values))
        for name in formula.names:
            if name in _OF_RUN:
                known[name] = self.term.inside(name, _OF_RUN[name](self.frame))
            elif name in _BY_SPEED:
                known[name] = _BY_SPEED[name](self.frame.ship, np.asarray(speed_m_s, np.float64))
        return worth(self.text, known | {'u': speed_m_s, 't': self.term.inside('t', time_s)})

    def force_n(self, speed_m_s: Float64) -> Float64:
        """
        Return a force.

        Above the speeds that it holds for it goes on as their square; below them as the power
        of the speed that it is at their end, 0 to 2.
        """
        inside = self.term.inside('u', speed_m_s)
        force = np.broadcast_to(self.at(inside), np.shape(speed_m_s))
        beyond = np.where(inside > 0.0, speed_m_s / np.maximum(inside, 1e-9), 1.0)
        power = 2.0 if np.all(beyond >= 1.0) else self._power
        return force * np.where(beyond < 1.0, beyond**power, beyond**2)

    @cached_property
    def _power(self) -> float:
        """The power of the speed that a force is at the lowest that it holds for."""
        low = self.term.term.valid['u'][0]
        here, faster = (float(self.at(speed)) for speed in (low, low * (1.0 + _STEP)))
        if here * faster <= 0.0:
            return 2.0
        return min(max(math.log(faster / here) / math.log1p(_STEP), 0.0), 2.0)

    def reading_m_s(self, speed_m_s: Float64, since_s: Float64) -> Float64:
        """
        Return what the log reads too much.

        Before the stop it is as at the stop; beyond the speeds that it holds for it keeps its
        share of the speed.
        """
        inside = self.term.inside('u', np.abs(speed_m_s))
        share = np.where(inside > 0.0, speed_m_s / np.maximum(inside, 1e-9), np.sign(speed_m_s))
        return share * self.at(inside, np.maximum(since_s, 0.0))


def _act(term: LearntTerm, frame: effect.Frame, *values: float) -> Action:
    actions = (
        _action(part, _Acting(part.expression, term, frame, values), unit == PURE)
        for part, unit in zip(term.parts, term.units, strict=True)
    )
    return Action.total(*actions)


def _action(part: TermPart, acting: _Acting, is_share: bool) -> Action:
    """Return what one part does."""
    names = set(Formula.parse(part.expression).names)
    match part.channel:
        case 'force' if 't' in names:
            return Action(turns=_in_time(acting))
        case 'force':
            return Action(resistance=(acting.force_n,))
        case 'log' if names & {'u', 't', *_BY_SPEED}:
            return Action(log_error=(acting.reading_m_s,))
    amount = float(acting.at())
    match part.channel:
        case 'water' | 'air':
            return _moved(part, acting)
        case 'log':
            return Action(log_factor=amount) if is_share else Action(log_offset_m_s=amount)
        case 'inertia' if is_share:
            return Action(n_r_change=amount)
        case 'inertia':
            return Action(mass_fraction=amount / acting.frame.ship.mass_kg)
        case 'ground':
            return Action(radar_factor=amount)
        case 'clock':
            return Action(log_late_s=amount)
        case 'filter':
            return Action(log_lag_s=amount)
        case 'shaft':
            return Action(stall_m_s=amount)
        case 'depth':
            return Action(depth_m=amount)
    raise KeyError(part.channel)


def _moved(part: TermPart, acting: _Acting) -> Action:
    """Return a velocity of water or air, stated along the first run and to port of it."""
    frame = acting.frame
    both = acting, replace(acting, text=part.to_port or '0')
    time_s = np.array([0.0, frame.scenario.duration_s])
    at_stop, at_end = np.transpose([np.broadcast_to(each.at(0.0, time_s), 2) for each in both])
    if part.channel == 'air':
        return Action(wind_m_s=frame.earth(*at_stop.tolist()))
    return Action(
        current_m_s=frame.earth(*at_stop.tolist()),
        current_change_m_s=frame.earth(*(at_end - at_stop).tolist()),
    )


def _in_time(acting: _Acting) -> tuple[Turn, ...]:
    """Return a drag over the square of the speed that grows and falls in time."""
    last = max(acting.frame.scenario.duration_s, 1.0)
    knots = np.linspace(0.0, last, _KNOTS + 1)
    # where much happens early, as of a decay, knots stand closer there
    knots = last * (knots / last) ** 1.5
    force = acting.at(1.0, knots)
    area = np.broadcast_to(2.0 * force / acting.frame.ship.water.density_kg_m3, knots.shape)
    turns = [Turn(0.0, _FOR_EVER_S, 0.0, float(area[0]))]
    for start, end, more in zip(knots[:-1], knots[1:], np.diff(area), strict=True):
        edge = float(end - start)
        turns.append(Turn(float(start) + 0.5 * edge, _FOR_EVER_S, 0.0, float(more), edge_s=edge))
    return tuple(turn for turn in turns if turn.drag_area_m2 != 0.0)
