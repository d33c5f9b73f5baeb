# SPDX-License-Identifier: Apache-2.0
"""Effects as unknowns of the model: their forces, their ways, and one that is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.parameter import Parameter, Shape, log_normal
from shipdrag_ros.posterior.effects import retardation_of as found_retardation
from shipdrag_ros.posterior.effects import stated_way, ways_of
from shipdrag_ros.posterior.priors import UNNAMED_ODDS
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import Action, Scenario, simulate_columns
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import LIBRARY, action_of, parse

TEXTS = ('fouling=0.4', 'wind=8', 'wind=-5,cross_m_s=6', 'waves=20000', 'shallow_water=20')


@pytest.mark.parametrize('text', TEXTS)
def test_the_force_of_an_effect_is_that_of_its_simulation(text: str) -> None:
    ship = Ship.example()
    scenario = Scenario(speed_m_s=7.0, lead_in_s=60.0, duration_s=400.0, heading_rad=0.4)
    frame = Frame(ship, scenario, 0.4)
    action = action_of(frame, [parse(text)])
    time = np.arange(62.0, 440.0, 2.0)
    both = simulate_columns(ship, scenario, [Action(), action], time)
    speed = both.speed_through_water_m_s
    slower = -np.gradient(speed[1], time)
    u, n_r = speed[1], ship.n_r(speed[1])
    r, inertia = found_retardation(action, frame, u)
    late = time > 60.0 + 12.0 * (ship.propulsion.run_down_s if ship.propulsion else 0.0)
    late[-2:] = False  # one-sided differences
    shown = (ship.resistance_n(u) / ship.mass_kg + r) / (1.0 + n_r + inertia)
    np.testing.assert_allclose(slower[late], shown[late], rtol=2e-3)


def test_every_effect_of_the_library_has_ways_that_act() -> None:
    ship = Ship.example()
    frame = Frame(ship, Scenario(speed_m_s=7.0, duration_s=600.0), 0.0)
    for effect in LIBRARY.values():
        if effect.missing(ship):
            continue
        ways = list(ways_of(effect, ship, 600.0, 2))
        odds = {way.mode: (way.nameless, np.exp(way.log_odds)) for way in ways}
        named, nameless = (sum(p for n, p in odds.values() if n is each) for each in (False, True))
        assert np.isclose(named, effect.odds), effect.name
        assert np.isclose(nameless, UNNAMED_ODDS.mean if effect.nameless_at else 0.0), effect.name
        for way in ways:
            assert way.action(frame, way.tried()) != Action(), effect.name
            assert len(way.start) == len(way.unknowns)


def test_a_size_goes_there_and_back() -> None:
    for prior in (log_normal(0.2, 0.5), log_normal(-3.0, 0.7)):
        assert prior.shape is Shape.LOG_NORMAL
        for z in (-1.3, 0.0, 2.0):
            assert prior.inverse(prior.at(z)) == pytest.approx(z, abs=1e-12)
    with pytest.raises(ValueError, match='no z of a value'):
        replace(log_normal(1.0, 1.0), shape=Shape.CHOICE).inverse(1.0)


def test_a_pair_begins_with_as_much_of_a_current_as_is_left_beside_the_other() -> None:
    (current, *_) = ways_of(LIBRARY['current'], Ship.example(), 600.0, 1)
    found_alone = replace(current, start=(1.2, *current.start[1:]))
    assert found_alone.resized(0.25) == pytest.approx(0.3)
    delays = list(ways_of(LIBRARY['time_offset'], Ship.example(), 600.0, 1))
    assert delays[0].start == (0.0,)  # which sailing begins with
    assert {way.resized(0.25) for way in delays[1:]} == {way.start[0] for way in delays[1:]}


def test_a_size_that_the_file_hardly_knows_keeps_its_sign() -> None:
    given = {'force_n': 4e4, 'from': -1.0, 'wave_length_m': 90.0}
    hardly = {n: Parameter(v, 0.0 if n == 'from' else 2.0 * abs(v)) for n, v in given.items()}
    ship = Ship.example()
    way = stated_way(StatedEffect('waves', hardly), ship)
    frame = Frame(ship, Scenario(speed_m_s=6.0), 0.0)
    for z in (-3.0, 0.0, 3.0):
        assert way.action(frame, [z] * len(way.unknowns)).wave_encounter_s_m > 0.0
    values = [q.prior.at(0.0) for q in way.unknowns]
    assert values == list(given.values())
