# SPDX-License-Identifier: Apache-2.0
"""A force that swings from the stop on is something, however well noise could follow it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.model import start
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.diagnosis.swinging import swing_notes, swinging, swung, with_swinging
from shipdrag_ros.inference.rows import POSITION
from shipdrag_ros.samples import Float64

STEP_S = 0.5


def coast(seen: Observation, force_m_s2: Float64) -> tuple[Float64, Float64]:
    """Return speed and way of a ship from her steady speed on, under a force over the mass."""
    ship, speed, way = seen.ship, seen.speed_m_s, 0.0
    speeds, ways = [speed], [way]
    for pushed in force_m_s2[:-1]:
        retarded = float(ship.resistance_n(speed)) / ship.mass_kg
        way += STEP_S * speed
        speed += STEP_S * (pushed - retarded) / (1.0 + float(ship.n_r(speed)))
        speeds.append(speed)
        ways.append(way)
    return np.array(speeds), np.array(ways)


def swung_rows(seen: Observation, share: float, period_s: float) -> Float64:
    """Return what a swinging force does to the rows, by the whole equation of motion."""
    time = np.arange(0.0, seen.duration_s + STEP_S, STEP_S)
    r_m_s2 = float(seen.ship.resistance_n(seen.speed_m_s)) / seen.ship.mass_kg
    force = share * r_m_s2 * np.sin(2.0 * np.pi * time / period_s)
    (with_it, way), (without, way_without) = coast(seen, force), coast(seen, np.zeros_like(force))
    since = seen.along.rows.time_s - seen.lead_in_s
    by_speed = np.interp(since, time, with_it - without)
    by_way = np.interp(since, time, way - way_without)
    changed = np.where(seen.along.rows.kind == POSITION, by_way, by_speed)
    return np.where(since > 0.0, changed, 0.0)


def swung_model(model: CoastModel, share: float, period_s: float) -> CoastModel:
    """Return the same run under a swinging force."""
    (seen,) = model.seen
    rows = seen.along.rows
    value = rows.value + swung_rows(seen, share, period_s)
    along = replace(seen.along, rows=rows._replace(value=value))
    return replace(model, seen=(replace(seen, along=along),))


def found_in(model: CoastModel) -> SearchResult:
    """Return the fit of nothing alone, and what swings."""
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    return with_swinging(SearchResult(model, nothing, (nothing,)), model)


def test_the_response_is_that_of_the_equation_of_motion(
    model_of: Callable[..., CoastModel],
) -> None:
    model = model_of()
    (seen,) = model.seen
    exact = swung_rows(seen, 0.05, 240.0)
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    speed = model.predict(0, nothing.best).speed
    r_m_s2 = float(seen.ship.resistance_n(seen.speed_m_s)) / seen.ship.mass_kg
    linear = 0.05 * r_m_s2 * swung(seen, speed, np.array([240.0]))[0]
    of_way = seen.along.rows.kind == POSITION
    for own in (of_way, ~of_way):
        assert np.abs(linear[own] - exact[own]).max() < 0.06 * np.abs(exact[own]).max()


@pytest.mark.parametrize(('share', 'period_s'), [(0.2, 240.0), (0.1, 120.0)])
def test_a_swinging_force_is_more_probable_than_nothing(
    model_of: Callable[..., CoastModel], share: float, period_s: float
) -> None:
    model = swung_model(model_of(), share, period_s)
    found = found_in(model)
    assert found.posterior.unnamed > 0.99
    (swings,) = found.smooth
    (told,) = swing_notes(swings, model)
    assert 'run: a force swings over about' in told
    at_s = float(told.split('about ')[1].split(' s')[0])
    by = float(told.split('by ')[1].split(' %')[0])
    assert at_s == pytest.approx(period_s, rel=0.1)
    assert by == pytest.approx(100.0 * share, rel=0.25)


def test_noise_alone_swings_nothing(model_of: Callable[..., CoastModel]) -> None:
    found = found_in(model_of())
    assert found.posterior.nothing > 0.95
    assert swing_notes(found.nothing, model_of()) == ()


def test_an_effect_that_is_missing_is_no_swing(model_of: Callable[..., CoastModel]) -> None:
    model = model_of('current=0.4')
    effect = next(each for each in model.effects if each.name == 'current')
    (hypothesis, *_) = model.with_effect(model.nothing, effect)
    named = fit(model, [hypothesis], [start(model, hypothesis)])[0]
    swings = swinging(model, named)
    assert swings is None or swings.log_likelihood < named.log_likelihood + 1.0
