# SPDX-License-Identifier: Apache-2.0
"""What `forecast` says, in words and in JSON, and the same in Python."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import shipdrag_ros as sd
from shipdrag_ros.cli import main
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, simulate

mpl.use('agg')


@pytest.fixture(scope='module')
def found(coastdown_bag: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    out = tmp_path_factory.mktemp('forecast') / 'forecast.json'
    line = ['forecast', str(coastdown_bag), '--after', '300', '600', '5000', f'--json={out}']
    assert main(line) == 0
    result: dict[str, Any] = json.loads(out.read_text())
    return result


def test_the_json_has_its_keys(found: dict[str, Any], coastdown_bag: Path) -> None:
    assert [each['bag'] for each in found['forecasts']] == [str(coastdown_bag)] * 2
    for each, after_s in zip(found['forecasts'], (300.0, 600.0), strict=True):
        assert {'stop_ns', 'made_ns', 'speeds', 'inside', 'interval_score'} <= set(each)
        assert (each['made_ns'] - each['stop_ns']) * 1e-9 == pytest.approx(after_s, abs=2.0)
        for speed in each['speeds']:
            assert set(speed) == {'speed_m_s', 'time_s', 'distance_m'}
            for band in (speed['time_s'], speed['distance_m']):
                assert set(band) == {'median', 'low', 'high', 'was'}
                assert band['low'] < band['median'] < band['high']
        speeds = [speed['speed_m_s'] for speed in each['speeds']]
        assert {1.0, 2.0} <= set(speeds)
        assert speeds == sorted(speeds, reverse=True)


def test_what_followed_stands_beside_it(found: dict[str, Any]) -> None:
    last = found['forecasts'][-1]
    shown = [speed['time_s'] for speed in last['speeds'] if speed['time_s']['was'] is not None]
    assert shown
    assert last['speeds'][-1]['speed_m_s'] == 1.0
    assert last['speeds'][-1]['time_s']['was'] is None  # the record ends before
    assert last['inside'] == 1.0
    assert all(band['was'] == pytest.approx(band['median'], rel=0.3) for band in shown)


def test_a_forecast_that_is_not_made_says_why(found: dict[str, Any]) -> None:
    (none,) = found['not_made']
    assert none['after_s'] == 5000.0
    assert 'the glide ends' in none['reason']


def test_a_script_gets_the_same(found: dict[str, Any], coastdown_bag: Path) -> None:
    made = sd.estimate(sd.read(coastdown_bag)).forecast(after=(300.0, 600.0, 5000.0))
    assert json.loads(json.dumps(made.to_dict())) == found
    assert repr(made) == '<Forecasts: 2 forecasts of 1 glide>'
    assert '100% of what followed lies inside the bands' in made.summary()
    axis = made.plot()
    assert axis.get_ylabel() == 'speed [knots]'
    assert len(axis.lines) == 3
    frame = made.to_frame()
    assert (frame['time_low_s'] < frame['time_high_s']).all()
    assert [row[:2] for row in made.table().rows] == [
        (after, f'{each}.0 knots')
        for after, top in (('5:00', 9), ('10:00', 6))
        for each in range(top, 1, -1)
    ]


def test_no_glide_is_said(steady_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['forecast', str(steady_bag), '--json']) == 0
    told = capsys.readouterr()
    assert f'{steady_bag}\nNo coastdown found' in told.err
    (none,) = json.loads(told.out)['not_made']
    assert (none['bag'], none['stop_ns']) == (str(steady_bag), None)
    assert 'No coastdown found' in none['reason']


def test_what_holds_for_a_run_is_said(steady_bag: Path, tmp_path: Path, capsys) -> None:
    bag = shutil.copy(steady_bag, tmp_path / 'own.mcap')
    (tmp_path / 'run.yaml').write_text('facts: [calm]\n')
    assert main(['forecast', str(bag), '--json']) == 0
    assert f'{bag}: {tmp_path / "run.yaml"} holds for this run' in capsys.readouterr().err


def test_a_bag_without_a_glide_is_said_beside_one_with_a_glide(steady_bag, coastdown_bag, capsys):
    assert main(['forecast', str(coastdown_bag), str(steady_bag), '--after', '1e305']) == 0
    told = capsys.readouterr().out
    assert 'the glide ends' in told
    assert 'No coastdown found' in told


def test_a_time_that_is_none(coastdown_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(['forecast', str(coastdown_bag), '--after', '0'])
    assert 'above 0' in capsys.readouterr().err
    result = sd.estimate(sd.read(coastdown_bag), window=(300.0, 1800.0))
    with pytest.raises(sd.ShipdragError, match='give times above 0'):
        result.forecast(after=())
    with pytest.raises(sd.ShipdragError, match='give times above 0'):
        result.forecast(after='soon')  # type: ignore[arg-type]
    assert len(result.forecast(after=300.0).made) == 1


def test_a_bag_behind_the_times_is_told_where_to_stand(coastdown_bag: Path, capsys) -> None:
    with pytest.raises(SystemExit):
        main(['forecast', '--after', '300', str(coastdown_bag)])
    assert 'as in --after 60 300 -- BAG' in capsys.readouterr().err
    assert main(['forecast', '--after', '300', '--', str(coastdown_bag)]) == 0
    assert '5:00 after the stop' in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(['forecast', '--help'])
    assert '(default: 60 120 300)' in ' '.join(capsys.readouterr().out.split())


def test_if_she_were_stopped_now(ship_file, steady_bag, coastdown_bag, capsys):
    assert main(['forecast', str(steady_bag), '--if-stopped-now', '--json']) == 0
    told = capsys.readouterr()
    assert 'by the clean hull of the ship file' in told.err
    found = json.loads(told.out)['if_stopped_now']
    assert found['measured'] == 'through water'
    assert {2.0, 1.0} <= {each['speed_m_s'] for each in found['speeds']}
    same = sd.estimate(sd.read(steady_bag)).if_stopped_now()
    assert same.forecast.milestones[0].time_s.median == found['speeds'][0]['time_s']['median']
    assert list(same.to_frame()['time_median_s']) == [
        each['time_s']['median'] for each in found['speeds']
    ]

    assert main(['forecast', str(coastdown_bag), '--if-stopped-now']) == 0
    said = capsys.readouterr().out
    assert 'Gliding already at ' in said
    assert ', by the coastdown of ' in said

    assert main(['forecast', f'{coastdown_bag}@0:800', '--if-stopped-now', '--json']) == 0
    glides = json.loads(capsys.readouterr().out)['if_stopped_now']
    assert glides['gliding']
    sailed = Scenario(speed_m_s=8.0, lead_in_s=300.0, duration_s=500.0)
    truth = simulate(Ship.load(ship_file), sailed).speed_through_water_m_s[-1]
    assert glides['speed_m_s'] == pytest.approx(truth, abs=0.04)  # a mean would be 0.1 too fast

    assert main(['forecast', f'{coastdown_bag}@0:300', '--if-stopped-now', '--json']) == 0
    told = capsys.readouterr()
    assert 'If the engine were stopped at ' in told.err  # of the glide after it nothing is known
    rows = [line.split('  ')[0] for line in told.err.splitlines() if ' knots  ' in line]
    assert rows == [f'{each}.0 knots' for each in range(14, 0, -2)]
    assert json.loads(told.out)['if_stopped_now']['hull'] == 'the clean hull of the ship file'

    assert main(['forecast', f'{coastdown_bag}@90000:90010', '--if-stopped-now']) == 1
    assert 'nothing is recorded from 90000 to 90010 s' in capsys.readouterr().err
