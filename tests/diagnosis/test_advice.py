# SPDX-License-Identifier: Apache-2.0
"""What is advised is simulated, ranked, and decides where it is predicted to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.advice import PredictedOutcome, probability_of_naming, with_known
from shipdrag_ros.diagnosis.observation import Observation, ship_runs
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.inference.decision import CERTAIN, Verdict, Weighed
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.compare import Comparing
from shipdrag_ros.ship import Fact
from shipdrag_ros.simulation.effect import Cost, Measure
from tests.runs import CARGO as SHIP
from tests.runs import coasted

MOTION = ('speed_through_water', 'position')
HEADING_RAD = 0.3


def run(effect: str, *more: str, seed: int = 1) -> CoastRun:
    return coasted(
        effect,
        heading_rad=HEADING_RAD,
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


def test_reciprocal_run_is_advised_for_a_current(current: DiagnosisResult) -> None:
    assert current.verdict is Verdict.ONE_OF
    assert (resolves(current)[Measure.RECIPROCAL_RUN] or 0.0) > 0.3
    assert Measure.ANOTHER_COURSE in resolves(current)


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
    both = diagnose([first, again], SHIP, Parameters(), advise=False)
    assert both.verdict is Verdict.ONE_OF


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


DRAWN = 0.06  # twice the sd of a share of 300 draws
NOTHING: Weighed = ((), -60.0)
HULL, WIND, CABLE = ('fouling',), ('wind',), ('towed_cable',)


def prospect(mean: list[float], *, sd: float = 0.0) -> PredictedOutcome:
    """Rows with a mean that is uncertain in the first of them."""
    slope = np.zeros((1, len(mean)))
    slope[0, 0] = sd
    return PredictedOutcome(np.array(mean), slope, np.eye(1), np.eye(1))


def rivals(share: dict[tuple[str, ...], float]) -> list[Weighed]:
    return [*((names, math.log(p)) for names, p in share.items()), NOTHING]


def resolved(prospects: list[PredictedOutcome], found: list[Weighed]) -> float:
    """With one way in which the measurement is read; nothing predicts what the first does."""
    outcomes = [*prospects, prospects[0]]
    return probability_of_naming([outcomes], [0] * len(outcomes), found, inseparable=())


@pytest.mark.parametrize('apart', [0.0, 1.0, 3.0, 6.0])
@pytest.mark.parametrize('first', [0.5, 0.8])
def test_two_known_means(apart: float, first: float) -> None:
    both = [prospect([0.0, 0.0]), prospect([0.0, apart])]
    found = resolved(both, rivals({HULL: first, WIND: 1.0 - first}))
    expected = 0.0
    for share in (first, 1.0 - first) if apart > 0.0 else ():
        # ln of the odds of what is true is normal, mean D/2 and variance D about what it was
        mean = 0.5 * apart**2 + math.log(share / (1.0 - share))
        needed = math.log(CERTAIN / (1.0 - CERTAIN))
        right, wrong = ndtr((mean - needed) / apart), ndtr((-mean - needed) / apart)
        expected += share * float(right + wrong)
    assert found == pytest.approx(expected, abs=DRAWN)


def test_what_is_open_in_both_tells_nothing_apart() -> None:
    alike = rivals({HULL: 0.5, WIND: 0.5})
    assert resolved([prospect([0.0]), prospect([6.0])], alike) > 0.95
    assert resolved([prospect([0.0], sd=50.0), prospect([6.0], sd=50.0)], alike) == 0.0


def test_each_truth_is_read_in_its_own_way() -> None:
    alike = [prospect([0.0]), prospect([0.0]), prospect([0.0])]
    apart = [prospect([0.0]), prospect([9.0]), prospect([0.0])]
    found = probability_of_naming(
        [alike, apart], [0, 1, 0], rivals({HULL: 0.5, WIND: 0.5}), inseparable=()
    )
    assert found == pytest.approx(0.5, abs=0.01)


def test_third_rival_that_is_not_told_apart_keeps_a_set() -> None:
    three = [prospect([0.0]), prospect([8.0]), prospect([8.0])]
    found = resolved(three, rivals({HULL: 0.4, WIND: 0.3, CABLE: 0.3}))
    assert found == pytest.approx(0.4, abs=0.02)


def test_what_no_record_tells_apart_is_never_named() -> None:
    both = [prospect([0.0]), prospect([9.0]), prospect([0.0])]
    inseparable = [frozenset((WIND[0], 'waves'))]
    share = rivals({HULL: 0.3, WIND: 0.7})
    found = probability_of_naming([both], [0, 0, 0], share, inseparable=inseparable)
    assert found == pytest.approx(0.3, abs=0.02)


def test_a_name_that_every_rival_holds_is_named_already() -> None:
    alone, pair = (HULL, math.log(0.6)), (('fouling', 'wind'), math.log(0.4))
    same = [prospect([0.0]), prospect([0.0]), prospect([0.0])]
    assert probability_of_naming([same], [0, 0, 0], [alone, pair, NOTHING], inseparable=()) == 1.0
