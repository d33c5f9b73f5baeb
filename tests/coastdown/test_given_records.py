# SPDX-License-Identifier: Apache-2.0
"""Measured records with thrust, brakes, turns and sternway in them, cut to what is a coastdown."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.given import GivenPart, estimate_given
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SHAFTS, Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship, Water

pytestmark = pytest.mark.skipif(
    'SHIPDRAG_DATA' not in os.environ, reason='needs the folder of records in SHIPDRAG_DATA'
)
SHIPS = Path(__file__).resolve().parents[2] / 'benchmarks' / 'ships'
RPM = np.pi / 30.0
FRESH = Water(density_kg_m3=1000.0, kinematic_viscosity_m2_s=1.1e-6)
BLUEBOAT = Ship(
    length_m=1.2,
    displaced_volume_m3=0.0165,
    water=FRESH,
    added_mass=ConstantAddedMass(value=0.1, sd=0.05),
)
ESSO_OSAKA = Ship(
    length_m=3.0,
    displaced_volume_m3=0.2446,
    water=FRESH,
    added_mass=ConstantAddedMass(value=0.07, sd=0.03),
)


def table(name: str) -> NDArray[np.void]:
    path = Path(os.environ['SHIPDRAG_DATA']) / name
    found: NDArray[np.void] = np.genfromtxt(path, delimiter=',', names=True)
    return found


def examined(
    ship: Ship,
    time_s: NDArray[np.float64],
    window_s: tuple[float, float],
    values: dict[Channel, NDArray[np.float64]],
    *,
    convention: str = 'rep103',
) -> GivenPart:
    """Examine a window of a record, as given by hand, and estimate."""
    stamps = np.round(time_s * 1e9).astype(np.int64)
    block = in_arrival_order([Block.of(channel, stamps, v) for channel, v in values.items()])
    start_ns, end_ns = (round(each * 1e9) for each in window_s)
    window = Window.from_block(block, start_ns, end_ns, before_ns=int(stamps[0]))
    parameters = Parameters(froude_min=0.01, heading_convention=convention)
    return estimate_given(window, ship, parameters, estimate_final)


def kept_s(found: GivenPart) -> tuple[float, float]:
    return found.start_ns / 1e9, found.end_ns / 1e9


def reasons(found: GivenPart) -> set[Dismissal]:
    return {cut.reason for cut in found.cuts}


def resistance(found: GivenPart, speed: float) -> tuple[float, float]:
    """Return r and two standard deviations."""
    assert found.estimate is not None, found.failure
    curve = found.estimate.valid_curve
    assert curve.speed_m_s[0] < speed < curve.speed_m_s[-1]
    r, sigma = (
        float(np.interp(speed, curve.speed_m_s, each))
        for each in (curve.resistance_m_s2, curve.sigma_m_s2)
    )
    return r, 2.0 * sigma


@pytest.mark.parametrize('window_s', [(0.0, 19.79), (9.5, 19.0)])
def test_a_car_accelerates_coasts_and_brakes(window_s: tuple[float, float]) -> None:
    record = table('car/shotgoose_RR-Coastdown-1_whole_100hz.csv')
    values = {Channel.SPEED_OVER_GROUND: record['v_mps']}
    found = examined(Ship.load(SHIPS / 'car.yaml'), record['t_s'], window_s, values)
    assert found.cuts[-1].reason is Dismissal.BRAKE
    assert kept_s(found)[0] == pytest.approx(9.5, abs=0.3)
    # the brake is pressed in half a second, and a bin takes up to a third of one
    assert kept_s(found)[1] == pytest.approx(17.2, abs=0.4)
    r, band = resistance(found, 7.0)
    assert abs(r - 0.82) < np.hypot(0.01, band)


def blueboat(number: int) -> dict[Channel, NDArray[np.float64]]:
    record = table(f'blueboat_{number}_10hz.csv')
    return {
        Channel.SPEED_THROUGH_WATER: record['surge'],
        Channel.HEADING: np.radians(record['yaw']),
        Channel.POSITION_GEODETIC: np.column_stack([record['lat'], record['lon']]),
        Channel.SHAFT: record['thr_l'] * RPM,
        Channel.SHAFT_2: record['thr_r'] * RPM,
    }


def test_a_catamaran_coasts_from_where_both_thrusters_stand() -> None:
    time_s = table('blueboat_222_10hz.csv')['t']
    found = examined(BLUEBOAT, time_s, (59.8, 95.3), blueboat(222), convention='compass')
    assert kept_s(found) == (pytest.approx(59.8, abs=0.15), 95.3)
    assert found.estimate is not None
    curve = found.estimate.valid_curve
    speed = np.linspace(0.65, 1.0, 50)
    # the independent figure is from the time in which these speeds are passed
    passed_s = np.mean(1.0 / np.interp(speed, curve.speed_m_s, curve.resistance_m_s2))
    sigma = np.mean(np.interp(speed, curve.speed_m_s, curve.sigma_m_s2))
    assert abs(1.0 / passed_s - 0.231) < 2.0 * sigma
    assert sigma < 0.1  # far wider than the independent figure's, but no blank cheque


def test_a_catamaran_that_goes_astern_is_refused() -> None:
    time_s = table('blueboat_221_10hz.csv')['t']
    values = blueboat(221)
    for log in (True, False):
        if not log:  # the track has no sign: the heading tells
            surge = values.pop(Channel.SPEED_THROUGH_WATER)
            values[Channel.SPEED_OVER_GROUND] = np.abs(surge)
        found = examined(BLUEBOAT, time_s, (30.5, 58.7), values, convention='compass')
        assert found.refused
        assert found.failure is not None
        assert 'the ship goes astern' in found.failure


def test_a_ferry_with_motors_running_in_the_window() -> None:
    record = table('milliampere_nlp1_t275_20hz.csv')
    values = {
        Channel.SPEED_OVER_GROUND: record['speed_mps'],
        Channel.HEADING: record['yaw_rad'],
    } | {shaft: record[f'motor{i}_rpm'] * RPM for i, shaft in enumerate(SHAFTS, start=1)}
    ship = Ship.load(SHIPS / 'ferry.yaml')
    found = examined(ship, record['t_s'], (279.0, 300.0), values, convention='compass')
    assert kept_s(found) == (pytest.approx(287.4, abs=0.5), pytest.approx(296.6, abs=0.5))
    assert Dismissal.THRUST in reasons(found)
    r, band = resistance(found, 0.116)
    assert abs(r - 0.0053) < np.hypot(0.0009, band)
    # noise of which nothing can be learnt in so short a record is in the band
    assert band < 2.7 * 0.0009


def esso_osaka(name: str) -> tuple[NDArray[np.float64], dict[Channel, NDArray[np.float64]]]:
    record = table(f'esso_osaka_3m_{name}_10hz.csv')
    return record['t_s'], {
        Channel.SPEED_THROUGH_WATER: record['u_mps'],
        Channel.HEADING: record['psi_rad'],
        Channel.SHAFT: record['prop_rps'] * 2.0 * np.pi,
        Channel.RUDDER: record['rudder_rad'],
    }


def test_a_crash_stop_leaves_no_coastdown() -> None:
    time_s, values = esso_osaka('180s')
    found = examined(ESSO_OSAKA, time_s, (180.0, 683.0), values)
    assert found.refused
    assert Dismissal.BRAKE in reasons(found)


def test_a_glide_before_a_hull_is_caught_is_all_that_is_kept() -> None:
    time_s, values = esso_osaka('180s')
    found = examined(ESSO_OSAKA, time_s, (630.0, 683.0), values)
    # kicks ahead until 656 s that hardly act, nothing until 663 s, then stopped from outside
    assert kept_s(found) == (pytest.approx(656.0, abs=3.0), pytest.approx(663.0, abs=0.5))
    assert Dismissal.BRAKE in reasons(found)


@pytest.mark.parametrize(
    ('name', 'window_s', 'reason'),
    [
        ('whole_4', (2138.0, 2165.0), Dismissal.ASTERN),
        ('whole_5', (2915.0, 2935.0), Dismissal.THRUST),
    ],
)
def test_a_propeller_that_turns_leaves_no_coastdown(name, window_s, reason):
    time_s, values = esso_osaka(name)
    found = examined(ESSO_OSAKA, time_s, window_s, values)
    assert found.refused
    assert reason in reasons(found)


def test_a_tanker_that_turns_while_it_coasts() -> None:
    time_s, values = esso_osaka('2030s')
    found = examined(ESSO_OSAKA, time_s, (2050.0, 2093.0), values)
    assert 'she turns' in found.notes[0]
    assert kept_s(found)[0] == pytest.approx(2067.0, abs=0.8)
    r, band = resistance(found, 0.17)
    assert abs(r - 0.0026) < np.hypot(0.0002, band)


def test_a_car_that_coasts_to_a_plateau() -> None:
    record = table('car/shotgoose_RR-Coastdown-2WD-2_whole_100hz.csv')
    values = {Channel.SPEED_OVER_GROUND: record['v_mps']}
    found = examined(Ship.load(SHIPS / 'car.yaml'), record['t_s'], (15.694, 37.974), values)
    assert kept_s(found) == (pytest.approx(15.7, abs=0.1), pytest.approx(32.7, abs=0.8))
    assert reasons(found) == {Dismissal.PLATEAU}
