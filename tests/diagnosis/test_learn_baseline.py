# SPDX-License-Identifier: Apache-2.0
"""A baseline is learnt from clean runs, and a diagnosis is the better for it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.learn_baseline import (
    LearntBaseline,
    Normals,
    factor,
    learn_baseline,
    share,
)
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import CoefficientBaseline, CoefficientSd, Ship, TableBaseline
from tests.runs import CARGO as SHIP
from tests.runs import coasted

PARAMETERS = Parameters()
TRUE = np.array([1.04, 0.85])  # friction and wave over what is stated, 2 sd and 1.5 sd off
SCATTER = 0.01


def scaled(friction: float, wave: float) -> Ship:
    """Return a ship with other coefficients than the file states."""
    base = SHIP.baseline
    assert isinstance(base, CoefficientBaseline)
    return replace(
        SHIP,
        baseline=replace(
            base,
            form_factor=friction * (1.0 + base.form_factor) - 1.0,
            correlation_allowance=friction * base.correlation_allowance,
            wave_coefficient=tuple(wave * c for c in base.wave_coefficient),
        ),
    )


def coast(ship: Ship, *effects: str, seed: int, heading_rad: float = 0.3) -> CoastRun:
    return coasted(
        *effects,
        name=f'run {seed}',
        ship=ship,
        lead_in_s=1800.0,
        coast_s=1500.0,
        heading_rad=heading_rad,
        reference_rad=0.3,
        seed=seed,
    )


def clean_runs(count: int, *, seed: int) -> list[CoastRun]:
    """Simulate clean runs, on alternating headings, that differ by their scatter."""
    rng = np.random.default_rng(seed)
    return [
        coast(
            scaled(*(TRUE * (1.0 + SCATTER * rng.standard_normal()))),
            seed=100 * seed + k,
            heading_rad=0.3 + math.pi * (k % 2),
        )
        for k in range(count)
    ]


@cache
def learnt(count: int, seed: int = 1) -> LearntBaseline:
    return learn_baseline(clean_runs(count, seed=seed), SHIP, PARAMETERS)


def test_covers_the_truth() -> None:
    # 4 seeds of 5 runs each, 2 parts: a t of 4 degrees of freedom, which 5 runs give, is within
    # 2 sd in 88 %, and fewer than 5 of 8 then come by chance in 1 %
    found = [learnt(5, seed) for seed in range(4)]
    away = [(each.factors - TRUE) / np.sqrt(np.diag(each.covariance)) for each in found]
    assert int((np.abs(away) < 2.0).sum()) >= 5
    assert 0.5 * SCATTER < np.median([each.shared.scatter for each in found]) < 2 * SCATTER


def test_the_ship_file_holds_what_was_learnt() -> None:
    found = learnt(5)
    base, stated = found.ship.baseline, SHIP.baseline
    assert isinstance(base, CoefficientBaseline)
    assert isinstance(stated, CoefficientBaseline)
    friction, wave = found.factors
    for reynolds in np.array([1e7, 1e9]):
        assert base.viscous(reynolds) == pytest.approx(friction * stated.viscous(reynolds))
    np.testing.assert_allclose(
        base.wave_coefficient, wave * np.array(stated.wave_coefficient), rtol=1e-6
    )
    assert base.run_scatter == pytest.approx(found.shared.scatter, rel=1e-6)
    assert base.relative_sd.friction < 0.5 * stated.relative_sd.friction
    assert base.relative_sd_of == 'retardation'
    assert '5 clean runs' in base.source
    assert Ship.from_yaml(found.ship.to_yaml(), subject='learnt') == found.ship


def test_two_runs_keep_the_stated_sd_and_say_so() -> None:
    found = learnt(2)
    base = found.ship.baseline
    assert isinstance(base, CoefficientBaseline)
    assert base.relative_sd.friction * found.factors[0] == pytest.approx(0.02, rel=1e-5)
    assert base.run_scatter == 0.0
    assert any('still holds' in warning for warning in found.warnings)


def test_a_run_that_is_not_clean_is_named() -> None:
    runs = [*clean_runs(5, seed=2), coast(scaled(*TRUE), 'fouling=0.6', seed=999)]
    found = learn_baseline(runs, SHIP, PARAMETERS)
    assert [warning for warning in found.warnings if warning.startswith('run 999 stands out')]
    assert not [w for w in learnt(5).warnings if 'stands out' in w]


def test_without_a_stated_baseline_r_is_written_as_a_table() -> None:
    bare = replace(SHIP, baseline=None)
    found = learn_baseline(clean_runs(3, seed=3), bare, PARAMETERS)
    base = found.ship.baseline
    assert isinstance(base, TableBaseline)
    assert found.stated_sd is None
    speed = np.linspace(3.0, 7.5, 9)
    np.testing.assert_allclose(
        found.ship.resistance_n(speed), scaled(*TRUE).resistance_n(speed), rtol=0.05
    )
    assert any('states no baseline' in warning for warning in found.warnings)


def test_fouling_that_the_stated_baseline_hides_is_seen_against_the_learnt_one() -> None:
    fouled = [coast(scaled(*TRUE), 'fouling=0.15', seed=77)]
    assert diagnose(fouled, SHIP, PARAMETERS, advise=False).candidates[0].names == ()
    found = diagnose(fouled, learnt(5).ship, PARAMETERS, advise=False)
    assert found.candidates[0].names
    assert found.nothing < 0.1
    assert ('fouling',) in [each.names for each in found.candidates]


def test_runs_that_scatter_raise_no_alarm_against_the_learnt_baseline() -> None:
    # light air explains one more each way, but not two
    runs = [
        coast(scaled(*((1.0 + part) * TRUE)), seed=seed, heading_rad=0.3 + math.pi * (seed >= 80))
        for seed, part in zip(range(78, 82), (0.02, -0.02, 0.02, -0.02), strict=True)
    ]
    # 0.00 where the scatter of the learnt baseline does not count
    assert diagnose(runs, learnt(5).ship, PARAMETERS, advise=False).nothing > 0.3


def test_what_is_stated_of_friction_and_wave_together_counts() -> None:
    # friction and wave that err against each other leave their sum known
    base = scaled(*TRUE).baseline
    assert isinstance(base, CoefficientBaseline)
    run = [coast(scaled(1.15 * TRUE[0], 1.45 * TRUE[1]), seed=80)]
    chance = []
    for correlation in (-0.95, 0.95):
        sd = CoefficientSd(friction=0.05, wave=0.15, correlation=correlation)
        ship = replace(SHIP, baseline=replace(base, relative_sd=sd))
        chance.append(diagnose(run, ship, PARAMETERS, advise=False).nothing)
    assert chance[0] < 0.5 * chance[1]


def test_one_run_of_a_ship_without_a_baseline_is_its_table() -> None:
    # N = 3, seeds 1 to 3: as they were read; without the wind that might have blown 0.4 % less
    bare, speed = replace(SHIP, baseline=None), np.linspace(2.5, 6.0, 30)
    off = []
    for seed in (1, 2, 3):
        run = coasted(coast_s=1500.0, inputs=('speed_through_water',), seed=seed)
        found = learn_baseline([run], bare, PARAMETERS).ship
        off.append(found.resistance_n(speed) / SHIP.resistance_n(speed) - 1.0)
    assert abs(np.mean(off)) < 0.002


def test_needs_a_run() -> None:
    with pytest.raises(DiagnosisError, match='no run'):
        learn_baseline([], SHIP, PARAMETERS)


ALONG = np.array([1.0, 1.0])
PRIOR = np.zeros(2)  # wide beside what the runs know, as its sd is 1


def runs(
    count: int, *, scatter: float, seed: int, mean: tuple[float, float] = (0.04, -0.1)
) -> Normals:
    """Draw runs, each of which knows both parts to about 0.01."""
    rng = np.random.default_rng(seed)
    matrices, gradients = [], []
    for _ in range(count):
        rows = rng.normal(size=(20, 2))
        true = np.array(mean) + scatter * rng.standard_normal() * ALONG
        measured = rows @ true + 0.03 * rng.standard_normal(20)
        matrices.append(rows.T @ rows / 0.03**2)
        gradients.append(rows.T @ measured / 0.03**2)
    return Normals(np.array(matrices), np.array(gradients))


def test_runs_that_scatter_are_one_joint_least_squares() -> None:
    # at the scatter that is found, each factor is an unknown with this prior sd
    seen = runs(6, scatter=0.1, seed=5)
    found = share(seen, PRIOR, ALONG, usual_scatter=1e-4 + 0.1)
    count = len(seen.matrix)
    whole = np.zeros((2 + count, 2 + count))
    gradient = np.zeros(2 + count)
    whole[:2, :2] = np.eye(2)
    for j, (matrix, push) in enumerate(zip(*seen, strict=True)):
        columns = np.zeros((2, 2 + count))
        columns[:, :2], columns[:, 2 + j] = np.eye(2), ALONG
        whole += columns.T @ matrix @ columns
        gradient += columns.T @ push
        whole[2 + j, 2 + j] += found.scatter**-2.0
    joint = np.linalg.solve(whole, gradient)[:2]
    np.testing.assert_allclose(found.step, joint, atol=2e-3)


@pytest.mark.parametrize('scatter', [0.005, 0.02, 0.1])
def test_scatter_and_mean_are_found_with_many_runs(scatter: float) -> None:
    found = share(runs(60, scatter=scatter, seed=1), PRIOR, ALONG, usual_scatter=0.02)
    assert found.scatter == pytest.approx(scatter, rel=0.35)
    assert found.scatter_low < found.scatter < found.scatter_high
    away = found.step - [0.04, -0.1]
    assert float(away @ np.linalg.solve(found.covariance, away)) < 13.8  # 0.1 % by chance


def test_what_is_usual_holds_where_runs_tell_no_scatter() -> None:
    one = runs(1, scatter=0.0, seed=2)
    found = [share(one, PRIOR, ALONG, usual_scatter=usual).scatter for usual in (0.01, 0.05)]
    assert found[1] > 3.0 * found[0]


def test_a_run_that_differs_is_held_against_the_others() -> None:
    others = share(runs(8, scatter=0.01, seed=3), PRIOR, ALONG, usual_scatter=0.02)
    odd = runs(1, scatter=0.0, seed=4, mean=(0.04 + 0.2, -0.1 + 0.2))
    found = factor(odd.matrix[0], odd.gradient[0], others, ALONG)
    assert found.value == pytest.approx(0.2, abs=0.03)
    assert found.away > 8.0
