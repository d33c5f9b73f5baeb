# SPDX-License-Identifier: Apache-2.0
"""Particulars that are plausible alone but not together."""

from pathlib import Path

import pytest
import yaml

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.ship import Ship

CARGO = Path(__file__).resolve().parents[2] / 'config' / 'vitus_bering.yaml'
CONSTANT = {'model': 'constant', 'value': 0.05, 'sd': 0.02}


def problems_of(**keys: object) -> tuple[str, ...]:
    values = {**yaml.safe_load(CARGO.read_text()), **keys}
    values = {name: value for name, value in values.items() if value is not None}
    with pytest.raises(ShipFileError) as caught:
        Ship.from_yaml(yaml.safe_dump(values), subject='test')
    return caught.value.problems


@pytest.mark.parametrize(
    ('keys', 'message'),
    [
        ({'displaced_volume_m3': 20.2}, 'is the length in metres'),  # thousands of tonnes
        ({'displaced_volume_m3': 713e3}, 'is the length in metres'),  # cubic feet
        ({'breadth_m': 70.9}, 'block coefficient'),  # feet
        ({'draught_m': 5.0}, 'block coefficient'),
        ({'breadth_m': 2.16}, 'breadth_m: 2.16'),
        ({'wetted_surface_m2': 48890.0}, 'wetted_surface_m2'),  # square feet
        ({'wetted_surface_m2': 454.2}, 'expected 2263..9052 m^2'),  # half and twice what is usual
        ({'wetted_surface_m2': None}, 'wetted_surface_m2: missing'),
        ({'propeller': {'diameter_m': 12.0, 'state_in_baseline': 'free'}}, 'propeller.diameter_m'),
        (
            {'length_m': 10.0, 'displaced_volume_m3': 6.0, 'added_mass': CONSTANT},
            'air.frontal_area_m2',
        ),
    ],
)
def test_a_wrong_unit_is_seen_beside_the_other_particulars(keys, message):
    assert any(message in problem for problem in problems_of(**keys))


@pytest.mark.parametrize('name', ['length_m', 'displaced_volume_m3'])
def test_where_a_size_is_missing_the_rest_is_not_held_against_it(name):
    (problem,) = problems_of(**{name: None})
    assert problem.startswith(f'{name}: missing')


def test_a_table_has_no_resistance_at_rest_and_newtons():
    at_rest = {'speed_m_s': [0.0, 9.0], 'resistance_n': [5e3, 4e5], 'relative_sd': 0.02}
    assert 'at rest' in problems_of(baseline=at_rest)[0]
    kilonewtons = {'speed_m_s': [0.0, 9.0], 'resistance_n': [0.0, 400.0], 'relative_sd': 0.02}
    assert 'are they N and m/s?' in problems_of(baseline=kilonewtons)[0]


def test_a_table_of_n_r_must_stay_positive():
    falling = {'model': 'table', 'coefficients': [[0.05], [-0.2]]}
    (problem,) = problems_of(added_mass=falling)
    assert problem.startswith('added_mass: n_r = -0.03 at Fr = 0.4')


def test_a_refused_section_is_not_checked_as_the_default():
    # the merchant default would be refused for this car
    found = problems_of(
        length_m=4.5,
        displaced_volume_m3=1.5,
        added_mass={'model': 'constant'},
        breadth_m=None,
        draught_m=None,
        wetted_surface_m2=None,
        air=None,
        propeller=None,
        baseline=None,
    )
    assert [problem.split(':')[0] for problem in found] == ['added_mass.value']


@pytest.mark.parametrize(
    ('length', 'volume'),
    [(1.1, 0.0143), (4.5, 1.5), (5.0, 1.8), (12.0, 12.5), (6.887, 1.142), (320.0, 312622.0)],
    ids=['model ship', 'car', 'ferry', 'yacht', 'towed model', 'tanker'],
)
def test_hulls_of_all_sizes_are_possible(length, volume):
    text = yaml.safe_dump(
        {'length_m': length, 'displaced_volume_m3': volume, 'added_mass': CONSTANT}
    )
    assert Ship.from_yaml(text, subject='test').n_r(1.0) == 0.05
