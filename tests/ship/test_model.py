# SPDX-License-Identifier: Apache-2.0
"""The ship as a whole: reading, writing, what follows from the particulars, one run of hers."""

import math
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shipdrag_ros.errors import ShipdragError, ShipFileError
from shipdrag_ros.fields import read_small_text
from shipdrag_ros.ship import Fact, MerchantAddedMass, RunSheet, Ship, TableBaseline, Water
from shipdrag_ros.ship.model import kinematic_viscosity

CONFIG = Path(__file__).resolve().parents[2] / 'config'
EXAMPLES = sorted(path for path in CONFIG.glob('*.yaml') if 'length_m' in path.read_text())
SMALLEST = 'length_m: 150\ndisplaced_volume_m3: 20200\n'


@pytest.fixture
def cargo() -> Ship:
    return Ship.load(CONFIG / 'vitus_bering.yaml')


def with_keys(**keys: object) -> Ship:
    """Read the cargo ship with some keys set anew, or removed by None."""
    values = yaml.safe_load((CONFIG / 'vitus_bering.yaml').read_text())
    values.update(keys)
    values = {name: value for name, value in values.items() if value is not None}
    return Ship.from_yaml(yaml.safe_dump(values), subject='test')


def test_only_length_and_volume_are_needed():
    ship = Ship.from_yaml(SMALLEST, subject='test')
    assert ship.water == Water(1025.0, 1.19e-6)
    assert ship.added_mass == MerchantAddedMass(sd=0.02)
    assert ship.baseline is None
    assert ship.name == ''
    assert ship.effects == ()


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda path: path.stem)
def test_examples_load_without_warning_and_round_trip(path):
    ship = Ship.load(path)
    assert ship.warnings == ()
    assert Ship.from_yaml(ship.to_yaml(), subject='again') == ship


def test_there_are_examples():
    assert {'vitus_bering', 'yacht', 'kvlcc2'} <= {path.stem for path in EXAMPLES}


def test_n_r_has_the_published_check_values(cargo):
    # S1: psi = 5.5077, n_r = 0.0552 at rest and 0.1042 at 8.2 m/s
    assert cargo.slenderness == pytest.approx(5.5077, abs=5e-5)
    np.testing.assert_allclose(cargo.n_r([0.0, 8.2, -8.2]), [0.0552, 0.1042, 0.1042], atol=5e-5)
    assert float(cargo.froude(8.2)) == pytest.approx(0.2138, abs=5e-5)


def test_n_r_polynomial_is_s1_2_written_out(cargo):
    psi, g_l = 150.0 / 20200.0 ** (1 / 3), 9.81 * 150.0
    b = [
        0.2017 - 0.0321 * psi + 0.0010 * psi**2,
        (-0.4871 + 0.1193 * psi - 0.0034 * psi**2) / g_l**0.5,
        (5.9608 - 1.3184 * psi + 0.0679 * psi**2) / g_l,
    ]
    np.testing.assert_allclose(cargo.n_r_polynomial(), b, rtol=1e-12)
    v = np.linspace(0.0, 9.0, 7)
    np.testing.assert_allclose(cargo.n_r(v), b[0] + b[1] * v + b[2] * v**2, rtol=1e-12)


def test_n_r_of_the_other_models():
    constant = with_keys(added_mass={'model': 'constant', 'value': 0.07, 'sd': 0.03})
    np.testing.assert_array_equal(constant.n_r([0.0, 8.2]), [0.07, 0.07])
    assert constant.added_mass.sd == 0.03
    table = with_keys(added_mass={'model': 'table', 'coefficients': [[0.01, 0.01], [0.2]]})
    expected = 0.01 + 0.01 * table.slenderness + 0.2 * table.froude(8.2)
    np.testing.assert_allclose(table.n_r(8.2), expected, rtol=1e-14)


def test_a_table_may_restate_the_merchant_polynomial(cargo):
    rows = [list(row) for row in MerchantAddedMass().coefficients]
    table = with_keys(added_mass={'model': 'table', 'coefficients': rows, 'sd': 0.02})
    np.testing.assert_array_equal(table.n_r([0.0, 5.0]), cargo.n_r([0.0, 5.0]))


def test_mass_and_froude_number_follow_water_and_length(cargo):
    assert cargo.mass_kg == 1025.0 * 20200.0
    fresh = replace(cargo, water=replace(cargo.water, density_kg_m3=1000.0))
    assert fresh.mass_kg == 1000.0 * 20200.0
    speeds = np.array([0.1, 3.0, 8.2])
    np.testing.assert_allclose(cargo.speed(cargo.froude(speeds)), speeds, rtol=1e-15)


def test_resistance_is_the_contract_formula(cargo):
    v = 8.0
    c_f = 0.075 / (np.log10(v * 150.0 / 1.19e-6) - 2.0) ** 2
    water = 0.5 * 1025.0 * 4542.0 * v**2
    air = 0.5 * 1.225 * 480.0 * 0.8 * v**2
    # at a point of the table C_W needs no interpolation
    at_point = with_keys(
        baseline={
            'form_factor': 0.2,
            'correlation_allowance': 3e-4,
            'wave_froude': [0.0, float(cargo.froude(v)), 0.3],
            'wave_coefficient': [0.0, 7e-4, 3e-3],
            'relative_sd': {'friction': 0.02, 'wave': 0.1},
        }
    )
    expected = water * (1.2 * c_f + 3e-4 + 7e-4) + air
    np.testing.assert_allclose(at_point.resistance_n(v), expected, rtol=1e-12)


def test_resistance_is_odd_and_vanishes_at_rest(cargo):
    v = np.linspace(0.0, 9.0, 50)
    np.testing.assert_array_equal(cargo.resistance_n(-v), -cargo.resistance_n(v))
    assert cargo.resistance_n(0.0) == 0.0
    assert np.all(np.diff(cargo.resistance_n(v)) > 0.0)


def test_resistance_falls_with_the_square_where_the_ittc_line_ends(cargo):
    # Re = 1e5 is 0.8 mm/s here; the line itself has a pole at Re = 100
    slow = np.array([1e-6, 1e-5, 1e-4, 7e-4])
    ratio = cargo.resistance_n(slow) / slow**2
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)


def test_resistance_outside_the_wave_table_is_an_error(cargo):
    low, high = cargo.baseline_range_m_s
    assert low == 0.0
    assert np.isfinite(cargo.resistance_n(high))
    with pytest.raises(ShipdragError, match='wave_froude'):
        cargo.resistance_n([5.0, 1.001 * high])


def test_a_table_baseline_includes_the_air_and_ends_where_it_ends(cargo):
    speeds = [2.0, 4.0, 6.0, 9.0]
    forces = [20e3, 75e3, 170e3, 420e3]
    ship = replace(cargo, baseline=TableBaseline(tuple(speeds), tuple(forces), 0.02))
    assert ship.baseline_range_m_s == (2.0, 9.0)
    np.testing.assert_allclose(ship.resistance_n(speeds), forces, rtol=1e-14)
    np.testing.assert_allclose(ship.resistance_n(-4.0), -75e3, rtol=1e-14)
    for outside in (1.99, 9.01, 0.0, np.nan):
        with pytest.raises(ShipdragError, match='speed_m_s'):
            ship.resistance_n(outside)


def test_air_drag_acts_against_the_relative_wind(cargo):
    expected = 0.5 * 1.225 * 480.0 * 0.8 * 100.0
    np.testing.assert_allclose(cargo.air_drag_n([10.0, -10.0]), [expected, -expected], rtol=1e-14)
    np.testing.assert_array_equal(replace(cargo, air=None).air_drag_n([10.0]), [0.0])


def test_merchant_polynomial_warns_before_it_refuses():
    def of_length(length: float) -> Ship:
        return Ship.from_yaml(f'length_m: {length}\ndisplaced_volume_m3: 1000', subject='test')

    assert of_length(60.0).warnings == ()
    assert 'merchant' in of_length(44.0).warnings[0]
    assert 'merchant' in of_length(75.0).warnings[0]
    for length in (39.0, 81.0):
        with pytest.raises(ShipFileError, match=r'added_mass.model: merchant .* 4..8'):
            of_length(length)


def test_effects_are_kept():
    effect = {'name': 'fouling', 'parameters': {'friction_factor': {'value': 0.2, 'sd': 0.05}}}
    ship = with_keys(effects=[effect])
    assert ship.effects[0].name == 'fouling'
    assert ship.effects[0].parameters['friction_factor'].sd == 0.05
    assert Ship.from_yaml(ship.to_yaml(), subject='again') == ship
    assert hash(ship) == hash(Ship.from_yaml(ship.to_yaml(), subject='again'))


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=12,
)
KEYS = st.sampled_from([*(item.name for item in fields(Ship)), 'lenght'])


def ship_or_refusal(text: str) -> None:
    try:
        ship = Ship.from_yaml(text, subject='junk')
    except ShipFileError:
        return
    assert Ship.from_yaml(ship.to_yaml(), subject='again') == ship


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=60) | st.text('length_m:{}[]&*!|>-#\n \'"0159.e', max_size=60))
def test_any_text_is_a_ship_or_a_refusal(text):
    ship_or_refusal(text)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(KEYS, JUNK, max_size=8))
def test_any_values_are_a_ship_or_a_refusal(values):
    ship_or_refusal(yaml.safe_dump({'length_m': 150.0, 'displaced_volume_m3': 20200.0} | values))


@pytest.mark.parametrize(
    'text',
    [
        'length_m: !!python/object:os.system x',
        'a: &a [1,1,1,1,1,1,1,1]\nb: &b [*a,*a,*a,*a,*a,*a]\nlength_m: [*b,*b,*b,*b,*b,*b]',
        '[' * 3000,
        'length_m: 1e999',
    ],
)
def test_hostile_text_is_refused(text):  # more of it: test_strict_yaml.py
    with pytest.raises(ShipFileError) as caught:
        Ship.from_yaml(text, subject='hostile')
    assert len(str(caught.value)) < 5000


@settings(max_examples=60, deadline=None)
@given(
    name=st.text(max_size=20),
    length=st.floats(100.0, 200.0),
    volume=st.floats(18e3, 22e3),
    value=st.floats(1e-3, 2.0),
    sd=st.floats(0.0, 1.0),
    effect=st.floats(-1e12, 1e12),
)
def test_round_trip_is_exact(name, length, volume, value, sd, effect):
    ship = Ship.from_yaml(
        yaml.safe_dump(
            {
                'name': name,
                'length_m': length,
                'displaced_volume_m3': volume,
                'added_mass': {'model': 'constant', 'value': value, 'sd': sd},
                'effects': [{'name': name, 'parameters': {name: {'value': effect, 'sd': sd}}}],
            }
        ),
        subject='test',
    )
    assert ship.length_m == length
    assert Ship.from_yaml(ship.to_yaml(), subject='again') == ship


def test_a_ship_is_one_line(cargo: Ship) -> None:
    assert cargo.summary() == 'Vitus Bering: length 150 m, displacement 20200 m³ (20,705 t)'
    model = Ship(length_m=1.1, displaced_volume_m3=0.0142)
    assert model.summary().startswith('a ship without a name: ')
    assert model.summary().endswith('displacement 0.0142 m³ (14.56 kg)')


@pytest.mark.parametrize(
    ('values', 'key'),
    [
        ({'length_m': -80.0}, 'length_m'),
        ({'length_m': math.nan}, 'length_m'),
        ({'length_m': math.inf}, 'length_m'),
        ({'displaced_volume_m3': 0.0}, 'displaced_volume_m3'),
        ({'breadth_m': -13.0}, 'breadth_m'),
        ({'draught_m': -5.0}, 'draught_m'),
        ({'wetted_surface_m2': math.nan}, 'wetted_surface_m2'),
    ],
)
def test_a_ship_made_in_python_has_sizes_above_zero(values: dict[str, Any], key: str) -> None:
    with pytest.raises(ShipFileError, match=re.escape(key)):
        Ship(**{'length_m': 80.0, 'displaced_volume_m3': 4000.0} | values)


def test_numbers_of_numpy_are_numbers() -> None:
    ship = Ship(length_m=np.float32(80.0), displaced_volume_m3=np.int64(4000))  # type: ignore[arg-type]
    assert ship.mass_kg == 4000 * 1025.0
    assert type(ship.length_m) is type(ship.displaced_volume_m3) is float


def test_text_is_read_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / 'text'
    path.write_bytes('\ufeffä'.encode())
    assert read_small_text(path, most_bytes=5) == 'ä'
    with pytest.raises(OSError, match='more than 4 bytes'):
        read_small_text(path, most_bytes=4)


SHIP = Ship(length_m=80.0, displaced_volume_m3=4000.0, breadth_m=13.0, draught_m=5.5)
SHEET = """
facts: [calm]
draught_m: 6.0
displaced_volume_m3: 4400
water: {temperature_c: 25, density: 1010}
"""


def test_what_is_stated_of_a_run_overrides_the_ship_file() -> None:
    sheet = RunSheet.from_yaml(SHEET, subject='run.yaml')
    ship = sheet.of(replace(SHIP, facts=(Fact('calm', rate=0.3),)), subject='run.yaml')
    assert sheet.facts == ship.facts == (Fact('calm'),)
    assert (ship.draught_m, ship.displaced_volume_m3) == (6.0, 4400.0)
    assert ship.water.density_kg_m3 == 1010.0
    assert ship.water.kinematic_viscosity_m2_s == kinematic_viscosity(25.0, 1010.0)
    was = replace(ship, draught_m=5.5, displaced_volume_m3=4000.0, water=SHIP.water, facts=())
    assert was == SHIP
    assert RunSheet().of(SHIP, subject='none') == SHIP


@pytest.mark.parametrize(
    ('temperature_c', 'density', 'expected'),
    # ITTC 7.5-02-01-03: fresh and sea water
    [(15.0, 999.1, 1.1386e-6), (15.0, 1026.0, 1.1892e-6), (5.0, 1027.7, 1.5617e-6)],
)
def test_viscosity_is_that_of_the_tables(temperature_c, density, expected):
    assert kinematic_viscosity(temperature_c, density) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ('text', 'wrong'),
    [
        ('{speed: 3}', 'speed: unknown key'),
        ('{draught_m: deep}', "draught_m: 'deep', expected a number"),
        ('{facts: [fog]}', "'fog' is no known fact"),
        ('{water: {density: 1000, density_kg_m3: 1025}}', 'keep one'),
        ('[1]', 'expected the keys'),
        ('{', 'not YAML'),
    ],
)
def test_a_wrong_run_file_says_what_is_wrong(text: str, wrong: str) -> None:
    with pytest.raises(ShipFileError) as refused:
        RunSheet.from_yaml(text, subject='run.yaml')
    assert wrong in str(refused.value)


def test_a_volume_that_cannot_be_hers_is_refused() -> None:
    with pytest.raises(ShipFileError, match=r'run\.yaml'):
        RunSheet(displaced_volume_m3=40.0).of(SHIP, subject='run.yaml')


@pytest.mark.parametrize('kind', [tuple, list, np.array])
def test_a_table_made_in_python_may_be_any_sequence(kind: Any) -> None:
    table = TableBaseline(kind([0.0, 1.0, 2.0]), kind([0.0, 1.0, 4.0]), 0.1)
    assert float(table.resistance(np.array([1.0]))[0]) == 1.0
