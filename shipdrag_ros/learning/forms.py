# SPDX-License-Identifier: Apache-2.0
"""
The forms that are tried: channel, variable, curve and scope, each a declared term.

Sizes are pure numbers, times density, gravity, length and displaced volume, so that what is
learnt carries to a sister. Where a curve turns is looked for among the speeds and times that the
runs hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from shipdrag_ros.parameter import Prior, Shape, either_sign, log_normal, normal
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.effects import EffectWay, ways_of
from shipdrag_ros.ship import GRAVITY_M_S2, LearntTerm, Ship
from shipdrag_ros.ship.declared import TermForm, TermParameter
from shipdrag_ros.simulation.declared import effect_of
from shipdrag_ros.simulation.effect import Effect

SMOOTH_OVER_FORM = 30.0
"""Prior odds of something smooth without a formula, over each form."""
_HAPPENS_D = 100.0  # a hull is fouled, cleaned, docked or hit once in so many days
_SIZE = either_sign(0.008, 1.0)  # of A: 3 to 40 % of the resistance of most hulls
_GAIN = either_sign(0.04, 0.8)  # of A in a log: share of the speed
_TURNS_AT = (0.55, 0.45)  # share of the highest speed: median, sd of the logarithm
_LASTS = (0.25, 0.8)  # share of the longest run: the same
_NARROW, _BROAD = 0.03, 0.1  # widths of steps, shares of the same
_HUMP = (0.12, 0.6)  # width of a hump, the same: median, sd of the logarithm
_THINNEST = 0.02  # of a hump, the same
_SCAN = (-1.6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.6)  # z where a curve may turn
_SIZES = (-1.2, 0.0, 1.2)  # z of a size alone, and of a width
_WAYS_ROUND = ((1.0, 0.0), (0.7, 0.7), (0.05, 1.0), (-0.7, 0.7))  # z of two components
_REFERENCE = 0.2  # Froude number at which A is of the same size whatever the power


@dataclass(frozen=True)
class Span:
    """
    What the runs hold.

    Attributes
    ----------
    low_m_s, top_m_s
        Speeds through water.
    longest_s
        Of a coastdown.
    log
        Whether the log is seen beside the way over ground.
    days
        Of the first and the last run, where that can matter; None: too few or on one day.
    depth_m
        Least and most of the water, where it is measured in all runs and differs; None: not.
    """

    low_m_s: float
    top_m_s: float
    longest_s: float
    log: bool = False
    days: tuple[float, float] | None = None
    depth_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class LearnableForm:
    """
    One form.

    Attributes
    ----------
    kind
        Channel, variable and shape: what a form is right or wrong in.
    term
        With sizes of what is expected, until it is fitted.
    priors
        Of its parameters.
    odds
        Before any data, over those of a form that may act on any day.
    """

    kind: tuple[str, str, str]
    term: LearntTerm
    priors: tuple[Prior, ...]
    odds: float = 1.0

    def effect(self) -> Effect:
        """
        Return it as an effect that may be missing.
        """
        plain = effect_of(self.term)
        parameters = tuple(
            replace(q, prior=prior, low=-math.inf, high=math.inf)
            for q, prior in zip(plain.parameters, self.priors, strict=True)
        )
        odds = self.odds * priors.UNNAMED_ODDS.mean / SMOOTH_OVER_FORM
        return replace(plain, parameters=parameters, odds=odds)

    def ways(self, ship: Ship, longest_s: float, runs: int) -> list[EffectWay]:
        """
        Return its ways, with a start wherever its curve may turn.
        """
        first: dict[object, EffectWay] = {}
        for way in ways_of(self.effect(), ship, longest_s, runs):
            first.setdefault(way.mode, way)
        starts: list[tuple[float, ...]] = [(0.0, b, c) for b, c in _WAYS_ROUND]
        if len(self.priors) == 1:
            starts = [(z,) for z in _SIZES]
        elif self.priors[1].shape is Shape.LOG_NORMAL:
            wide = product(_SIZES, repeat=len(self.priors) - 2)
            starts = [(0.0, z, *each) for z, each in product(_SCAN, wide)]
        elif len(self.priors) == 2:
            starts = list(_WAYS_ROUND)
        return [replace(way, start=start) for way in first.values() for start in starts]


def forms(ship: Ship, span: Span) -> tuple[LearnableForm, ...]:
    """
    Return all forms that some runs of a ship can carry.
    """
    by_run = (*_by_heading(), *_by_day(span), *_by_depth(ship, span))
    forces = (*_by_speed(ship, span), *_over_time(_as_power(2), _SIZE, ship, span), *by_run)
    every = [('force', *each) for each in forces]
    every += [('log', *each) for each in (_of_log(ship, span) if span.log else ())]
    return tuple(_form(number, span, *each) for number, each in enumerate(every))


_Declared = tuple[str, str, str, dict[str, Prior]]
_OF_EARTH = ('heading', 'depth')
_SIDES = ('u_c*sqrt(g*L) - u', 'u - u_c*sqrt(g*L)')  # of a speed


def _form(
    number: int,
    span: Span,
    channel: str,
    variable: str,
    shape: str,
    expression: str,
    parameters: dict[str, Prior],
) -> LearnableForm:
    valid = {'u': (round(span.low_m_s, 3), round(1.05 * span.top_m_s, 3))}
    if variable == 'time':
        valid['t'] = (0.0, round(1.05 * span.longest_s, 1))
    odds = 1.0
    if variable == 'date' and span.days:
        valid['d'] = span.days
        odds = min((span.days[1] - span.days[0]) / _HAPPENS_D, 1.0)
    if variable == 'depth' and span.depth_m:
        valid['h'] = span.depth_m
    scope = 'earth' if variable in _OF_EARTH else 'sensor' if channel == 'log' else 'hull'
    term = LearntTerm(
        name=f'form_{number}_{channel}_{variable}_{shape}',
        term=TermForm(
            channel, expression, scope=scope, variable=variable, shape=shape, valid=valid
        ),
        parameters={name: TermParameter(prior.at(0.0), 0.0) for name, prior in parameters.items()},
    )
    return LearnableForm((channel, variable, shape), term, tuple(parameters.values()), odds)


def _as_power(power: int) -> str:
    """Return a force as a power of the speed, of one size at the reference."""
    if power == 2:
        return '0.5*rho*A*nabla**(2/3)*u**2'
    head = f'0.5*rho*A*nabla**(2/3)*g*L*{_REFERENCE**2:g}'
    return head if power == 0 else f'{head}*(u/({_REFERENCE:g}*sqrt(g*L)))**{power}'


def _by_speed(ship: Ship, span: Span) -> Iterator[_Declared]:
    root = math.sqrt(GRAVITY_M_S2 * ship.length_m)
    top = span.top_m_s / root
    size = {'A': _SIZE}
    turns = size | {'u_c': log_normal(_TURNS_AT[0] * top, _TURNS_AT[1])}
    for power in (0, 1, 3, 4, 6):
        yield 'speed', 'constant' if power == 0 else 'power', _as_power(power), size
    for power in (0, 2):
        base = _as_power(power)
        for side in _SIDES:
            for step in _steps(side, 'sqrt(g*L)', top):
                yield 'speed', 'step', f'{base}*{step}', turns
        hump = _hump('u', 'u_c', 'sqrt(g*L)', top)
        yield 'speed', 'hump', f'{base}*{hump}', turns | _width(top)
    yield 'speed', 'decay', f'{_as_power(0)}*exp(-u/(u_c*sqrt(g*L)))', turns
    for side in _SIDES:
        for power in (1, 2):
            ramp = f'(max({side}, 0*u)/({_REFERENCE:g}*sqrt(g*L)))**{power}'
            yield 'speed', 'ramp', f'{_as_power(0)}*{ramp}', turns


def _of_log(ship: Ship, span: Span) -> Iterator[_Declared]:
    yield from _over_time('A*u', _GAIN, ship, span)
    top = span.top_m_s / math.sqrt(GRAVITY_M_S2 * ship.length_m)
    turns = {'A': _GAIN, 'u_c': log_normal(_TURNS_AT[0] * top, _TURNS_AT[1])}
    yield 'speed', 'power', 'A*u**2/sqrt(g*L)*4', {'A': _GAIN}
    for side in _SIDES:
        for step in _steps(side, 'sqrt(g*L)', top):
            yield 'speed', 'step', f'A*u*{step}', turns
        yield 'speed', 'ramp', f'A*max({side}, 0*u)', turns
    yield 'speed', 'hump', f'A*u*{_hump("u", "u_c", "sqrt(g*L)", top)}', turns | _width(top)


def _over_time(base: str, size: Prior, ship: Ship, span: Span) -> Iterator[_Declared]:
    """Yield what grows, falls or swings in time, of some size A."""
    unit = math.sqrt(ship.length_m / GRAVITY_M_S2)
    longest = span.longest_s / unit
    lasts = {'A': size, 'tau': log_normal(_LASTS[0] * longest, _LASTS[1])}
    tau = 'tau*sqrt(L/g)'
    yield 'time', 'decay', f'{base}*exp(-t/({tau}))', lasts
    yield 'time', 'decay', f'{base}*(1 - exp(-t/({tau})))', lasts
    yield 'time', 'ramp', f'{base}*min(t/({tau}), 1)', lasts
    yield 'time', 'ramp', f'{base}*max(1 - t/({tau}), 0)', lasts
    for side in (f't - {tau}', f'{tau} - t'):
        for step in _steps(side, 'sqrt(L/g)', longest):
            yield 'time', 'step', f'{base}*{step}', lasts
    hump = _hump('t', 'tau', 'sqrt(L/g)', longest)
    yield 'time', 'hump', f'{base}*{hump}', lasts | _width(longest)
    for period in (0.15, 0.3, 0.6):
        turn = f'{2.0 * np.pi / (period * longest):.4g}*t*sqrt(g/L)'
        both = f'(A*cos({turn}) + B*sin({turn}))'
        yield 'time', 'periodic', base.replace('A', both), _two(size)


def _by_day(span: Span) -> Iterator[_Declared]:
    """Yield what grows or falls from run to run."""
    if span.days is None:
        return
    first, last = span.days
    base, since = _as_power(2), f'(d - {first})/{last - first:.4g}'
    yield 'date', 'ramp', f'{base}*{since}', {'A': _SIZE}
    turns = {'A': _SIZE, 'x': log_normal(*_TURNS_AT)}
    for side in (f'x - {since}', f'{since} - x'):
        yield 'date', 'step', f'{base}*step({side}, {_NARROW})', turns
    yield 'date', 'decay', f'{base}*exp(-{since}/x)', turns


def _by_depth(ship: Ship, span: Span) -> Iterator[_Declared]:
    """Yield what grows where the water is shallower, or acts below a depth."""
    if span.depth_m is None:
        return
    middle = math.sqrt(span.depth_m[0] * span.depth_m[1]) / ship.length_m
    base, turns = _as_power(2), {'A': _SIZE, 'x': log_normal(middle, _TURNS_AT[1])}
    for power in (1, 2, 4):
        yield 'depth', 'power', f'{base}*({middle:.4g}*L/h)**{power}', {'A': _SIZE}
    yield 'depth', 'step', f'{base}*step(x*L - h, {_NARROW * middle:.3g}*L)', turns


def _by_heading() -> Iterator[_Declared]:
    both = '(A*cos(psi) + B*sin(psi))'
    for power in (0, 1, 2):
        yield 'heading', 'periodic', _as_power(power).replace('A', both), _two(_SIZE)
    some = _as_power(2) + '*(1 + b*cos(psi) + c*sin(psi))'
    yield 'heading', 'periodic', some, {'A': _SIZE, 'b': normal(0.7), 'c': normal(0.7)}


def _steps(side: str, unit: str, whole: float) -> Iterator[str]:
    """Yield steps at one side of a speed or a time, sharp and not."""
    for width in (_NARROW, _BROAD):
        yield f'step({side}, {width * whole:.3g}*{unit})'


def _hump(variable: str, at: str, unit: str, whole: float) -> str:
    """Return a bell about a speed or a time, of some width."""
    width = f'max(w, {_THINNEST * whole:.3g})*{unit}'
    return f'exp(-(({variable} - {at}*{unit})/({width}))**2)'


def _width(whole: float) -> dict[str, Prior]:
    return {'w': log_normal(_HUMP[0] * whole, _HUMP[1])}


def _two(size: Prior) -> dict[str, Prior]:
    return {name: normal(1.2 * size.first) for name in 'AB'}
