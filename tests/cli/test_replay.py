# SPDX-License-Identifier: Apache-2.0
"""What `replay` says, in words, in JSON and in files."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.replay.playback import ship_of
from shipdrag_ros.ship import Ship

# a coastdown, without the estimates on the way
WINDOW = ('--window', '300', '700')
Replay = Callable[..., tuple[dict[str, Any], str]]


@pytest.fixture
def replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Replay:
    """Replay; return the JSON, and what is said."""

    def run(*arguments: str | Path) -> tuple[dict[str, Any], str]:
        document = tmp_path / 'document.json'
        capsys.readouterr()
        assert main(['replay', *map(str, arguments), '--json', str(document)]) == 0
        captured = capsys.readouterr()
        assert re.fullmatch(r'((JSON|report).* in \S+\n)+', captured.err)  # no warning
        return json.loads(document.read_text()), captured.out

    return run


def test_the_json_has_its_keys_the_curve_is_near_the_truth_and_the_words_give_every_figure(
    coastdown_bag: Path, ship_file: Path, replay: Replay
) -> None:
    found, said = replay(coastdown_bag)
    assert set(found) == {
        'coastdowns',
        'not_coastdowns',
        'not_combined',
        'combined',
        'inputs',
        'recorded',
        'warnings',
    }
    assert found['combined'] is None
    assert found['warnings'] == []
    assert found['recorded'] == {
        'compared': 0,
        'identical': 0,
        'first_difference': None,
        'largest_difference': 0.0,
        'largest_difference_sigma': 0.0,
        'by': None,
        'beside': 0,
    }
    assert found['inputs']['position'] == {'messages': 1801, 'used': 1801, 'rejected': {}}
    (coastdown,) = found['coastdowns']
    assert {
        'bag',
        'start_ns',
        'end_ns',
        'onset_detected_ns',
        'ended_by',
        'estimator',
        'order',
        'samples',
        'speed_m_s',
        'resistance_m_s2',
        'sigma_m_s2',
        'sigma_repeatable_m_s2',
        'froude',
        'froude_valid',
        'noise_sd',
        'current_m_s',
    } <= set(coastdown)
    assert coastdown['bag'] == str(coastdown_bag)
    assert coastdown['estimator'] == 'one'
    assert coastdown['start_ns'] < coastdown['onset_detected_ns'] < coastdown['end_ns']
    low, high = coastdown['froude_valid']
    froude = np.array(coastdown['froude'])
    assert np.all((froude >= low) & (froude <= high))
    speed = np.array(coastdown['speed_m_s'])
    assert np.all(np.diff(speed) > 0)

    ship = Ship.load(ship_file)
    middle = (speed > 3.0) & (speed < 7.0)
    r = np.array(coastdown['resistance_m_s2'])[middle]
    true = ship.resistance_n(speed[middle]) / ship.mass_kg
    np.testing.assert_allclose(r, true, rtol=0.10)
    total = np.array(coastdown['sigma_m_s2'])
    assert np.all(total > np.array(coastdown['sigma_repeatable_m_s2']))

    for text in (
        'start',
        'duration',
        'ended because',
        'one',
        'coefficients',
        'samples used',
        'valid range',
        'speed [knots]  resistance [kN]',
        'true r',
        'speed_through_water      1801  1801         -',
        'No outputs of the bag were compared',
    ):
        assert text in said


def test_no_coastdown_is_a_result(steady_bag: Path, replay: Replay) -> None:
    found, said = replay(steady_bag)
    assert found['coastdowns'] == []
    assert 'No coastdown found: longest steady sailing ' in said


def test_a_log_in_another_unit_is_named_and_the_positions_give_the_figure(
    tmp_path: Path, ship_file: Path, replay: Replay
) -> None:
    bag = tmp_path / 'km_h.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(bag), '--speed', '8', '--seed', '5']
    line += ['--lead-in', '1200', '--duration', '1200', '--effect', 'log_scale=2.6']
    assert main([*line, '--inputs', 'speed_through_water,position']) == 0
    found, _ = replay(bag)
    (warning,) = (each['warning'] for each in found['warnings'])
    assert warning.startswith('speed_through_water: over a minute up to')
    assert 'the position 2.30' in warning
    assert 'which is used instead' in warning
    (coastdown,) = found['coastdowns']
    assert coastdown['samples'].keys() == {'position'}


def test_another_ship_gives_another_range_of_a_given_window(coastdown_bag, tmp_path, replay):
    other = tmp_path / 'ship.yaml'
    other.write_text(
        '{length_m: 150, displaced_volume_m3: 20200, added_mass: {model: constant, value: 0.2}}'
    )
    window = ('--window', '300', '1800')  # all of it, or her prior is most of the figure
    (own,) = replay(coastdown_bag, *window)[0]['coastdowns']
    (given,) = replay(coastdown_bag, *window, '--ship', other)[0]['coastdowns']
    assert (own['ended_by'], own['onset_detected_ns']) == ('given', None)
    assert own['samples']['speed_through_water'] == own['samples']['position'] > 1480
    np.testing.assert_allclose(given['speed_m_s'][-1], own['speed_m_s'][-1], rtol=1e-3)
    # 1.2 instead of 1.06 to 1.10
    assert 1.05 < given['resistance_m_s2'][-1] / own['resistance_m_s2'][-1] < 1.15


def test_other_parameters_and_names_of_topics_give_another_estimate(
    coastdown_bag: Path, tmp_path: Path, replay: Replay
) -> None:
    (tmp_path / 'parameters.yaml').write_text('estimator: s1_speed')
    more = ('--parameters', tmp_path / 'parameters.yaml')
    more += ('--remap', '/speed_through_water:=speed_over_ground')
    found, _ = replay(coastdown_bag, *WINDOW, *more)
    assert found['coastdowns'][0]['estimator'] == 's1_speed'
    assert 'speed_through_water' not in found['inputs']
    assert found['inputs']['speed_over_ground']['messages'] == 401


def test_everything_is_written_to_a_folder_and_a_report_is_one_file(
    coastdown_bag: Path, tmp_path: Path, replay: Replay
) -> None:
    out, alone = tmp_path / 'new' / 'folder', tmp_path / 'alone'
    alone.mkdir()
    found, _ = replay(coastdown_bag, *WINDOW, '--out', out, '--report', alone / 'a.html')
    assert json.loads((out / 'result.json').read_text()) == found
    with (out / 'curves.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert [float(row['speed_m_s']) for row in rows] == found['coastdowns'][0]['speed_m_s']
    assert 'data:image/svg+xml;base64' in (out / 'report.html').read_text()
    assert [path.name for path in alone.iterdir()] == ['a.html']


def test_hulls_are_compared(coastdown_bag, ship_file, tmp_path, replay):
    other = tmp_path / 'slow.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(other), '--speed', '6']
    assert main([*line, '--lead-in', '300']) == 0
    found, said = replay(other, coastdown_bag, *WINDOW, '--compare')
    tops = [hull['froude_max'] for hull in found['hulls']]
    assert tops == sorted(tops, reverse=True)
    assert str(coastdown_bag) in found['hulls'][0]['name']
    assert '1. Vitus Bering' in said
    assert 'ranks the onset of wave making and nothing else' in said


@pytest.mark.parametrize(
    ('line', 'said'),
    [
        (['--json', 'BAG'], 'would be overwritten by the JSON'),
        ([], 'the following arguments are required: BAG'),
        (['BAG', '--report', 'no such folder/a.html'], "no folder 'no such folder'"),
        (['BAG', '--json', 'no such folder/a.json'], "no folder 'no such folder'"),
        (['BAG', '--window', '1'], 'expected 2 arguments'),
        (['BAG', '--window', '-1', '5'], 'at least 0'),
        (['--remap', 'a:=b', 'c:=d', 'BAG'], 'write --remap before each'),
    ],
)
def test_wrong_usage_is_explained(coastdown_bag: Path, capsys, line: list[str], said: str) -> None:
    before = coastdown_bag.read_bytes()
    with pytest.raises(SystemExit) as end:
        main(['replay', *(str(coastdown_bag) if word == 'BAG' else word for word in line)])
    assert end.value.code == 2
    assert said in capsys.readouterr().err
    assert coastdown_bag.read_bytes() == before


@pytest.mark.parametrize(
    ('option', 'said'),
    [
        (['--parameters', 'no such.yaml'], 'ERROR: no such.yaml: 1 problem(s)'),
        (['--out', __file__], 'File exists'),
    ],
)
def test_a_user_error_is_told(coastdown_bag: Path, capsys, option: list[str], said: str) -> None:
    assert main(['replay', str(coastdown_bag), *option]) == 1
    assert said in capsys.readouterr().err


def test_what_stands_beside_a_bag_holds_for_its_replay(coastdown_bag, tmp_path, replay):
    bag = tmp_path / 'own.mcap'
    bag.write_bytes(coastdown_bag.read_bytes())
    found, said = replay(bag, *WINDOW)
    (alone,) = found['coastdowns']
    (run,) = open_runs([bag])
    ship = ship_of(run, None)
    assert f'{ship.mass_kg / 1e3:,.0f} t' in said
    sheet = tmp_path / 'own.mcap.run.yaml'
    sheet.write_text(f'displaced_volume_m3: {0.9 * ship.displaced_volume_m3}\nfacts: [calm]\n')
    found, said = replay(bag, *WINDOW)
    assert f'{0.9 * ship.mass_kg / 1e3:,.0f} t' in said
    assert {'bag': str(bag), 'warning': f'{sheet} holds for this run'} in found['warnings']
    (of_run,) = found['coastdowns']
    assert (alone['reference']['wind'], of_run['reference']['wind']) == ('unknown', 'stated')


@pytest.mark.parametrize('wrong', [['--ship', 'none.yaml'], ['--parameters', 'none.yaml']])
def test_no_folder_is_made_where_a_file_cannot_be_read(
    coastdown_bag: Path, tmp_path: Path, wrong: list[str]
) -> None:
    out = tmp_path / 'report'
    assert main(['replay', str(coastdown_bag), '--out', str(out), *wrong]) == 1
    assert main(['replay', str(tmp_path / 'none.mcap'), '--out', str(out)]) == 1
    assert not out.exists()
