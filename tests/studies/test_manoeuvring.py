# SPDX-License-Identifier: Apache-2.0
"""Ships that are steered: values, published figures, and an integration of their own."""

from __future__ import annotations

import csv
import os
from dataclasses import replace
from math import isinf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.studies.manoeuvring import (
    FORM,
    Side,
    mariner,
    overshoots_rad,
    parse,
    steer,
    turn,
    zigzag,
)


def test_the_form_has_forty_derivatives_and_the_file_a_value_of_each():
    ship = mariner()
    assert [sum(name[0] == axis for name in FORM) for axis in 'XYN'] == [10, 15, 15]
    assert set(ship.viscous) == set(FORM)


def test_fourteen_are_exact_multiples_of_others_and_belong_to_the_same_force():
    ship = mariner()
    assert len(ship.multiples) == 14
    for name, other in ship.multiples.items():
        ratio = ship.viscous[name] / ship.viscous[other]
        assert name[0] == other[0]
        assert ratio == pytest.approx(round(ratio), rel=1e-12)
    assert len(ship.groups) == 26
    assert sorted(sum(ship.groups, ())) == sorted(FORM)


def test_a_published_table_has_the_same_values():
    folder = os.environ.get('SHIPDRAG_DATA')
    if not folder:
        pytest.skip('SHIPDRAG_DATA is not set')
    ship = mariner()
    stated = {**ship.viscous, **ship.inertial}
    with (Path(folder) / 'mariner_derivatives.csv').open(encoding='utf-8') as file:
        table = {
            row['derivative']: float(row['value']) * float(row['unit_factor'])
            for row in csv.DictReader(file)
        }
    assert set(table) == set(stated)
    for name, value in table.items():
        assert stated[name] == pytest.approx(value, rel=1e-12), name


SHIP = mariner()


APPROACH_S = 10.0  # rudder amidships, then the first order: as the published figures count


@pytest.mark.parametrize(
    ('angle', 'to_starboard', 'to_port'), [(15, 6.79, 5.61), (20, 7.79, 6.35), (25, 8.85, 7.01)]
)
def test_zigzags_overshoot_as_published_to_the_last_digit(angle, to_starboard, to_port):
    # first to starboard, the helmsman looks every 0.1 s; the largest to each side is meant: of
    # 15/15 to starboard the third
    manoeuvre = zigzag(angle)
    motion = steer(SHIP, manoeuvre, approach_s=APPROACH_S)[0]
    over = np.degrees(overshoots_rad(motion, manoeuvre))
    assert max(over[::2]) == pytest.approx(to_starboard, abs=0.006)
    assert max(over[1::2]) == pytest.approx(to_port, abs=0.006)
    # without the approach the looks fall otherwise, and one look is worth 0.1 degrees
    prompt = np.degrees(overshoots_rad(steer(SHIP, manoeuvre)[0], manoeuvre))
    assert 0.001 < abs(prompt[0] - over[0]) < 0.1


def circle(motion):
    """Advance at a change of heading by 90 degrees, tactical diameter at one by 180 [m]."""
    turned = np.degrees(np.abs(motion.heading_rad))
    return [
        float(np.interp(at, turned, np.abs(way)))
        for at, way in zip((90.0, 180.0), motion.position_m.T)
    ]


def test_a_turning_circle_is_as_wide_as_published():
    motion = steer(SHIP, turn(35.0), approach_s=APPROACH_S)[0]
    assert circle(motion) == pytest.approx([566.0, 1029.0], abs=0.5)
    np.testing.assert_array_equal(motion.position_m[0], 0.0)
    assert motion.rudder_rad[0] == 0.0
    # the propeller turns her before the order
    assert 0.0 < motion.heading_rad[0] < np.radians(1.0)


def test_to_port_the_ship_turns_wider():
    wide = turn(35.0, first=Side.PORT)
    motion = steer(SHIP, wide)[0]
    assert motion.position_m[100, 1] < 0.0
    advance_m, diameter_m = circle(motion)
    assert 566.0 < advance_m < 620.0
    assert 1029.0 < diameter_m < 1100.0


def test_overshoots_are_of_the_motion_between_its_samples():
    manoeuvre = zigzag(20.0)
    coarse = overshoots_rad(steer(SHIP, manoeuvre)[0], manoeuvre)
    fine = overshoots_rad(steer(SHIP, manoeuvre, sample_s=0.1, samples=6000)[0], manoeuvre)
    np.testing.assert_allclose(coarse, fine[: len(coarse)], rtol=0, atol=1e-5)


def test_a_ship_that_does_not_turn_as_far_has_no_overshoot():
    assert len(overshoots_rad(steer(SHIP, zigzag(15.0), samples=20)[0], zigzag(15.0))) == 0


@pytest.mark.parametrize('manoeuvre', [zigzag(15.0), zigzag(7.5), turn(35.0)])
def test_names_are_read_back(manoeuvre):
    assert parse(manoeuvre.name) == manoeuvre


U, L = SHIP.speed_m_s, SHIP.length_m
EVEN = [i for i, name in enumerate(FORM) if name[1] == '0']  # alike to both sides


def rates(state, ordered):
    """Each derivative times the powers that its name spells."""
    du, v, r, _, _, heading, d = state
    speed = np.hypot(U + du, v)
    of = {'u': du / speed, 'v': v / speed, 'r': r * L / speed, 'd': d, '0': 1.0}
    force = dict.fromkeys('XYN', 0.0)
    for name, value in SHIP.viscous.items():
        force[name[0]] += value * np.prod([of[letter] for letter in name[1:]])
    m, added, lever = SHIP.mass, SHIP.inertial, SHIP.mass * SHIP.gravity_centre
    inertia = [
        [m - added['Yvdot'], lever - added['Yrdot']],
        [lever - added['Nvdot'], SHIP.yaw_inertia - added['Nrdot']],
    ]
    sway, yaw = np.linalg.solve(inertia, [force['Y'], force['N']])
    machine = SHIP.rudder
    ahead, cos, sin = U + du, np.cos(heading), np.sin(heading)
    return [
        force['X'] / (m - added['Xudot']) * speed**2 / L,
        sway * speed**2 / L,
        yaw * speed**2 / L**2,
        ahead * cos - v * sin,
        ahead * sin + v * cos,
        r,
        np.clip((ordered - d) / machine.lag_s, -machine.rate_rad_s, machine.rate_rad_s),
    ]


def integrated(manoeuvre, time_s):
    """Sail to each reversal, then on with the other order; (n, 7)."""
    path, state, side, now = np.empty((len(time_s), 7)), np.zeros(7), 1.0, 0.0
    while now < time_s[-1]:
        ordered = -side * manoeuvre.rudder_rad

        def reversal(t, x, side=side):
            return side * x[5] - manoeuvre.reverse_rad

        reversal.terminal, reversal.direction = True, 1.0
        found = solve_ivp(
            lambda t, x, ordered=ordered: rates(x, ordered),
            (now, time_s[-1]),
            state,
            events=None if isinf(manoeuvre.reverse_rad) else reversal,
            dense_output=True,
            rtol=1e-9,
            atol=1e-10,
            max_step=2.0,
        )
        here = (time_s >= now) & (time_s <= found.t[-1])
        path[here] = found.sol(time_s[here]).T
        state, now, side = found.y[:, -1], found.t[-1], -side
    return path


@pytest.mark.parametrize('manoeuvre', [zigzag(20.0), turn(35.0)], ids=lambda m: m.name)
def test_agrees_with_an_independent_integration(manoeuvre):
    motion = steer(SHIP, manoeuvre, samples=301, control_s=0.0)[0]
    expected = integrated(manoeuvre, motion.time_s)
    expected[:, 0] += U
    np.testing.assert_allclose(motion.speeds[:, :2], expected[:, :2], rtol=0, atol=2e-6)
    np.testing.assert_allclose(motion.speeds[:, 2], expected[:, 2], rtol=0, atol=1e-7)
    np.testing.assert_allclose(motion.position_m, expected[:, 3:5], rtol=0, atol=2e-3)
    np.testing.assert_allclose(motion.heading_rad, expected[:, 5], rtol=0, atol=1e-6)
    np.testing.assert_allclose(motion.rudder_rad, -expected[:, 6], rtol=0, atol=1e-6)


def test_a_shorter_step_changes_nothing_that_matters():
    coarse, fine = (
        steer(SHIP, zigzag(15.0), sample_s=sample_s, samples=samples, control_s=0.0)
        for sample_s, samples in ((0.5, 1200), (0.01, 60_000))
    )
    difference = coarse.speeds[0] - fine.speeds[0, ::50]
    assert np.max(np.abs(difference / [U, U, U / L])) < 2e-6


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(2, 12),
    manoeuvre=st.sampled_from([zigzag(15.0), turn(25.0)]),
    control_s=st.sampled_from([0.0, 0.1, 0.5]),
)
def test_columns_are_single_runs_to_the_last_bit(seed, count, manoeuvre, control_s):
    rng = np.random.default_rng(seed)
    derivatives = SHIP.values * rng.uniform(0.8, 1.2, (count, len(FORM)))
    together = steer(SHIP, manoeuvre, derivatives, samples=200, control_s=control_s)
    assert len(together) == count
    for column, values in zip(together, derivatives):
        alone = steer(SHIP, manoeuvre, values, samples=200, control_s=control_s)[0]
        for name in vars(alone):
            np.testing.assert_array_equal(getattr(column, name), getattr(alone, name))


@settings(max_examples=10, deadline=None)
@given(
    angle=st.floats(5.0, 35.0),
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from([zigzag, turn]),
)
def test_without_the_propeller_sides_are_alike(angle, seed, kind):
    values = SHIP.values * np.random.default_rng(seed).uniform(0.9, 1.1, len(FORM))
    values[EVEN] = 0.0
    starboard, port = (
        steer(SHIP, kind(angle, first=side), values, control_s=0.0)[0] for side in Side
    )
    mirrored = {'speeds': np.array([1.0, -1.0, -1.0]), 'position_m': np.array([1.0, -1.0])}
    for name in ('speeds', 'heading_rad', 'position_m'):
        np.testing.assert_allclose(
            getattr(port, name),
            mirrored.get(name, -1.0) * getattr(starboard, name),
            rtol=0,
            atol=1e-12 * max(1.0, float(np.max(np.abs(getattr(port, name))))),
        )


def test_the_helmsman_is_late_by_up_to_his_interval():
    prompt, quick, slow = (
        steer(SHIP, zigzag(25.0), control_s=control_s)[0] for control_s in (0.0, 0.1, 0.5)
    )
    peaks = [np.degrees(np.max(motion.heading_rad[:400])) for motion in (prompt, quick, slow)]
    assert peaks[0] < peaks[1] < peaks[2] < peaks[0] + 0.5


def test_the_rudder_keeps_to_its_rate_and_limit():
    motion = steer(SHIP, zigzag(40.0), sample_s=0.1, samples=3000)[0]
    machine = SHIP.rudder
    assert np.max(np.abs(np.diff(motion.rudder_rad))) <= machine.rate_rad_s * 0.1 * (1 + 1e-9)
    stiff = replace(SHIP, rudder=replace(machine, limit_rad=np.radians(34.0)))
    with pytest.raises(
        SimulationError, match=r"'turn:35', expected more than 0 and at most 34 degrees"
    ):
        steer(stiff, turn(35.0))
    slow = replace(SHIP, rudder=replace(machine, rate_rad_s=np.radians(1.0)))
    lagging = replace(SHIP, rudder=replace(machine, lag_s=5.0))
    prompt = steer(SHIP, turn(35.0), samples=20)[0].rudder_rad
    for other in (slow, lagging):
        later = steer(other, turn(35.0), samples=20)[0].rudder_rad
        assert np.all(later <= prompt + 1e-12)
        assert later[12] < prompt[12] - 0.01


def test_samples_are_where_they_were_asked_for():
    often = steer(SHIP, turn(20.0), sample_s=0.5, samples=101)
    seldom = steer(SHIP, turn(20.0), sample_s=5.0, samples=11)
    np.testing.assert_allclose(often.time_s[::10], seldom.time_s)
    np.testing.assert_allclose(often.speeds[:, ::10], seldom.speeds, rtol=1e-12)


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'sample_s': 0.25, 'control_s': 0.1}, 'sample_s is 0.25 and control_s 0.1'),
        ({'sample_s': np.nan, 'control_s': 0.0}, 'sample_s is nan'),
        ({'sample_s': 0.5, 'control_s': 1.0}, 'whole number of looks'),
        ({'samples': 1}, 'samples is 1'),
        ({'approach_s': -1.0}, 'approach_s is -1.0, expected 0 to 3600 s'),
        ({'approach_s': np.nan}, 'approach_s is nan'),
        ({'derivatives': np.zeros(39)}, r'shape \(1, 39\), expected \(k, 40\)'),
    ],
)
def test_what_cannot_be_simulated_is_told(options, message):
    with pytest.raises(SimulationError, match=message):
        steer(SHIP, turn(20.0), **options)
