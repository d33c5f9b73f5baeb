# SPDX-License-Identifier: Apache-2.0
"""r(v) in calm deep water, and in the wind and depth of the run."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import summary
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.facts import parse_fact
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate
from tests.runs import CARGO as SHIP
from tests.runs import cut

BARE = replace(SHIP, baseline=None)
SPEEDS = np.array([3.0, 5.0, 7.0])
WINDS = ((6.0, 0.0), (-6.0, 2.0), (0.0, 6.0), (4.0, -4.0))  # from ahead, from port [m/s]
LEAD_S, COAST_S = 300.0, 900.0


def coast(
    ship: Ship,
    wind: tuple[float, float] = (0.0, 0.0),
    *,
    depth_m: float = 0.0,
    measured: bool = False,
    seed: int = 0,
) -> Estimate:
    """Estimate a coastdown in some weather, which an anemometer and an echo sounder may read."""
    head, cross = (Parameter(each) for each in wind)
    effects = [StatedEffect('wind', {'head_m_s': head, 'cross_m_s': cross})]
    if depth_m:
        effects.append(StatedEffect('shallow_water', {'depth_m': Parameter(depth_m)}))
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_S, duration_s=COAST_S, seed=seed)
    sensors = [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=0.5, sd=0.05),
        Sensor(channel=Channel.POSITION, rate_hz=0.5, sd=3.0),
        Sensor(channel=Channel.SHAFT, rate_hz=0.5, sd=0.02),
    ]
    if measured:
        sensors.append(Sensor(channel=Channel.WIND_APPARENT, rate_hz=0.5, sd=0.3))
        sensors.append(Sensor(channel=Channel.DEPTH, rate_hz=0.2, sd=0.3))
    block = sense(simulate(SHIP, scenario, effects=effects), sensors, seed=seed)
    return estimate_final(cut(block, LEAD_S), ship, Parameters())


def off(found: Estimate, *, calm: bool) -> tuple[Float64, Float64]:
    """Return the error of r and its sigma, both over the true r in calm deep water."""
    true = np.asarray(SHIP.resistance_n(SPEEDS)) / SHIP.mass_kg
    curve = found.calm if calm else found.conditions
    r, sd = (
        np.interp(SPEEDS, curve.speed_m_s, each)
        for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
    )
    return r / true - 1.0, sd / true


@pytest.mark.parametrize('ship', [SHIP, BARE], ids=['baseline', 'bare'])
def test_a_wind_that_is_measured_halves_the_scatter_from_run_to_run(ship: Ship) -> None:
    errors = {}
    for measured in (False, True):
        runs = [coast(ship, wind, measured=measured, seed=seed) for seed, wind in enumerate(WINDS)]
        errors[measured] = np.array([off(run, calm=True)[0] for run in runs])
        within = [abs(off(run, calm=True)[0]) < 2.0 * off(run, calm=True)[1] for run in runs]
        assert np.mean(within) > 0.8
    scatter = {measured: each.std(axis=0) for measured, each in errors.items()}
    assert np.all(scatter[True] < 0.5 * scatter[False])
    assert np.all(np.abs(errors[True]) < 0.02)


def test_a_wind_stays_in_the_curve_of_the_run_and_is_shown_where_it_is_not_known() -> None:
    found = coast(BARE, WINDS[0])
    calm, of_run = (off(found, calm=which)[0] for which in (True, False))
    # air of 6 m/s from ahead: 0.5 1.225 A C ((u + 6)^2 - u^2) over r
    assert SHIP.air is not None
    air = np.asarray(SHIP.air_drag_n(SPEEDS + 6.0) - SHIP.air_drag_n(SPEEDS))
    added = air / np.asarray(SHIP.resistance_n(SPEEDS))
    np.testing.assert_allclose(of_run, added, atol=0.03)
    assert np.all(np.abs(calm) < 0.6 * added)
    assert found.reference.unknown == ('wind', 'depth')
    assert found.curve is found.conditions
    said = summary(found)[-1]
    assert 'in the wind and depth of the run, which are not known' in said
    assert 'In calm deep water, whatever the weather was' in said
    first, second = re.findall(r'at (\S+) m/s[:.]', said)
    assert first == second  # one speed for both figures


def test_shallow_water_that_is_measured_is_taken_out() -> None:
    draught = SHIP.draught_m
    assert draught is not None
    found = coast(BARE, depth_m=2.0 * draught, measured=True)
    calm, sd = off(found, calm=True)
    assert np.all(np.abs(calm) < 2.0 * sd)
    assert np.all(off(found, calm=False)[0] > 0.08)
    assert found.reference.unknown == ()
    assert found.curve is found.calm
    assert 'of the ship in calm deep water' in summary(found)[-1]


def test_the_parts_of_sigma_add_up() -> None:
    for ship in (SHIP, BARE):
        found = coast(ship, WINDS[0])
        causes = ['n_r', 'log', 'ground', 'held_force', 'wind', 'depth', 'law', 'noise']
        assert list(found.sigma_parts) == causes
        total = sum(part**2 for part in found.sigma_parts.values())
        np.testing.assert_allclose(np.sqrt(total), found.calm.sigma_m_s2, rtol=1e-6)


def test_a_fact_is_a_statement_and_narrows_the_band() -> None:
    stated = tuple(parse_fact(name) for name in ('calm', 'deep_water'))
    plain, known = coast(BARE), coast(replace(BARE, facts=stated))
    assert {name: how.value for name, how in vars(known.reference).items()} == dict.fromkeys(
        ('wind', 'depth', 'waves'), 'stated'
    )
    assert np.all(off(known, calm=True)[1] < 0.95 * off(plain, calm=True)[1])
    assert np.all(np.abs(off(known, calm=True)[0]) < 2.0 * off(known, calm=True)[1])
    waves = replace(BARE, facts=(parse_fact('no_waves'),))
    assert coast(waves).reference.unknown == ('wind', 'depth')
