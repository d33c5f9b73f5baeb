# SPDX-License-Identifier: Apache-2.0
"""The scoreboards take world B, and count what they say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import band_score, diagnosis_score
from benchmarks.worlds.hidden_b import cases

NOTHING = {'verdict': 'none', 'effects': [], 'candidates': [{'names': [], 'probability': 1.0}]}


def test_the_scoreboard_asks_and_reveals_world_b(monkeypatch) -> None:
    seen = []

    def by(*_):
        return lambda observation: (seen.append(observation), NOTHING)[1]

    monkeypatch.setattr(diagnosis_score, 'diagnosis', by)
    row = diagnosis_score.answer('anything', 4, 'b')
    assert isinstance(seen[0], cases.Observation)
    (trial,) = diagnosis_score.trials([row], 'b')
    assert trial.truth == cases.reveal(4)
    block = diagnosis_score.as_block(seen[0].runs[0])
    assert np.all(np.diff(block.receive_ns) >= 0)


@pytest.mark.parametrize('name', ['a', 'b'])
@pytest.mark.parametrize(('off', 'cover', 'chi2'), [(0.0, 1.0, 0.0), (3.0, 0.0, 9.0)])
def test_the_band_is_held_against_the_true_curve(off, cover, chi2, name) -> None:
    world = diagnosis_score.drawn(name)
    number = band_score.chosen(world, 'odd', 'own', 0, 1)[0]
    first, stop = world.first_speed(number, 0), world.stops_ns(number)[0]
    speed = np.linspace(0.3, 1.0, 50) * first
    true = world.true_r(number, speed, 0, calm=True)
    sigma = np.full(50, 0.01 * true.max())
    found = {
        'coastdowns': [
            {
                'start_ns': stop,
                'end_ns': stop + 10**11,
                'speed_m_s': speed.tolist(),
                'resistance_m_s2': (true + off * sigma).tolist(),
                'sigma_m_s2': sigma.tolist(),
            }
        ]
    }
    score = band_score.score(world, number, 0, found, 0.1)
    assert (score.cover, score.chi2) == (cover, pytest.approx(chi2))
    assert score.rmse == pytest.approx(0.01 * off)
    figures = band_score.summary([score], 2)
    assert figures['with an estimate, %'] == 50.0
    assert figures['runs with cover below 50 %, %'] == 100.0 * (cover < 0.5)
    assert band_score.score(world, number, 0, {'coastdowns': []}, 0.1) is None


def test_odd_cases_are_odd() -> None:
    numbers = band_score.chosen(diagnosis_score.drawn('b'), 'odd', 'nothing', 0, 20)
    assert len(numbers) == 20
    assert all(number % 2 for number in numbers)
    assert not any(cases.reveal(number).what for number in numbers[:3])
