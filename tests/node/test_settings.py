# SPDX-License-Identifier: Apache-2.0
"""The one list of settings, and the file made from it."""

from __future__ import annotations

import ast
from array import array
from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from shipdrag_ros.errors import ParameterError
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.node.settings import KEYS, NodeSettings, parameters_file
from shipdrag_ros.parameters import Parameters

ROOT = Path(__file__).parents[2]


def settings(**values: object) -> NodeSettings:
    return NodeSettings.from_mapping(values, subject='test')


def test_every_parameter_and_input_is_a_setting() -> None:
    names = set(KEYS)
    assert {field.name for field in fields(Parameters)} <= names
    assert {f'{name}.type' for name in TOPICS} <= names


def test_defaults_are_those_of_the_parameters() -> None:
    assert settings().parameters == Parameters()
    assert settings().types == {}


def test_mapping_goes_there_and_back() -> None:
    given = {'record': False, 'window_s': 600.0, 'heading.type': 'sensor_msgs/msg/Imu'}
    there = NodeSettings.from_mapping(given, subject='test')
    assert there.types == {'heading': 'sensor_msgs/msg/Imu'}
    assert there.parameters.window_s == 600.0
    assert NodeSettings.from_mapping(there.to_mapping(), subject='test') == there


def test_the_file_is_up_to_date() -> None:
    text = (ROOT / 'config' / 'parameters.yaml').read_text()
    assert text == parameters_file(), 'run python -m shipdrag_ros.node.settings'


def test_the_file_holds_every_default() -> None:
    values = yaml.safe_load(parameters_file())['/**']['ros__parameters']
    assert values == settings().to_mapping()


def test_paths_stay_inside_their_roots(tmp_path: Path) -> None:
    inside, outside = tmp_path / 'inside', tmp_path / 'outside'
    inside.mkdir()
    outside.mkdir()
    (inside / 'link').symlink_to(outside)
    fits = {'ship_file': str(inside / 'ship.yaml'), 'output_directory': str(inside / 'bags')}
    roots = f'{tmp_path / "other"}:{inside}'
    assert settings(**fits, path_roots=roots).paths() == (inside / 'ship.yaml', inside / 'bags')
    assert settings(**fits | {'ship_file': str(outside / 'x')}).paths()[0] == outside / 'x'
    for name, path in (
        ('ship_file', outside / 'ship.yaml'),
        ('ship_file', inside / '..' / 'outside' / 'ship.yaml'),
        ('output_directory', inside / 'link' / 'bags'),
    ):
        with pytest.raises(ParameterError, match=f'{name}: .*outside of path_roots'):
            settings(**fits | {name: str(path), 'path_roots': roots}).paths()


def test_the_launch_file_parses_and_sets_known_parameters() -> None:
    tree = ast.parse((ROOT / 'launch' / 'coastdown.launch.py').read_text())
    dicts = [node for node in ast.walk(tree) if isinstance(node, ast.Dict)]
    names = {key.value for node in dicts for key in node.keys if isinstance(key, ast.Constant)}
    assert names - {'use_sim_time'} <= set(KEYS)
    assert {'ship_file', 'output_directory', 'autostart'} <= names


def test_the_error_of_a_former_name_says_the_new_one() -> None:
    estimator = KEYS['estimator'].kind
    assert 'warped' not in estimator.choices
    problems: list[str] = []
    estimator.read('warped', 'estimator', problems)
    assert "which is 'one' now" in problems.pop()
    assert problems == []
    estimator.read('kalman', 'estimator', problems)
    assert 's1_speed' in problems[0]
    assert 'warped' not in problems[0]


def test_a_list_that_came_by_ros_is_shown_as_one() -> None:
    with pytest.raises(ParameterError, match=r'forecast_speeds: \[\], expected a list'):
        settings(forecast_speeds=array('d'))


def test_a_former_key_is_an_error_that_names_the_successor() -> None:
    with pytest.raises(ParameterError, match='confirm_s: no key any more; leave it out'):
        settings(confirm_s=5.0)
