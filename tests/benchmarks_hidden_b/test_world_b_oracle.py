# SPDX-License-Identifier: Apache-2.0
"""The oracle of world B: it sails as the generator does, and finds what is plain to see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

# even, one run: a stream, and nothing
CURRENT, NOTHING = 4, 34


@pytest.fixture(scope='module')
def cases():
    from hidden_b import cases

    return cases


def test_it_sails_as_the_generator_does(cases) -> None:
    from hidden_b.measure import quiet
    from hidden_b.oracle_sail import quick
    from hidden_b.voyage import sail

    for number in (2, 18):  # a free shaft with thrust left in wind; controllable pitch
        setting = quiet(cases._case(number, cases.SEED).settings[0])
        setting = replace(setting, coast_s=0.5 * setting.coast_s)
        true = sail(setting)
        found = quick(setting, true.t)
        assert found.water_m_s == pytest.approx(true.water_m_s, abs=1e-9)
        assert found.shafts_rad_s == pytest.approx(true.shafts_rad_s, abs=1e-9)
        assert found.place_m == pytest.approx(true.place_m, abs=1e-6)


def test_it_is_told_nothing_of_what_is_hidden(cases) -> None:
    told, setting = cases.known(CURRENT), cases._case(CURRENT, cases.SEED).settings[0]
    assert not told.hull.still_n.any()
    assert told.hull.n_r == told.kit.log_scale == told.kit.log_offset_m_s == 0.0
    assert np.any(setting.flow)


@pytest.mark.parametrize('number', [CURRENT, NOTHING])
def test_it_names_what_is_plain_and_nothing_where_nothing_is(cases, number) -> None:
    from diagnosis_score import diagnosis

    found, _ = diagnosis('oracle', 'blocks', number, 'b')(cases.observe(number))
    assert sum(each['probability'] for each in found['candidates']) > 0.98
    true = cases.reveal(number).names
    assert found['verdict'] == ('named' if true else 'none')
    assert tuple(effect['name'] for effect in found['effects']) == true
