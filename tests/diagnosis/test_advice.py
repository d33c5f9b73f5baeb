# SPDX-License-Identifier: Apache-2.0
"""What is advised is simulated, ranked, and decides where it is predicted to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.advice import PredictedOutcome, with_known
from shipdrag_ros.diagnosis.observation import Observation, ship_runs
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.compare import Comparing
from shipdrag_ros.ship import Fact
from shipdrag_ros.simulation.effect import Cost, Measure
from tests.runs import CARGO as SHIP
from tests.runs import coasted

MOTION = ('speed_through_water', 'position')
HEADING_RAD = 0.3


def run(effect: str, *more: str, heading_rad: float = HEADING_RAD, seed: int = 1) -> CoastRun:
    return coasted(
        effect,
        heading_rad=heading_rad,
        reference_rad=HEADING_RAD,
        rate_hz=0.5,
        inputs=(*MOTION, *more),
        seed=seed,
    )


def resolves(found: DiagnosisResult) -> dict[Measure, float | None]:
    """Return what is measured, of what is advised; facts are asked for besides."""
    known = {measure.value for measure in Measure}
    return {
        Measure(each.measure): each.probability
        for each in found.would_decide
        if each.measure in known
    }


@pytest.fixture(scope='module')
def current() -> DiagnosisResult:
    """A current, seen in one run, which may be an offset of the log as well."""
    return diagnose([run('current=0.2')], SHIP, Parameters())


def test_reciprocal_run_is_advised_for_a_current_and_names_it(current: DiagnosisResult) -> None:
    assert current.verdict is Verdict.ONE_OF
    assert (resolves(current)[Measure.RECIPROCAL_RUN] or 0.0) > 0.3
    assert Measure.ANOTHER_COURSE in resolves(current)
    back = run('current=0.2', heading_rad=HEADING_RAD + math.pi, seed=2)
    after = diagnose([run('current=0.2'), back], SHIP, Parameters())
    assert [effect.name for effect in after.effects] == ['current']
    assert after.would_decide == ()


def test_advice_is_ranked_and_its_probabilities_are_some(current: DiagnosisResult) -> None:
    known = [each for each in current.would_decide if each.probability is not None]
    assert known
    assert all(0.0 <= (each.probability or 0.0) <= 1.0 for each in known)
    # what is likely to need the fewest hours of the ship comes first
    hours = [Cost(each.cost).hours / (each.probability or 0.0) for each in known]
    assert hours == sorted(hours)


def test_a_fact_that_would_decide_is_asked_for_before_anything_that_costs_more() -> None:
    found = diagnose([run('towed_cable=6')], SHIP, Parameters())
    assert found.verdict is Verdict.ONE_OF
    asked = [each for each in found.would_decide if '--fact no_towed_cable' in each.measure]
    (at,) = asked
    assert at.cost == Cost.LOOK
    ranked = [each.measure for each in found.would_decide]
    assert ranked.index(at.measure) < ranked.index(Measure.WITHOUT_CABLE)
    told = diagnose([run('towed_cable=6')], SHIP, Parameters(), facts=[Fact('no_towed_cable')])
    assert not any('--fact no_towed_cable' in each.measure for each in told.would_decide)


def test_echo_sounder_would_name_shallow_water_as_often_as_it_is_shallow() -> None:
    found = diagnose([run('shallow_water=12')], SHIP, Parameters())
    assert found.verdict is Verdict.ONE_OF
    (shallow,) = (each for each in found.candidates if each.names == ('shallow_water',))
    predicted = resolves(found)[Measure.DEPTH]
    assert predicted is not None
    # an echo sounder excludes one candidate only, and hardly lifts the others
    assert abs(predicted - shallow.probability) < 0.1
    after = diagnose([run('shallow_water=12', 'depth')], SHIP, Parameters())
    assert [effect.name for effect in after.effects] == ['shallow_water']
    # what cannot be simulated stands by what it could decide: all, if it is the cable
    assert resolves(found)[Measure.WITHOUT_CABLE] is None
    ranked = list(resolves(found))
    assert found.candidates[0].names == ('towed_cable',)
    # a look at the echo sounder costs less than to haul a cable in
    assert ranked.index(Measure.DEPTH) < ranked.index(Measure.WITHOUT_CABLE)
    assert ranked.index(Measure.WITHOUT_CABLE) < ranked.index(Measure.CLEAN_HULL)


def test_a_run_that_shows_the_same_again_is_not_said_to_decide() -> None:
    first, again = (run('fouling=0.3', seed=seed) for seed in (1, 2))
    found = diagnose([first], SHIP, Parameters())
    assert (resolves(found).get(Measure.ANOTHER_RUN) or 0.0) < 0.3
    assert diagnose([first, again], SHIP, Parameters()).verdict is Verdict.ONE_OF


def test_what_is_measured_already_is_not_advised(current: DiagnosisResult) -> None:
    assert Measure.RADAR not in resolves(current)
    with_wind = diagnose([run('current=0.2', 'wind_apparent')], SHIP, Parameters())
    assert with_wind.verdict is Verdict.ONE_OF
    assert Measure.WIND not in resolves(with_wind)


@pytest.mark.parametrize('known_s', [0.0, 0.1])
def test_stop_that_is_read_from_a_shaft_is_one_row_more(known_s: float) -> None:
    window = run('current=0.2').window
    seen = Observation.of(window, SHIP, Parameters(), name='first')
    comparing = Comparing(ship_runs((seen,), SHIP), SHIP, ())
    one = comparing.fit_nothing()
    count = len(one.at)
    before = PredictedOutcome(np.zeros(0), np.zeros((count, 0)), np.eye(count), np.eye(count))
    (after,) = with_known(comparing, [one], [before], {motion.STOP: [known_s]})
    if known_s == 0.0:
        assert after.mean.shape == (0,)
        return
    place = int(comparing.runs.places[0][comparing.runs.coefficients + motion.STOP])
    slope = np.zeros((count, 1))
    slope[place] = 1.0 / known_s
    np.testing.assert_allclose(after.slope, slope, rtol=1e-12)
    np.testing.assert_allclose(after.mean, one.at @ slope, rtol=1e-12)
