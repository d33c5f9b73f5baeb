# SPDX-License-Identifier: Apache-2.0
"""YAML without its traps."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.ship import Ship


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('1e-6', 1e-6),
        ('1.19e-6', 1.19e-6),
        ('010', 10.0),
        ('150', 150),
        ('-2', -2),
        ('.5', 0.5),
        ('no', 'no'),
        ('1:30', '1:30'),
        ('2026-06-01', '2026-06-01'),
        ('true', True),
        ('~', None),
        ('1_000', '1_000'),
    ],
)
def test_scalars_are_what_they_look_like(text, value):
    data, problems = strict_yaml.load(f'key: {text}')
    assert data == {'key': value}
    assert type(data['key']) is type(value)
    assert problems == []


def test_repeated_keys_are_reported_with_their_lines():
    text = 'length_m: 1\nwater: {density_kg_m3: 1000, density_kg_m3: 1025}\nlength_m: 2\n'
    _, problems = strict_yaml.load(text)
    assert sorted(problems) == [
        'density_kg_m3: given twice, lines 2 and 2; keep one',
        'length_m: given twice, lines 1 and 3; keep one',
    ]
    with pytest.raises(ShipFileError, match='given twice'):
        Ship.from_yaml(text + 'displaced_volume_m3: 3', subject='test')


@settings(max_examples=200, deadline=None)
@given(
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.floats(allow_nan=False)
        | st.text(max_size=12),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
        max_leaves=6,
    )
)
def test_what_is_dumped_is_read_back(data):
    assert strict_yaml.load(strict_yaml.dump(data)) == (data, [])
