# SPDX-License-Identifier: Apache-2.0
"""World B obeys physics: energy, limits that have a solution, propellers, spectra."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.worlds.hidden_b import cases, hulls
from benchmarks.worlds.hidden_b.voyage import sail
from benchmarks.worlds.hidden_b.weather import Sinusoids, gusts
from tests.test_architecture import imports

FOLDER = Path(__file__).resolve().parents[3] / 'benchmarks' / 'worlds' / 'hidden_b'


@pytest.fixture(scope='module')
def base():
    """One quiet run with nothing hidden."""
    number = next(n for n in range(200) if not cases.plans_of(cases.SEED)[n][0])
    setting = cases._case(number, cases.SEED).settings[0]
    calm = replace(
        setting.weather, wind=(0.0, 0.0), flow=(0.0, 0.0), tide=(0.0, 0.0, 0.0), gust_least=0.0
    )
    return replace(setting, weather=calm, quiet=True)


@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.py')), ids=lambda path: path.name)
def test_it_shares_no_code(path: Path) -> None:
    others = 'shipdrag_ros', 'benchmarks.worlds.hidden.'
    assert not [name for name in imports(path) if name.startswith(others)]


@pytest.mark.parametrize('drive', ['declutched', 'direct', 'electric', 'cpp', 'locked', 'folding'])
def test_work_is_the_energy_that_is_lost(base, drive) -> None:
    screw = replace(base.screw, drive=drive, hold='torque')
    track = sail(replace(base, screw=screw))
    u, inertia = track.water_m_s, base.mass_kg * (1.0 + base.n_r)
    lost = 0.5 * inertia * (u[-1] ** 2 - u[0] ** 2)
    assert np.trapezoid(track.force_n * u, track.t) == pytest.approx(lost, rel=5e-3)


def test_a_square_law_slows_as_it_must(base) -> None:
    factor = 0.02 / base.speed_m_s * base.mass_kg
    screw = replace(base.screw, drive='folding', ramp_s=1e-3, stagger_s=0.0)
    setting = replace(base, screw=screw, still=[lambda _, v, r: factor * v**2], coast_s=200.0)
    hull = replace(base.hull, frontal_m2=0.0)
    track = sail(replace(setting, hull=hull, step_s=0.2))
    k = factor / base.mass_kg / (1.0 + base.n_r)
    t = track.t - track.t[1]
    wanted = track.water_m_s[1] / (1.0 + k * track.water_m_s[1] * t)
    assert track.water_m_s[1:] == pytest.approx(wanted[1:], rel=2e-3)


@pytest.mark.parametrize('hold', ['torque', 'power', 'revs'])
def test_the_engine_holds_her_speed(base, hold) -> None:
    screw = replace(base.screw, hold=hold, drive='declutched')
    track = sail(replace(base, screw=screw, coast_s=1.0, quiet=False, **_still(base)))
    assert np.ptp(track.water_m_s) < 0.01 * base.speed_m_s


def _still(base):
    none = Sinusoids(np.zeros(1), np.ones(1), np.zeros(1))
    return {'weather': replace(base.weather, eddies=(none, none))}


def test_a_slowed_ship_gets_more_thrust(base) -> None:
    screw, u = base.screw, base.speed_m_s
    revs = screw.revs_for(1e5, u)
    assert screw.loads(revs, 0.95 * u)[0] > 1.02 * screw.loads(revs, u)[0]


def test_a_locked_screw_drags_as_the_square_and_a_free_one_less(base) -> None:
    locked = replace(base.screw, drive='locked')
    free = replace(base.screw, drive='declutched', coulomb=0.0, viscous=0.0)
    steady = (2.0, free.loads(2.0, base.speed_m_s)[1])
    speed = np.array([0.5, 1.0]) * base.speed_m_s
    drag = locked.drag_n(speed, steady)
    assert drag[1] == pytest.approx(4.0 * drag[0], rel=1e-6)
    assert np.all(free.drag_n(speed, steady) < 0.4 * drag)
    disc = 0.25 * np.pi * locked.diameter_m**2 * locked.shafts
    advance = (1.0 - locked.wake) * speed[1]
    assert 0.2 < drag[1] / (0.5 * 1025.0 * disc * advance**2) < 0.85


def test_engine_friction_stops_the_shaft_below_a_speed(base) -> None:
    screw = replace(base.screw, drive='direct', coulomb=0.1, viscous=0.03)
    need = float(np.interp(base.speed_m_s, base.hull.grid_m_s, base.hull.still_n))
    revs = screw.revs_for(need / 0.85 / screw.shafts, base.speed_m_s)
    steady = (revs, screw.loads(revs, base.speed_m_s)[1])
    turns = [screw.settled(u, steady)[0] for u in np.linspace(0.05, 1.0, 20) * base.speed_m_s]
    assert turns[0] == 0.0
    assert np.all(np.diff(turns) >= -1e-9)
    assert 0.25 * revs < turns[-1] < 0.9 * revs


def test_hull_laws() -> None:
    reynolds = np.geomspace(3e6, 2e9, 20)
    assert hulls.katsui(reynolds) == pytest.approx(hulls.ittc57(reynolds), rel=0.09)
    thin, thick = (hulls.michell_integral(20.0, b, 1.2, 4.5) for b in (2.0, 4.0))
    assert thick == pytest.approx(4.0 * thin)
    # Wigley's hull, L/B = 10, L/T = 16: C_W about 0.9e-3 at Fr 0.3 on its wetted surface
    speed = 0.3 * np.sqrt(9.80665 * 10.0)
    found = hulls.michell_integral(10.0, 1.0, 0.625, speed)
    assert 0.5e-3 < found / (0.5 * 1025.0 * 0.661 * 10.0 * 2.25 * speed**2) < 3e-3
    for seed in range(12):
        hull = hulls.draw_hull(np.random.default_rng(seed))
        upper = hull.grid_m_s > 0.1 * hull.speed_m_s
        assert np.all(np.diff(hull.still_n[upper]) > 0.0)
        first = float(np.interp(hull.speed_m_s, hull.grid_m_s, hull.still_n))
        assert 1.5e-3 < first / (512.5 * hull.wetted_m2 * hull.speed_m_s**2) < 2e-2
        assert 0.02 < hull.n_r <= 0.2


@pytest.mark.parametrize('law', ['karman', 'davenport'])
def test_gusts_have_their_size_and_die_out_at_high_frequency(law) -> None:
    wind = gusts(np.random.default_rng(1), law, 8.0, 10.0, 1.5)
    assert np.sum(wind.size**2 / 2) == pytest.approx(1.5**2)
    f = wind.omega / (2 * np.pi)
    assert np.sum(wind.size[f > 0.1] ** 2) < 0.2 * np.sum(wind.size**2)


def test_a_tide_carries_her_along_and_a_front_does_not(base) -> None:
    ground, water = [], []
    for change in ({}, {'shear': [lambda t: 0.5 * np.clip(t / 60.0, 0.0, 1.0)]}):
        track = sail(replace(base, **change))
        i = int(np.searchsorted(track.t, 60.0))
        c, s = np.cos(base.heading_rad), np.sin(base.heading_rad)
        ground.append(track.ground_m_s[i] @ [c, s])
        water.append(track.water_m_s[i])
    assert water[1] - water[0] == pytest.approx(-0.5 / (1.0 + base.n_r), abs=0.1)
    assert 0.0 < ground[1] - ground[0] < 0.2
