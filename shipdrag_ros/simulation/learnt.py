# SPDX-License-Identifier: Apache-2.0
"""What a learnt term does, as an effect of the simulation."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from shipdrag_ros.parameter import Parameter, Prior, log_normal, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import GRAVITY_M_S2, LearntTerm
from shipdrag_ros.ship.term import TermParameter
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Scope
from shipdrag_ros.simulation.scenario import Turn

_KNOTS = 24  # of a force in time: straight between them
_FOR_EVER_S = 1e7
_SIZE_SD, _SHAPE_SD = 0.5, 0.05  # of logarithms: a later size may differ, its form hardly
_ANY = (0.0, math.inf)


def effect_of(term: LearntTerm) -> Effect:
    """
    Return a term as an effect, as those of the library are.
    """
    size, *_ = term.parameters
    seen = len(term.evidence.runs) if term.evidence else 0
    return Effect(
        name=term.name,
        scope=Scope(term.term.scope),
        parameters=tuple(
            Parameter(
                each.value,
                name=name,
                unit='' if each.unit == '1' else each.unit,
                meaning='size' if name == size else 'of its curve',
                prior=_prior(each, _SIZE_SD if name == size else _SHAPE_SD),
                low=-1e9 if each.value <= 0.0 else 0.0,
                high=1e9,
            )
            for name, each in term.parameters.items()
        ),
        formula=term.term.expression,
        source=f'learnt from {seen} runs' if seen else 'declared by a file',
        act=partial(_act, term),
        errs_in=('speed_through_water',) if term.term.channel == 'log' else (),
        lasts_s=0.0 if term.term.scope == Scope.RUN else 365.0 * DAY_S,
    )


def _prior(parameter: TermParameter, least_sd: float) -> Prior:
    """Return what is expected of a parameter in later runs."""
    value, sd = parameter.value, parameter.sd
    if value == 0.0 or sd > 0.5 * abs(value):
        return normal(max(sd, 1e-12), mean=value)
    return log_normal(value, max(sd / abs(value), least_sd))


def force_n(
    term: LearntTerm, frame: Frame, values: tuple[float, ...], speed_m_s: Float64
) -> Float64:
    """
    Return the force of a term at speeds (n,), at the stop [N].

    Beyond the speeds that it holds for it goes on as the square of the speed.
    """
    inside = np.clip(speed_m_s, *term.term.valid.get('u', _ANY))
    force = _worth(term, frame, values, inside, 0.0)
    beyond = np.where(inside > 0.0, speed_m_s / np.maximum(inside, 1e-9), 1.0) ** 2
    found: Float64 = np.broadcast_to(force, np.shape(speed_m_s)) * beyond
    return found


def _act(term: LearntTerm, frame: Frame, *values: float) -> Action:
    if term.term.channel == 'log':
        return Action(log_error=(partial(_reading_m_s, term, frame, values),))
    if 't' not in term.formula.names:
        return Action(resistance=(partial(force_n, term, frame, values),))
    return Action(turns=_in_time(term, frame, values))


def _reading_m_s(
    term: LearntTerm,
    frame: Frame,
    values: tuple[float, ...],
    speed_m_s: Float64,
    since_s: Float64,
) -> Float64:
    """Return what the log reads too much; before the stop, as at the stop."""
    speed = np.clip(speed_m_s, *term.term.valid.get('u', _ANY))
    found: Float64 = np.broadcast_to(
        _worth(term, frame, values, speed, np.maximum(since_s, 0.0)), np.shape(speed_m_s)
    )
    return found


def _worth(
    term: LearntTerm,
    frame: Frame,
    values: tuple[float, ...],
    speed_m_s: Float64,
    time_s: Float64 | float,
) -> Float64:
    ship, scenario = frame.ship, frame.scenario
    names: dict[str, Float64 | float] = {
        'rho': ship.water.density_kg_m3,
        'g': GRAVITY_M_S2,
        'L': ship.length_m,
        'nabla': ship.displaced_volume_m3,
        'u': speed_m_s,
        't': time_s,
        'psi': scenario.heading_rad,
        'd': scenario.day,
        'h': scenario.depth_m,
    }
    return term.worth(names, values)


def _in_time(term: LearntTerm, frame: Frame, values: tuple[float, ...]) -> tuple[Turn, ...]:
    """Return a drag over the square of the speed that grows and falls in time."""
    last = max(frame.scenario.duration_s, 1.0)
    knots = np.linspace(0.0, last, _KNOTS + 1)
    # where much happens early, as of a decay, knots stand closer there
    knots = last * (knots / last) ** 1.5
    force = _worth(term, frame, values, np.asarray(1.0), knots)
    area = np.broadcast_to(2.0 * force / frame.ship.water.density_kg_m3, knots.shape)
    turns = [Turn(0.0, _FOR_EVER_S, 0.0, float(area[0]))]
    for start, end, more in zip(knots[:-1], knots[1:], np.diff(area), strict=True):
        edge = float(end - start)
        turns.append(Turn(float(start) + 0.5 * edge, _FOR_EVER_S, 0.0, float(more), edge_s=edge))
    return tuple(turn for turn in turns if turn.drag_area_m2 != 0.0)
