# SPDX-License-Identifier: Apache-2.0
"""Facts are evidence: they name what the data leave open, and are doubted where those object."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shipdrag_ros.diagnosis import diagnose
from shipdrag_ros.diagnosis.facts import Facts, StatedFact, stated_facts
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Fact, Propeller, Ship
from shipdrag_ros.simulation.effects import find
from tests.runs import CARGO as SHIP
from tests.runs import coasted

YEAR_NS = round(365.25 * 86400.0 * 1e9)
CABLE, RUDDER = Fact('no_towed_cable'), Fact('helm_amidships')


def hypothesis(*names: str, only_run: int | None = None) -> Explanation:
    ways = (next(ways_of(find(name), SHIP, 1000.0, 1)) for name in names)
    return Explanation(tuple(replace(way, run=only_run) for way in ways))


def chance(fact: Fact, found: Explanation, *, ship: Ship = SHIP, run: int | None = None) -> float:
    stated = StatedFact(fact, run, YEAR_NS)
    return math.exp(Facts(ship, (stated,)).log_likelihood(found))


def test_a_fact_is_seldom_told_where_it_is_not_so() -> None:
    assert chance(CABLE, hypothesis()) == pytest.approx(0.98)
    assert chance(CABLE, hypothesis('fouling')) == pytest.approx(0.98)
    assert chance(CABLE, hypothesis('towed_cable')) == pytest.approx(0.02)
    assert chance(CABLE, hypothesis('fouling', 'towed_cable')) == pytest.approx(0.02)
    assert chance(replace(CABLE, rate=0.1), hypothesis('towed_cable')) == pytest.approx(0.1)


def test_a_fact_of_one_run_says_nothing_of_another() -> None:
    turned = hypothesis('turning', only_run=1)
    assert chance(RUDDER, turned, run=0) == pytest.approx(0.98)
    assert chance(RUDDER, turned, run=1) == pytest.approx(0.02)
    assert chance(RUDDER, turned) == pytest.approx(0.02)


def test_the_shaft_is_expected_as_the_baseline_or_the_effect_has_it() -> None:
    assert SHIP.propeller is not None
    locked = replace(SHIP, propeller=replace(SHIP.propeller, state_in_baseline='locked'))
    fact = Fact('shaft', 'locked')
    assert chance(fact, hypothesis('locked_propeller')) == pytest.approx(0.98)
    assert chance(fact, hypothesis()) == pytest.approx(0.01)
    assert chance(fact, hypothesis(), ship=locked) == pytest.approx(0.98)
    assert chance(fact, hypothesis('residual_thrust'), ship=locked) == pytest.approx(0.01)
    # one that folds may stand or turn
    folding = replace(SHIP, propeller=Propeller(diameter_m=5.0, state_in_baseline='none'))
    every = [chance(Fact('shaft', v), hypothesis(), ship=folding) for v in ('locked', 'free')]
    assert every[0] == every[1] == pytest.approx(1.0 / 3.0)


def test_a_hull_cleaned_long_ago_may_be_fouled_again() -> None:
    def at(date: str) -> float:
        return chance(Fact('hull_cleaned', date), hypothesis('fouling'))

    # the run is of 1 January 1971, 6 h
    assert at('1970-12-01') == pytest.approx(0.02, abs=0.005)
    assert 0.02 < at('1970-01-01') < 0.5
    assert at('1971-02-01') == pytest.approx(0.98)
    assert chance(Fact('hull_cleaned', '1970-12-01'), hypothesis()) == pytest.approx(0.98)


def test_a_run_overrides_the_ship_file_and_the_diagnosis_both() -> None:
    ship = replace(SHIP, facts=(CABLE, Fact('shaft', 'free')))
    runs = [((Fact('shaft', 'locked'), RUDDER), 1), ((), 2)]
    found = stated_facts(ship, runs, [replace(RUDDER, rate=0.1)]).stated
    assert {(str(each.fact), each.run) for each in found} == {
        ('helm_amidships,rate=0.1', None),
        ('no_towed_cable', None),
        ('shaft=locked', 0),
        ('shaft=free', 1),
    }


def test_a_fact_that_the_data_contradict_is_said() -> None:
    run = coasted('shallow_water=12', rate_hz=0.5, seed=3)
    inputs = ('speed_through_water', 'position', 'depth')
    depth = coasted('shallow_water=12', rate_hz=0.5, inputs=inputs, seed=3)
    found = diagnose([depth], SHIP, Parameters(), facts=[Fact('deep_water'), CABLE])
    (deep, cable) = found.facts
    assert deep.contradicted
    assert deep.wrong is not None
    assert deep.wrong > 0.9
    assert deep.against == ('shallow_water',)
    assert not cable.contradicted
    # without an echo sounder the fact is believed
    assert (
        not diagnose([run], SHIP, Parameters(), facts=[Fact('deep_water')]).facts[0].contradicted
    )
