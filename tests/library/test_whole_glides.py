# SPDX-License-Identifier: Apache-2.0
"""A glide in which something but the water acts is not called free of what is missing."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.coastdown.events import ENDED_BY, TURNED, Dismissal, EndedBy, EndedCoastdown
from shipdrag_ros.diagnosis import diagnose
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.fleet import job
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.job import BagJob, work
from shipdrag_ros.fleet.store import BagResult
from shipdrag_ros.library import diagnosing
from shipdrag_ros.replay import replay
from shipdrag_ros.replay.coasts import dismissed_glides, whole_window
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS
from tests.runs import write_run

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
SHIP = Ship.load(SHIP_FILE)
FIRST_M_S = 8.0
LEAD_IN_S, COAST_S = 900, 1500
Force = Callable[[float], float]


def nothing(_: float) -> float:
    return 0.0


def belt_of_ice(time_s: float) -> float:
    """Hold her back for a while."""
    return -0.5 if 300.0 < time_s < 700.0 else 0.0


def ice_at_the_stop(time_s: float) -> float:
    """Hold her back from the stop on, and let go."""
    return -1.5 if 0.0 < time_s < 110.0 else 0.0


def tug(time_s: float) -> float:
    """Hold her back from the stop until she lies still."""
    return -1.5 if 0.0 < time_s < 180.0 else 0.0


def half_power(time_s: float) -> float:
    """Go on at half the thrust."""
    return 0.5


def sailed(path: Path, force: Force) -> Path:
    """Write a bag of a ship under a force besides, in parts of the resistance at the stop."""
    rng = np.random.default_rng(4)
    first_n = float(SHIP.resistance_n(np.array([FIRST_M_S]))[0])
    time = np.arange(-LEAD_IN_S, COAST_S)
    speed = np.full(len(time), FIRST_M_S)
    for i in range(LEAD_IN_S, len(time) - 1):
        v = speed[i : i + 1]
        thrust = np.exp(-time[i] / 8.0) + force(float(time[i]))
        inertia = SHIP.mass_kg * (1.0 + float(SHIP.n_r(v[0])))
        speed[i + 1] = v[0] + (thrust * first_n - float(SHIP.resistance_n(v)[0])) / inertia
    stamps = START_NS + (time + LEAD_IN_S) * 10**9
    way = np.cumsum(speed)
    fixes = np.column_stack([way, np.zeros(len(way))]) + rng.normal(0.0, 3.0, (len(way), 2))

    def block(channel: Channel, value: np.ndarray) -> Block:
        return Block.of(channel, stamps, value, receive_ns=stamps + 10**7)

    log = block(Channel.SPEED_THROUGH_WATER, speed + rng.normal(0.0, 0.03, len(speed)))
    return write_run(path, in_arrival_order([log, block(Channel.POSITION, fixes)]), SHIP)


def diagnosed(path: Path, force: Force, window: str = '') -> dict[str, Any]:
    bag, answer = sailed(path / 'run.mcap', force), path / 'answer.json'
    assert main(['diagnose', f'{bag}{window}', '--json', str(answer)]) == 0
    found: dict[str, Any] = json.loads(answer.read_text(encoding='utf-8'))
    return found


def test_a_brake_from_the_stop_on_leaves_no_lead_and_is_diagnosed(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, ice_at_the_stop, f'@{LEAD_IN_S}:{LEAD_IN_S + COAST_S}')
    assert found['verdict'] == 'unknown'
    assert found['coastdowns_used'] == 1


def test_a_glide_that_was_dismissed_is_something(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, tug)
    likely = [one['names'] for one in found['candidates'] if one['probability'] > 0.05]
    assert ['unknown'] in likely
    assert ['none'] not in likely
    assert found['coastdowns_used'] == 0
    assert found['no_coastdown']
    assert 'lost speed without thrust' in ' '.join(found['notes'])


def test_a_bag_without_a_coastdown_is_told_of_beside_a_glide_with_more_in_it(tmp_path) -> None:
    bags = [sailed(tmp_path / f'{force.__name__}.mcap', force) for force in (belt_of_ice, tug)]
    answer = tmp_path / 'answer.json'
    assert main(['diagnose', *map(str, bags), '--json', str(answer)]) == 0
    notes = ' '.join(json.loads(answer.read_text(encoding='utf-8'))['notes'])
    assert 'all of each glide is compared with the model' in notes
    assert f"no coastdown was found in '{bags[1]}'" in notes


def test_without_a_baseline_no_glide_is_held_against_one(tmp_path, capsys) -> None:
    bag, ship = sailed(tmp_path / 'run.mcap', tug), tmp_path / 'bare.yaml'
    ship.write_text('name: bare\nlength_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    assert main(['diagnose', str(bag), '--ship', str(ship)]) == 0
    said = capsys.readouterr().out
    assert said.startswith('No coastdown was found')
    assert 'glide' not in said


@pytest.mark.parametrize('force', [nothing, half_power])
def test_a_sound_coastdown_and_less_power_hide_no_glide(tmp_path: Path, force: Force) -> None:
    (run,) = open_runs([sailed(tmp_path / 'run.mcap', force)])
    result = replay(run, compare=False)
    assert len(result.coastdowns) == (force is nothing)
    assert dismissed_glides(result) == []
    assert [whole_window(result, each) for each in result.coastdowns] == [None] * (
        force is nothing
    )


def test_the_whole_glide_goes_on_where_the_coastdown_ends(tmp_path: Path) -> None:
    (run,) = open_runs([sailed(tmp_path / 'run.mcap', belt_of_ice)])
    result = replay(run, compare=False)
    (coastdown,) = result.coastdowns
    assert coastdown.ended_by is EndedBy.BRAKE
    glide = whole_window(result, coastdown)
    assert glide is not None
    assert glide.before is not None
    assert glide.start_ns == pytest.approx(coastdown.stop_ns, abs=10**9)
    assert glide.end_ns > coastdown.end_ns + 200 * 10**9


def test_what_acted_at_the_stop_is_cut_from_the_coastdown_and_said(tmp_path: Path) -> None:
    (run,) = open_runs([sailed(tmp_path / 'ice.mcap', ice_at_the_stop)])
    (coastdown,) = (each for each in replay(run, compare=False).coastdowns if not each.withdrawn)
    (cut,) = coastdown.cuts
    assert cut.reason is Dismissal.BRAKE
    assert coastdown.start_ns >= cut.end_ns
    found = diagnosed(tmp_path, ice_at_the_stop)
    assert 'brake: something but the water slowed her' in ' '.join(found['notes'])


def crash_stop(time_s: float) -> float:
    """Brake her until she goes astern."""
    return -4.0 if 300.0 < time_s < 400.0 else 0.0


def test_what_she_does_after_she_was_slow_hides_no_glide(tmp_path: Path) -> None:
    (run,) = open_runs([sailed(tmp_path / 'run.mcap', crash_stop)])
    result = replay(run, compare=False)
    (coastdown,) = result.coastdowns
    glide = whole_window(result, coastdown)
    assert glide is not None
    assert glide.end_ns > coastdown.end_ns


def in_a_fleet(path: Path, force: Force) -> BagResult:
    (source,) = find([str(sailed(path / 'run.mcap', force))]).sources
    return work(BagJob((source,), 'hash'))


def test_the_fleet_sees_the_whole_glide_as_the_verb_does(tmp_path: Path) -> None:
    result = in_a_fleet(tmp_path, crash_stop)
    (row,) = result.coastdowns
    assert row['verdict'] != 'none'  # nothing is missing in the coastdown alone
    said = ' '.join(result.bag['warnings'])
    assert 'no instrument shows what' in said
    assert 'all of each glide is compared with the model' in said


def test_the_fleet_says_of_a_glide_that_gives_no_row_what_it_shows(tmp_path, monkeypatch) -> None:
    def refuse(*args: Any, **options: Any) -> Any:
        raise ShipdragError('asked for nan')

    monkeypatch.setattr(job, 'diagnose', refuse)
    result = in_a_fleet(tmp_path, tug)
    assert all('withdrawn' in row['flags'] for row in result.coastdowns)
    (said,) = (each for each in result.bag['warnings'] if 'lost speed without thrust' in each)
    assert 'All of it compared with the model: it could not be: asked for nan' in said


def test_an_earlier_diagnosis_of_another_ship_is_refused_in_its_own_words(tmp_path, capsys):
    bag, earlier = sailed(tmp_path / 'run.mcap', tug), tmp_path / 'earlier.json'
    document = {
        'ship': {'name': 'Another', 'length_m': 90.0, 'effects': []},
        'runs': [{'bag': 'may.mcap', 'time_ns': START_NS - 10**15}],
        'earlier': [],
        'candidates': [{'names': ['none'], 'probability': 1.0, 'effects': []}],
        'baseline': 'stated',
    }
    earlier.write_text(json.dumps(document))
    assert main(['diagnose', str(bag), '--earlier', str(earlier)]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert "it is of the ship 'Another' of 90 m" in said
    assert 'glide' not in said


def test_a_glide_that_cannot_be_followed_does_not_let_nothing_be_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def once(*args: Any, **options: Any) -> Any:
        asked.append(args)
        if len(asked) == 1:  # all of the glide
            raise ShipdragError('asked for nan')
        return diagnose(*args, **options)

    monkeypatch.setattr(diagnosing, 'diagnose', once)
    assert main(['diagnose', str(sailed(tmp_path / 'run.mcap', crash_stop))]) == 1
    said = capsys.readouterr()
    assert 'nothing is missing' not in said.out
    assert 'it is not known whether anything is missing' in said.err


def test_why_a_coastdown_ended_is_noted() -> None:
    turned = EndedCoastdown(0, 1, None, EndedBy.TURN, None)
    (said,) = diagnosing._ends('a.mcap', [(turned, None)])
    assert said == f'a.mcap: the coastdown ends where {ENDED_BY[EndedBy.TURN]}; {TURNED}'
    whole = replace(turned, ended_by=EndedBy.RECORD_END)
    assert list(diagnosing._ends('a.mcap', [(whole, None)])) == []
