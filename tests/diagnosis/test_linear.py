# SPDX-License-Identifier: Apache-2.0
"""A run as it is seen, and hypotheses about it made linear: derivatives, batches, context."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.diagnosis.diagnose import compare
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.observation import Observation, ship_runs
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation, ShipRuns
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effects import find
from tests.runs import CARGO as SHIP
from tests.runs import coasted


@pytest.fixture(scope='module')
def seen() -> Observation:
    context = ('speed_over_ground', 'heading', 'shaft', 'wind_apparent', 'depth')
    inputs = ('speed_through_water', 'position', *context)
    run = coasted(heading_rad=0.7, inputs=inputs, seed=5)
    return Observation.of(run.window, SHIP, Parameters(), name='run')


@pytest.fixture(scope='module')
def runs(seen: Observation) -> ShipRuns:
    return ship_runs((seen,), SHIP)


def test_a_motion_that_cannot_be_computed_is_refused_in_words(seen: Observation) -> None:
    comparing = compare((seen,), SHIP, Facts(SHIP))
    comparing.runs.start[0] = np.nan
    with pytest.raises(
        DiagnosisError, match='cannot be computed at the speeds of the runs: check'
    ):
        comparing.fit_nothing()


def test_an_observation_is_condensed_and_knows_the_stop(seen: Observation) -> None:
    assert seen.heading_rad == pytest.approx(0.7, abs=0.01)
    # it ends with the last whole bin
    assert seen.duration_s == pytest.approx(1200.0, abs=15.0)
    assert 1100.0 < seen.lead_in_s < 1200.5
    assert seen.speed_m_s == pytest.approx(8.0, abs=0.05)
    assert len(seen.along) < 500
    assert set(seen.along.rows.kind.tolist()) == {0, 1, 2}


def with_effect(runs: ShipRuns, name: str) -> tuple[Explanation, Float64]:
    """Return an effect, and unknowns near its start."""
    hypothesis = Explanation((next(ways_of(find(name), SHIP, 1200.0, 1)),))
    at = np.zeros(runs.width(hypothesis))
    at[: runs.size] = runs.start
    at[runs.size : runs.size + len(hypothesis.unknowns)] = 0.3
    return hypothesis, at


@pytest.mark.parametrize('name', ['current', 'fouling', 'wind', 'log_lag', 'shallow_water'])
def test_the_derivatives_by_an_effect_are_those_of_the_residual(runs: ShipRuns, name: str) -> None:
    hypothesis, at = with_effect(runs, name)
    step, count = 0.02, len(hypothesis.unknowns)
    moved = []
    for i in range(count):
        moved.append(at.copy())
        moved[-1][runs.size + i] += step
    base, *others = runs.linearise_run(0, [hypothesis] * (1 + count), [at, *moved])
    assert base is not None
    for i, other in enumerate(others):
        assert other is not None
        line = int(np.flatnonzero(base.place == runs.size + i)[0])
        for now, then in ((base.along, other.along), (base.rest, other.rest)):
            off = (now[0] - then[0]) / step - now[1 + line]
            size = np.sqrt(np.mean(now[1 + line] ** 2))
            assert np.sqrt(np.mean(off**2)) < 0.05 * size + 1e-6


def test_hypotheses_together_are_as_each_alone(runs: ShipRuns) -> None:
    every = [with_effect(runs, name) for name in ('turning', 'current', 'fouling')]
    together = runs.linearise_run(0, [each for each, _ in every], [at for _, at in every])
    for (hypothesis, at), one in zip(every, together, strict=True):
        (alone,) = runs.linearise_run(0, [hypothesis], [at])
        assert one is not None
        assert alone is not None
        np.testing.assert_allclose(one.along, alone.along, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one.rest, alone.rest, rtol=1e-9, atol=1e-9)


def test_wind_and_depth_are_felt_by_their_sensors(seen: Observation, runs: ShipRuns) -> None:
    assert seen.across is not None
    winds, first = 2 * len(seen.context.at_wind), len(seen.across)
    for name, at in (('wind', slice(0, winds)), ('shallow_water', slice(winds, winds + 1))):
        hypothesis, where = with_effect(runs, name)
        where[runs.size] = 0.5 if name == 'wind' else -0.5
        (table,) = runs.linearise_run(0, [hypothesis], [where])
        assert table is not None
        assert np.abs(table.rest[0, first:][at]).max() > 3.0
