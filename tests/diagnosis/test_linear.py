# SPDX-License-Identifier: Apache-2.0
"""Hypotheses made linear about a real run: derivatives, batches, context."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.coast_terms import RunNuisance
from shipdrag_ros.diagnosis.model import start
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.simulated import _Batch
from shipdrag_ros.estimation import Window
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import find
from shipdrag_ros.simulation.sensors import lagged

SHIP = Ship.load(Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml')
INPUTS = (
    'speed_through_water',
    'position',
    'speed_over_ground',
    'heading',
    'shaft',
    'wind_apparent',
    'depth',
)


@pytest.fixture(scope='module')
def model() -> CoastModel:
    scenario = Scenario(speed_m_s=8.0, lead_in_s=1200.0, duration_s=1200.0, heading_rad=0.7)
    truth = simulate(SHIP, scenario)
    block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0, inputs=INPUTS), seed=5)
    first = int(block.stamp_ns.min())
    window = Window.from_block(
        block, first + 1200 * 10**9, int(block.stamp_ns.max()), before_ns=first
    )
    seen = Observation.of(window, SHIP, Parameters(), name='run')
    return CoastModel(SHIP, (seen,), seen.heading_rad)


def test_an_observation_is_condensed_and_knows_the_stop(model: CoastModel) -> None:
    seen = model.seen[0]
    assert seen.heading_rad == pytest.approx(0.7, abs=0.01)
    # it ends with the last whole bin
    assert seen.duration_s == pytest.approx(1200.0, abs=15.0)
    assert 1100.0 < seen.lead_in_s <= 1200.0
    assert seen.speed_m_s == pytest.approx(8.0, abs=0.05)
    assert len(seen.along) < 500
    assert set(seen.along.rows.kind.tolist()) == {0, 1, 2}


def test_what_is_right_leaves_only_noise(model: CoastModel) -> None:
    nothing = model.nothing
    linear = model.linearise([nothing], [start(model, nothing)])[0]
    n = len(model.seen[0].along)
    white = linear.tables[0][0]
    kind = model.seen[0].along.rows.kind
    # the place is not fitted yet
    assert np.mean(white[:n][kind != 2] ** 2) < 1.6


@pytest.mark.parametrize('name', ['current', 'fouling', 'wind', 'log_lag', 'shallow_water'])
def test_the_derivatives_are_those_of_the_residual(model: CoastModel, name: str) -> None:
    hypothesis = model.with_effect(model.nothing, find(name))[0]
    z = start(model, hypothesis)
    count = len(hypothesis.unknowns)
    step = 0.05
    moved = []
    for i in range(len(z)):
        other = z.copy()
        other[i] += step if i < count else 0.01
        moved.append(other)
    base, *others = model.linearise([hypothesis] * (1 + len(z)), [z, *moved])
    table = base.tables[0]
    size = np.sqrt(np.mean(table[1:] ** 2, axis=1))
    for i, other in enumerate(others):
        change = (table[0] - other.tables[0][0]) / (step if i < count else 0.01)
        off = np.sqrt(np.mean((change - table[1 + i]) ** 2))
        assert off < 0.05 * size[i] + 1e-6, (i, [u.name for u in hypothesis.unknowns][i])


def test_a_slow_log_moves_the_stop_of_its_own_rows_alone(model: CoastModel) -> None:
    seen, nothing = model.seen[0], model.nothing
    base = model.predict(0, model.linearise([nothing], [start(model, nothing)])[0])
    slow = replace(base, log=lagged(seen.time_s, base.log, 60.0))
    (run,) = (term for term in nothing.measurement_terms if isinstance(term, RunNuisance))
    plain, late = (run.columns(seen, 0, each)[0] for each in (base, slow))
    by_log = seen.along.rows.kind == LOG
    np.testing.assert_array_equal(late[:, ~by_log], plain[:, ~by_log])
    assert np.abs(late[3, by_log] - plain[3, by_log]).max() > 0.01


def test_hypotheses_together_are_as_each_alone(model: CoastModel) -> None:
    every = [model.nothing, *model.with_effect(model.nothing, find('turning'))[:2]]
    starts = [start(model, hypothesis) for hypothesis in every]
    together = model.linearise(every, starts)
    for hypothesis, z, one in zip(every, starts, together, strict=True):
        alone = model.linearise([hypothesis], [z])[0]
        np.testing.assert_allclose(one.tables[0], alone.tables[0], rtol=1e-9, atol=1e-9)


def test_derivatives_by_the_baseline_can_be_kept(model: CoastModel) -> None:
    hypothesis = model.with_effect(model.nothing, find('fouling'))[0]
    z = start(model, hypothesis)
    once = model.linearise([hypothesis], [z])[0]
    again = model.linearise([hypothesis], [z], [once])[0]
    np.testing.assert_allclose(again.tables[0], once.tables[0], rtol=1e-9, atol=1e-9)


def test_wind_and_depth_are_felt_by_their_sensors(model: CoastModel) -> None:
    context = model.seen[0].context
    for name, rows in (('wind', slice(0, 2 * len(context.at_wind))), ('shallow_water', None)):
        hypothesis = model.with_effect(model.nothing, find(name))[0]
        z = start(model, hypothesis)
        place = next(p for part, p in hypothesis.parts if part is hypothesis.terms[-1])
        z[place] = 0.5 if name == 'wind' else -0.5
        table = model.linearise([hypothesis], [z])[0].tables[0]
        behind = table[0][len(table[0]) - len(context) :]
        at = rows or slice(2 * len(context.at_wind), 2 * len(context.at_wind) + 1)
        assert np.abs(behind[at]).max() > 3.0


def test_effects_that_a_ship_file_states_are_part_of_the_model(model: CoastModel) -> None:
    fouled = Ship.from_yaml(
        SHIP.to_yaml().replace(
            'effects: []',
            'effects:\n- name: fouling\n  parameters: {friction_factor: {value: 0.3, sd: 0.01}}',
        ),
        subject='ship',
    )
    assert fouled.effects
    stated = replace(model, ship=fouled)
    slower = stated.linearise([stated.nothing], [start(stated, stated.nothing)])[0]
    clean = model.linearise([model.nothing], [start(model, model.nothing)])[0]
    n = len(model.seen[0].along)
    log = model.seen[0].along.rows.kind == 0
    coast = model.seen[0].along.rows.time_s > model.seen[0].lead_in_s + 300.0
    at = np.flatnonzero(log & coast)
    assert np.all(slower.residuals[0][:n][at] > clean.residuals[0][:n][at] + 0.05)


def test_a_column_that_is_asked_for_twice_is_simulated_once() -> None:
    batch = _Batch()
    wind, calm = Action(wind_m_s=(3.0, 0.0)), Action()
    asked = [(calm, 8.0), (wind, 8.0), (calm + wind, 8.0), (calm, 8.01), (calm, 8.0)]
    assert [batch.add(*each) for each in asked] == [0, 1, 1, 2, 0]
    assert batch.actions == [calm, wind, calm]
    assert batch.speeds == [8.0, 8.0, 8.01]


def test_lines_are_whitened_alike_whatever_lines_of_0_stand_between(model: CoastModel) -> None:
    seen = model.seen[0]
    assert seen.across is not None
    rows = len(seen.along) + len(seen.across) + len(seen.context)
    lines = np.random.default_rng(3).standard_normal((2, rows))
    nothing = np.zeros(rows)
    found = model._whitened(0, np.array([lines[0], nothing, lines[1]]))
    assert np.array_equal(found[[0, 2]], model._whitened(0, lines))
    assert not found[1].any()
    assert found[0, 0] == pytest.approx(seen.along.whitener[0, 0] * lines[0, 0])
