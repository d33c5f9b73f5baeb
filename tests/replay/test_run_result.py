# SPDX-License-Identifier: Apache-2.0
"""A true curve survives its file to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.errors import BagError
from shipdrag_ros.replay.run_result import TrueCurve


@given(st.lists(st.floats(0.0, 40.0), min_size=1, max_size=9, unique=True).map(sorted), st.data())
def test_round_trip(speeds: list[float], data: st.DataObject) -> None:
    r = data.draw(st.lists(st.floats(-1.0, 1.0), min_size=len(speeds), max_size=len(speeds)))
    curve = TrueCurve(np.array(speeds), np.array(r), {'seed': 1, 'ship': 'Vitus'})
    back = TrueCurve.from_yaml(curve.to_yaml(), subject='a.mcap')
    np.testing.assert_array_equal(back.speed_m_s, curve.speed_m_s)
    np.testing.assert_array_equal(back.resistance_m_s2, curve.resistance_m_s2)
    assert back.settings == curve.settings


@pytest.mark.parametrize(
    'text',
    [
        '',
        '[',
        'settings: {}',
        'settings: {}\nspeed_m_s: [a]\nresistance_m_s2: [1]',
        'settings: {}\nspeed_m_s: [1, 2]\nresistance_m_s2: [1]',
        'settings: {}\nspeed_m_s: [2, 1]\nresistance_m_s2: [1, 1]',
        'settings: 3\nspeed_m_s: [1]\nresistance_m_s2: [1]',
    ],
)
def test_what_is_no_true_curve_is_refused(text: str) -> None:
    with pytest.raises(BagError, match=r'^a\.mcap: truth\.yaml '):
        TrueCurve.from_yaml(text, subject='a.mcap')


def test_outside_the_curve_nothing_is_known() -> None:
    speed = np.linspace(0.0, 8.2, 83)
    truth = TrueCurve(speed, speed**2 / 3100.0, {'speed_m_s': 8.2, 'seed': 1})
    at = truth.at(np.array([-1.0, 4.0, 9.0]))
    assert np.isnan(at[[0, 2]]).all()
    np.testing.assert_allclose(at[1], 16.0 / 3100.0, rtol=1e-12)
