# SPDX-License-Identifier: Apache-2.0
"""The scoreboards take world B, and count what they say."""

from __future__ import annotations

import numpy as np
import pytest

NOTHING = {'verdict': 'none', 'effects': [], 'candidates': [{'names': [], 'probability': 1.0}]}


def test_the_scoreboard_asks_and_reveals_world_b(monkeypatch) -> None:
    import diagnosis_score
    from hidden_b import cases

    seen = []

    def by(*_):
        return lambda observation: (seen.append(observation), (NOTHING, 0.1))[1]

    monkeypatch.setattr(diagnosis_score, 'diagnosis', by)
    row = diagnosis_score.answer('anything', 'blocks', 4, 'b')
    assert isinstance(seen[0], cases.Observation)
    (trial,) = diagnosis_score.trials([row], 'b')
    assert trial.truth == cases.reveal(4)
    block = diagnosis_score.as_block(seen[0].runs[0])
    assert np.all(np.diff(block.receive_ns) >= 0)


@pytest.mark.parametrize(('off', 'cover', 'chi2'), [(0.0, 1.0, 0.0), (3.0, 0.0, 9.0)])
def test_the_band_is_held_against_the_true_curve(off, cover, chi2) -> None:
    import band_score
    from hidden_b import cases

    number = band_score.chosen('odd', 'own', 0, 1, cases.SEED)[0]
    first, stop = cases.first_speed(number), cases.stops_ns(number)[0]
    speed = np.linspace(0.3, 1.0, 50) * first
    true = cases.true_r(number, speed)
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
    score = band_score.score(number, 0, found, cases.SEED, 0.1)
    assert (score.cover, score.chi2) == (cover, pytest.approx(chi2))
    assert (score.rmse, score.rmse_below) == pytest.approx((0.01 * off, 0.01 * off))
    figures = band_score.summary([score], 2)
    assert figures['with an estimate, %'] == 50.0
    assert figures['runs with cover below 50 %, %'] == 100.0 * (cover < 0.5)
    assert band_score.score(number, 0, {'coastdowns': []}, cases.SEED, 0.1) is None


def test_odd_cases_are_odd() -> None:
    import band_score
    from hidden_b import cases

    numbers = band_score.chosen('odd', 'nothing', 0, 20, cases.SEED)
    assert len(numbers) == 20
    assert all(number % 2 for number in numbers)
    assert not any(cases.reveal(number).what for number in numbers[:3])
