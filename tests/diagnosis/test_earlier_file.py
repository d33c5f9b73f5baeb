# SPDX-License-Identifier: Apache-2.0
"""Earlier diagnoses are read from files that may be anything."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.diagnosis.earlier import read_earlier
from shipdrag_ros.errors import DiagnosisError

FOULED = {'name': 'fouling', 'parameters': {'friction_factor': {'value': 0.3, 'sd': 0.04}}}
DOCUMENT: dict[str, Any] = {
    'candidates': [
        {'names': ['unknown'], 'probability': 0.1, 'effects': []},
        {'names': ['fouling'], 'probability': 0.8, 'effects': [FOULED]},
        {'names': ['none'], 'probability': 0.09, 'effects': []},
    ],
    'baseline': 'stated',
    'ship': {'name': 'Vitus Bering', 'length_m': 150.0, 'effects': ['log_scale']},
    'runs': [{'bag': 'out.mcap', 'time_ns': 1_700_000_000_000_000_000}],
    'earlier': [
        {'used': True, 'runs': [{'bag': 'old.mcap', 'time_ns': 1_600_000_000_000_000_000}]},
        {'used': False, 'runs': [{'bag': 'older.mcap', 'time_ns': 1_500_000_000_000_000_000}]},
    ],
}


def write(folder: Path, text: str) -> Path:
    path = folder / 'then.json'
    path.write_text(text)
    return path


def test_what_is_needed_is_read(tmp_path: Path) -> None:
    found = read_earlier(write(tmp_path, json.dumps(DOCUMENT)))
    assert (found.ship, found.length_m, found.stated) == ('Vitus Bering', 150.0, ('log_scale',))
    assert [run.name for run in found.runs] == ['out.mcap']
    assert [run.name for run in found.before] == ['old.mcap']
    assert found.of_force
    assert found.probability('fouling') == 0.8
    assert [each.probability for each in found.candidates] == [0.8, 0.09]
    assert found.candidates[0].effects['fouling']['friction_factor'].sd == 0.04


def test_a_size_without_sd_and_a_record_without_a_ship_are_read(tmp_path: Path) -> None:
    bare = json.dumps({**DOCUMENT, 'ship': None, 'baseline': 'none'})
    found = read_earlier(write(tmp_path, bare.replace('"sd": 0.04', '"sd": null')))
    assert (found.ship, found.length_m, found.of_force) == ('', None, False)
    assert math.isnan(found.candidates[0].effects['fouling']['friction_factor'].sd)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', 'not JSON'),
        ('{"runs": [}', 'not JSON'),
        ('[' * 100_000, 'nested too deeply|not JSON'),
        ('{"candidates": NaN}', 'NaN is no number'),
        ('9' * 10_000, 'not JSON'),
        ('x' * 1_000_001, 'more than 1000000 bytes'),
        ('[]', 'list of 0, expected names with values'),
        ('{}', 'runs: missing'),
    ],
)
def test_what_is_no_diagnosis_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DiagnosisError, match=said) as caught:
        read_earlier(write(tmp_path, text))
    assert 'with --earlier FILE' in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(tmp_path))


@pytest.mark.parametrize(
    ('key', 'value', 'said'),
    [
        ('runs', [], 'runs: empty'),
        ('runs', [{'bag': 'x', 'time_ns': True}], 'time_ns: True'),
        ('runs', [{'bag': 'x', 'time_ns': 10**40}], 'time_ns'),
        ('runs', [{'bag': '\x1b[2J', 'time_ns': 1}], 'expected a line of text'),
        ('runs', [{'bag': 'x', 'time_ns': 1}] * 1001, 'list of 1001'),
        ('ship', {'name': 'x', 'length_m': 1e400, 'effects': []}, 'not JSON|length_m'),
        ('candidates', [], 'candidates: 0'),
        ('candidates', [{'names': ['none'], 'probability': 0.6, 'effects': []}] * 2, '1.2 in all'),
        ('candidates', [{'names': ['fog'], 'probability': 0.6, 'effects': []}], 'effects others'),
        (
            'candidates',
            [{'names': ['none'], 'probability': 0.6, 'effects': [FOULED]}],
            'effects others',
        ),
        (
            'candidates',
            [{'names': ['fog'], 'probability': 0.6, 'effects': [{'name': 'fog'}]}],
            "'fog' is no effect that this version knows",
        ),
        (
            'candidates',
            [
                {
                    'names': ['fouling'],
                    'probability': 0.6,
                    'effects': [{'name': 'fouling', 'parameters': {}}],
                }
            ],
            'friction_factor: missing',
        ),
    ],
)
def test_what_is_wrong_in_it_is_said(tmp_path: Path, key: str, value: Any, said: str) -> None:
    with pytest.raises(DiagnosisError, match=said):
        read_earlier(write(tmp_path, json.dumps({**DOCUMENT, key: value})))


def test_a_file_that_is_not_there_or_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DiagnosisError, match='No such file'):
        read_earlier(tmp_path / 'none.json')
    with pytest.raises(DiagnosisError, match='Is a directory'):
        read_earlier(tmp_path)
