# SPDX-License-Identifier: Apache-2.0
"""The oracle of world B: it is told nothing of what is hidden, and finds what is plain to see."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.worlds.hidden_b import cases
from benchmarks.worlds.hidden_b.instruments import Series
from benchmarks.worlds.hidden_b.oracle import diagnose
from benchmarks.worlds.hidden_b.oracle_sail import _means, made, run_of, stated

# even, one run: a stream, a radar that is wrong in scale, and nothing
CURRENT, SCALE, NOTHING = 4, 188, 34


def test_it_is_told_nothing_of_what_is_hidden() -> None:
    told, setting = cases.known(CURRENT), cases._case(CURRENT, cases.SEED).settings[0]
    assert not told.hull.still_n.any()
    assert told.hull.n_r == told.kit.log_scale == told.kit.log_offset_m_s == 0.0
    assert np.any(setting.flow)


@pytest.mark.parametrize('number', [SCALE, NOTHING])
def test_it_names_what_is_plain_and_nothing_where_nothing_is(number) -> None:
    found = diagnose(cases.observe(number), cases.known(number))
    assert sum(each['probability'] for each in found['candidates']) > 0.98
    true = cases.reveal(number).names
    assert found['verdict'] == ('named' if true else 'none')
    assert tuple(effect['name'] for effect in found['effects']) == true


def test_fouling_is_of_any_size_and_not_in_steps() -> None:
    known = cases.known(CURRENT)
    hull = stated(cases.observe(CURRENT).ship_file, known).hull

    def drag(factor: float) -> float:
        setting = run_of(known, hull, 0, hull.speed_m_s, 0.0)
        made('fouling', [factor], hull, known, (1.0, 1.0)).apply(setting)
        return float(np.sum(setting.still_n() - hull.still_n))

    factors = 0.2 * 1.002 ** np.arange(8)  # a step of its maker is some percent
    assert np.array([drag(f) for f in factors]) / factors == pytest.approx(
        drag(0.2) / 0.2, rel=0.01
    )
    assert np.all(np.diff([drag(f) for f in factors]) > 0.0)


def test_a_mean_is_of_the_readings_that_are_there() -> None:
    t = np.arange(0.0, 100.0, 1.0)
    t = t[(t < 11.0) | (t > 22.0)]  # a gap of a kind that every source has
    grid = np.linspace(0.0, 100.0, 1001)
    series = Series((t * 1e9).astype(np.int64), np.exp(-t / 8.0), (t * 1e9).astype(np.int64))
    means = _means(series, 0, np.linspace(0.0, 100.0, 4))
    found = means.of(grid, np.exp(-grid / 8.0)[:, None])
    assert found == pytest.approx(means.value, rel=1e-3)
    assert means.of(grid - 50.0, grid[:, None] - 50.0).shape == (3, 1)
    late = means.of(grid[400:], grid[400:, None])  # straight on before it begins
    assert late[0, 0] == pytest.approx(means.t[0])
