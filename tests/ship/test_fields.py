# SPDX-License-Identifier: Apache-2.0
"""Every wrong key and value of a ship file, all in one report."""

import pytest

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.ship import Ship

WRONG = """\
name: 12
lenght_m: 150.0
displaced_volume_m3: '20200'
breadth_m: true
draught_m: .nan
wetted_surface_m2: .inf
water: {density_kg_m3: 1.025, viscosity: 1.0}
added_mass: {model: merchand}
air: 480
propeller: {diameter_m: 5.6, state_in_baseline: loose}
propulsion: {run_down_s: -8.0}
baseline:
  form_factor: 20
  correlation_allowance: 3.0e-4
  wave_froude: [0.0, 0.12, 0.12]
  wave_coefficient: [0.0, -5.0e-5, 2.8e-4]
  relative_sd: 0.02
effects: [{name: fouling, parameters: {friction_factor: 0.2}}]
"""


def problems_of(text: str) -> tuple[str, ...]:
    with pytest.raises(ShipFileError) as caught:
        Ship.from_yaml(text, subject='ship.yaml')
    assert str(caught.value).startswith(f'ship.yaml: {len(caught.value.problems)} problem(s)')
    return caught.value.problems


def test_all_problems_come_in_one_report_with_key_value_and_expectation():
    found = problems_of(WRONG)
    expected = [
        ('lenght_m', 'unknown key', 'did you mean length_m?'),
        ('name', '12', 'text'),
        ('length_m', 'missing', '0.5..500 m'),
        ('displaced_volume_m3', "'20200'", 'number without quotes'),
        ('breadth_m', 'True', 'number'),
        ('draught_m', 'nan', '0.01..40 m'),
        ('wetted_surface_m2', 'inf', 'm^2'),
        ('water.viscosity', 'unknown key', 'kinematic_viscosity_m2_s'),
        ('water.density_kg_m3', '1.025', '900..1100 kg/m^3'),
        ('added_mass.model', "'merchand'", 'merchant, constant or table'),
        ('air', '480', 'frontal_area_m2'),
        ('propeller.state_in_baseline', "'loose'", 'free, locked, none'),
        ('propulsion.run_down_s', '-8.0', '0..600 s'),
        ('baseline.form_factor', '20', '0..1'),
        ('baseline.wave_froude[2]', '0.12', 'ascending'),
        ('baseline.wave_coefficient[1]', '-5e-05', '0..0.1'),
        ('baseline.relative_sd', '0.02', 'friction, wave'),
        ('effects[0].parameters.friction_factor', '0.2', 'value, sd'),
    ]
    for key, value, expectation in expected:
        lines = [line for line in found if line.startswith(f'{key}:')]
        assert len(lines) == 1, key
        assert value in lines[0]
        assert expectation in lines[0]
    assert len(found) == len(expected)


@pytest.mark.parametrize(
    ('line', 'key'),
    [
        ('water: {density_kg_m3: 850.0}', 'water.density_kg_m3'),
        ('water: {kinematic_viscosity_m2_s: 1.19}', 'water.kinematic_viscosity_m2_s'),
        ('added_mass: {model: constant}', 'added_mass.value'),
        ('added_mass: {model: constant, value: 0.0}', 'added_mass.value'),
        ('added_mass: {sd: 0.02}', 'added_mass.model'),
        ('added_mass: {model: merchant, value: 0.07}', 'added_mass.value'),
        ('added_mass: {model: table, coefficients: []}', 'added_mass.coefficients'),
        ('added_mass: {model: table, coefficients: [0.1]}', 'added_mass.coefficients[0]'),
        ('air: {frontal_area_m2: 480.0}', 'air.drag_coefficient'),
        ('air:', 'air'),
        ('baseline: {}', 'baseline.form_factor'),
        ('baseline: {speed_m_s: [1.0, 2.0], relative_sd: 0.1}', 'baseline.resistance_n'),
        (
            'baseline: {speed_m_s: [1.0], resistance_n: [1.0], relative_sd: 0}',
            'baseline.speed_m_s',
        ),
        ('effects: {name: fouling}', 'effects'),
        ('effects: [{name: fouling}]', 'effects[0].parameters'),
        (
            'effects: [{name: x, parameters: {p: {value: .inf, sd: 0}}}]',
            'effects[0].parameters.p.value',
        ),
    ],
)
def test_one_wrong_key_is_named(line, key):
    found = problems_of(f'length_m: 150.0\ndisplaced_volume_m3: 20200.0\n{line}\n')
    assert any(problem.startswith(f'{key}:') for problem in found), found
