# SPDX-License-Identifier: Apache-2.0
"""YAML without its traps."""

import numpy as np
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
        ('010', 10),
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
    data = strict_yaml.load(f'key: {text}')
    assert data == {'key': value}
    assert type(data['key']) is type(value)


def test_repeated_keys_are_reported_with_their_lines():
    text = 'length_m: 1\nwater: {density_kg_m3: 1000, density_kg_m3: 1025}\nlength_m: 2\n'
    with pytest.raises(ValueError, match='given twice') as told:
        strict_yaml.load(text)
    assert str(told.value).split('; keep one') == [
        'density_kg_m3: given twice, lines 2 and 2',
        '; length_m: given twice, lines 1 and 3',
        '',
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
        | st.floats(allow_nan=False).map(np.float64)
        | st.text(max_size=12),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
        max_leaves=6,
    )
)
def test_what_is_dumped_is_read_back(data):
    assert strict_yaml.load(strict_yaml.dump(data)) == data


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('a: &x 1\nb: *x', r'line 1: an anchor or alias \(x\)'),
        ('a: 1\nb: *x', r'line 2: an anchor or alias \(x\)'),
        ('a: 1\nb: !!python/name:os.system 2', r'line 2: a tag \(.*os.system\)'),
        ('a: !!str 5', 'line 1: a tag'),
        ('a: 1\n---\nb: 2', 'line 2: a second document'),
        ('{[1, 2]: 3}', 'line 1: a list or mapping as a key'),
        ('a: {b: 1', 'not YAML: line 1'),
        ('a:\t- b\n  c', 'not YAML: line'),
        ('a: ' + '[' * 21 + ']' * 21, 'line 1: more than 20 levels'),
        ('[' * 100_000, 'line 1: more than 20 levels'),
        ('a: ' + '9' * 5000, 'line 1: a number of 5000 digits'),
        ('# ' + 'x' * 1_000_000, '1000002 characters'),
        ('a: \x00', 'not YAML'),
    ],
    ids=lambda text: text[:12],
)
def test_what_is_no_plain_data_is_refused_with_its_line(text, said):
    with pytest.raises(ValueError, match=said):
        strict_yaml.load(text)


@pytest.mark.parametrize('text', ['', '# nothing', '---', '~'])
def test_an_empty_text_is_none(text):
    assert strict_yaml.load(text) is None


def test_twenty_levels_are_read():
    assert strict_yaml.load('[' * 20 + ']' * 20) == eval('[' * 20 + ']' * 20)


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet='ab:-[]{}&*!|>\'"#%@`, \n\t1.e~?', max_size=30))
def test_no_text_does_more_than_be_refused(text):
    try:
        data = strict_yaml.load(text)
    except ValueError:
        return
    assert data is None or isinstance(data, bool | int | float | str | list | dict)
