# SPDX-License-Identifier: Apache-2.0
"""The page on measured records: its commands run, and give the figures that it states."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.accuracy import real_diagnosis, real_records

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'docs' / 'real_records.md').read_text(encoding='utf-8')
TABLES = (ROOT / 'docs' / 'results' / 'real_records.txt').read_text(encoding='utf-8')
COMMANDS = re.findall(r'^ +(shipdrag (?:import|replay) .*)$', PAGE, flags=re.MULTILINE)
SPANS = re.findall(r'`(shipdrag (?:import|replay|diagnose) \S[^`]*)`', PAGE)
ROWS = {
    cells[0]: cells[1:]
    for line in TABLES.partition('published problems -->')[2].partition('<!-- end')[0].splitlines()
    if len(cells := [cell.strip() for cell in line.strip('|').split('|')]) == 5
    and cells[0] not in ('record', '---')
}
# nobody asks for the onset of a car, nor twice for that of the model ship
WHOLE = [name for name in ROWS if not name.startswith('car') and not name.endswith('joint')]
needs_data = pytest.mark.skipif(
    'SHIPDRAG_DATA' not in os.environ, reason='needs the folder of records in SHIPDRAG_DATA'
)


@pytest.fixture(scope='module')
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What `replay --json` says of each record, with the window and without."""
    out = tmp_path_factory.mktemp('records')
    found = {}
    for record in real_records.RECORDS:
        real_records.run_command(record.import_command(), out=out)
        for window in (True, False) if record.name in WHOLE else (True,):
            line = f'{record.replay_command(window=window)} --json one.json'
            real_records.run_command(line, out=out)
            found[record.name, window] = json.loads((out / 'one.json').read_text())
    return found


def test_the_page_shows_the_commands_of_the_script() -> None:
    known = {record.import_command() for record in real_records.RECORDS}
    known |= {record.replay_command() for record in real_records.RECORDS}
    assert len(COMMANDS) == 10
    assert set(COMMANDS) <= known
    assert list(ROWS) == [record.name for record in real_records.RECORDS]
    known |= {line for both in real_diagnosis.RECORDS.values() for line in both}
    assert len(SPANS) == 2
    assert {line.replace('log.mcap', 'yacht.mcap') for line in SPANS} <= known


def test_without_the_records_the_script_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv('SHIPDRAG_DATA', raising=False)
    monkeypatch.setattr(sys, 'argv', ['real_records.py', '--out', str(tmp_path / 'out')])
    real_records.main()
    assert 'skipped: SHIPDRAG_DATA is not set' in capsys.readouterr().out
    assert not (tmp_path / 'out').exists()


@needs_data
@pytest.mark.parametrize('name', ROWS)
def test_each_record_gives_the_figures_of_the_page(results: dict[str, Any], name: str) -> None:
    fit, valid, stated, w = ROWS[name]
    (coastdown,) = results[name, True]['coastdowns']
    assert coastdown['ended_by'] == 'given'
    assert f'{coastdown["estimator"].removeprefix("s1_")}, {coastdown["order"]}' == fit
    assert all(not counts['rejected'] for counts in results[name, True]['inputs'].values())
    speed, r, sigma = (
        np.array(coastdown[key]) for key in ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2')
    )
    limits = [float(limit) for limit in valid.split(' to ')]
    np.testing.assert_allclose([speed[0], speed[-1]], limits, rtol=0.0, atol=0.0051)
    np.testing.assert_allclose(100.0 * coastdown['w'], float(w), rtol=0.0, atol=0.51)
    points = re.findall(r'([\d.]+): ([\d.]+) ± ([\d.]+) \(([\d.]+)\)', stated)
    assert len(points) >= 2
    for at, value, two_sigma, _ in (map(float, point) for point in points):
        # the page has two digits of the band
        np.testing.assert_allclose(np.interp(at, speed, r), value, rtol=0.0, atol=0.06 * two_sigma)
        np.testing.assert_allclose(2.0 * np.interp(at, speed, sigma), two_sigma, rtol=0.06)


@pytest.mark.parametrize('name', [name for name in ROWS if name.startswith(('ferry', 'car'))])
def test_the_second_opinion_agrees_where_the_samples_are_many(name: str) -> None:
    points = re.findall(r'([\d.]+): ([\d.]+) ± ([\d.]+) \(([\d.]+)\)', ROWS[name][2])
    for _, value, _, other in (map(float, point) for point in points):
        np.testing.assert_allclose(value, other, rtol=0.06)  # two digits are worth 1 % of that


@needs_data
@pytest.mark.parametrize('name', WHOLE)
def test_without_steady_sailing_before_no_onset_is_found(results, name):
    assert results[name, False]['coastdowns'] == []


@needs_data
def test_the_model_ship_drifts_and_the_joint_fit_shows_it(results: dict[str, Any]) -> None:
    (alone,) = results['model_ship', True]['coastdowns']
    (joint,) = results['model_ship_joint', True]['coastdowns']
    name = 'speed_through_water'
    np.testing.assert_allclose(alone['noise_sd'][name], 0.0004, rtol=0.2)
    np.testing.assert_allclose(joint['noise_sd'][name], 0.014, rtol=0.1)
    assert any('she turns by 4' in note for note in alone['notes'])


@needs_data
def test_the_ferry_path_and_the_ship_at_rest(tmp_path, capsys) -> None:
    for record in (real_records.FERRY, real_records.MODEL_SHIP):
        real_records.run_command(record.import_command(), out=tmp_path)
    real_records.show_ferry_path(tmp_path)
    lengths = [float(x) for x in re.findall(r's1_\w+ +([\d.]+)', capsys.readouterr().out)]
    # integral of the speed, then path of the positions, alone and jointly
    np.testing.assert_allclose(lengths, [4.41, 4.29, 4.29], rtol=0.0, atol=0.01)
    (slow,) = real_records.replayed(real_records.MODEL_SHIP, tmp_path, froude_min=0.001).coastdowns
    assert slow.estimate is not None
    curve = slow.estimate.valid_curve
    assert curve.speed_m_s[0] < 0.004
    np.testing.assert_allclose(curve.resistance_m_s2[0], 0.0046, rtol=0.05)
    fitted = slow.estimate.tracks['speed_through_water'].fitted
    np.testing.assert_allclose(fitted.min(), -0.016, rtol=0.0, atol=0.001)


@pytest.fixture(scope='module')
def diagnoses(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What `diagnose --json` says of the logs of two yachts."""
    out = tmp_path_factory.mktemp('diagnoses')
    return {name: real_diagnosis.diagnosed(name, out=out) for name in real_diagnosis.RECORDS}


@needs_data
def test_the_page_says_what_the_command_says(diagnoses: dict[str, Any]) -> None:
    for name, found in diagnoses.items():
        made = f'<!-- {name} -->\n{real_diagnosis.block(found)}\n<!-- end {name} -->'
        assert made in TABLES, 'run: python -m benchmarks.accuracy.real_diagnosis --write'


@needs_data
def test_the_log_of_the_yacht_has_a_scale_error(diagnoses: dict[str, Any]) -> None:
    found = diagnoses['yacht, 3.5 h of sailing']
    assert found['verdict'] == 'named'
    assert found['baseline'] == 'none'
    (effect,) = found['effects']
    assert effect['name'] == 'log_scale'
    # measured by others: the log reads 0.946 +- 0.02 of the speed over ground
    np.testing.assert_allclose(
        effect['parameters']['factor']['value'], -0.054, rtol=0.0, atol=0.02
    )
    value, sd = (effect['parameters']['factor'][key] for key in ('value', 'sd'))
    assert 0.0 < sd < 0.02
    assert abs(value) > 5.0 * sd
    assert any(note.startswith('why not current') for note in found['notes'])
    gap = found['gap']
    assert gap['held_out_before'] is None
    assert gap['held_out_after'] is None
    assert gap['before']['rms_position_m'] is None
    assert gap['after']['chi2_per_sample'] < 1.1 < gap['before']['chi2_per_sample']


@needs_data
def test_a_wheel_that_stands_still_is_a_dead_band(diagnoses: dict[str, Any]) -> None:
    found = diagnoses['Irene, 2007']
    assert found['verdict'] == 'named'
    (effect,) = found['effects']
    assert effect['name'] == 'log_dead_band'
    # 99 % of the readings are 0 from 0.3 to 1.2 kn, 22 % from 1.2 to 1.5 kn
    assert 0.9 * 0.617 < effect['parameters']['speed_m_s']['value'] < 1.1 * 0.772
    assert found['examined'] == ['log_track']
    assert 'the log reads exactly 0 in' in found['notes'][0]


@needs_data
def test_a_steady_current_is_no_noise(diagnoses: dict[str, Any]) -> None:
    found = diagnoses['Irene, 2013']
    assert found['verdict'] == 'named'
    # the wheel of 2007 too, which stands still below 0.617 to 0.772 m/s
    (wheel,) = found['effects']
    assert wheel['name'] == 'log_dead_band'
    assert set(found['candidates'][0]['names']) == {'current', 'log_dead_band'}
    size = wheel['parameters']['speed_m_s']
    assert 0.617 - 2.0 * size['sd'] < size['value'] < 0.772 + 2.0 * size['sd']
    (told,) = (note for note in found['notes'] if note.startswith('the water moves by'))
    east, north = map(float, re.findall(r'[+-]\d\.\d+', told))
    # found by other means, +- 0.03 (two standard deviations)
    np.testing.assert_allclose([east, north], [0.106, -0.041], rtol=0.0, atol=0.03)


@needs_data
def test_a_wheel_may_read_a_sixth_too_little(diagnoses: dict[str, Any]) -> None:
    found = diagnoses['Irene, 2014']
    assert found['verdict'] == 'named'
    (effect,) = found['effects']
    assert effect['name'] == 'log_scale'
    size = effect['parameters']['factor']
    np.testing.assert_allclose(size['value'], -0.173, rtol=0.0, atol=0.008 + size['sd'])
