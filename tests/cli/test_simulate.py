# SPDX-License-Identifier: Apache-2.0
"""A simulated bag holds what was asked for, and its truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.run_result import TrueCurve
from shipdrag_ros.samples import Block, Channel, concatenate
from shipdrag_ros.ship import Ship

SHORT = ('--duration', '60', '--lead-in', '20')


@dataclass(frozen=True)
class Bag:
    block: Block
    attachments: dict[str, str]

    @property
    def settings(self) -> dict[str, object]:
        return dict(self.truth.settings)

    @property
    def truth(self) -> TrueCurve:
        return TrueCurve.from_yaml(self.attachments['truth.yaml'], subject='bag')

    def of(self, channel: Channel) -> Block:
        return self.block[self.block.channel == channel]


def read(path: Path) -> Bag:
    (run,) = open_runs([path])
    blocks = [item for item in run.inputs() if isinstance(item, Block)]
    return Bag(concatenate(blocks), run.attachments)


@pytest.fixture
def simulate(ship_file: Path, tmp_path: Path):
    def run(*arguments: str) -> Bag:
        path = tmp_path / f'{len(list(tmp_path.iterdir()))}.mcap'
        line = ['simulate', '--ship', str(ship_file), '-o', str(path), *SHORT, *arguments]
        assert main(line) == 0
        return read(path)

    return run


def test_the_bag_brings_ship_parameters_and_truth(simulate, ship_file: Path) -> None:
    bag = simulate()
    assert Ship.from_yaml(bag.attachments['ship.yaml'], subject='bag') == Ship.load(ship_file)
    assert Parameters.from_yaml(bag.attachments['parameters.yaml'], subject='') == Parameters()
    ship = Ship.load(ship_file)
    r = bag.truth.resistance_m_s2 * ship.mass_kg
    np.testing.assert_allclose(r, ship.resistance_n(bag.truth.speed_m_s), rtol=1e-12)


def test_lengths_rate_and_a_heading_that_turns_from_east_to_north(simulate) -> None:
    bag = simulate('--rate', '4', '--heading', str(np.pi / 2), '--noise', '0')
    span_s = (bag.block.stamp_ns.max() - bag.block.stamp_ns.min()) * 1e-9
    assert span_s == 80.0
    assert len(bag.of(Channel.SPEED_THROUGH_WATER)) == 321
    assert (bag.settings['duration_s'], bag.settings['lead_in_s']) == (60.0, 20.0)
    np.testing.assert_allclose(bag.of(Channel.HEADING).value[:, 0], np.pi / 2, rtol=1e-9)
    east, north = bag.of(Channel.POSITION).value[-1]
    assert north > 100.0
    assert abs(east) < 1e-6 * north


def test_the_speed_is_kept_until_the_stop(simulate) -> None:
    bag = simulate('--speed', '6.5', '--noise', '0')
    speed = bag.of(Channel.SPEED_THROUGH_WATER).value[:, 0]
    np.testing.assert_allclose(speed[:20], 6.5, rtol=1e-6)
    assert np.all(np.diff(speed[25:]) < 0)
    np.testing.assert_allclose(bag.truth.speed_m_s[-1], 1.05 * 6.5, rtol=1e-12)
    shaft = bag.of(Channel.SHAFT).value[:, 0]
    assert shaft[60] < 0.1 * shaft[0]


def test_without_a_speed_the_baseline_gives_one(simulate, ship_file: Path) -> None:
    ship = Ship.load(ship_file)
    top = float(ship.speed(ship.baseline.wave_froude[-1]))
    np.testing.assert_allclose(simulate().settings['speed_m_s'], 0.8 * top, rtol=1e-3)


def test_noise_is_scaled(simulate) -> None:
    # 20 s of steady log readings; the sd of the sd of 20 is 16 %, the factor is 10
    spread = [
        np.std(simulate('--noise', factor).of(Channel.SPEED_THROUGH_WATER).value[:20, 0])
        for factor in ('1', '10')
    ]
    assert 0.02 < spread[0] < 0.1
    assert 4.0 < spread[1] / spread[0] < 25.0


def test_the_seed_repeats_the_noise_and_another_does_not(simulate) -> None:
    first, same, other = (simulate('--seed', seed).block.value for seed in ('7', '7', '8'))
    np.testing.assert_array_equal(first, same)
    assert np.any(first != other)


def test_effects_act_and_the_truth_says_which_but_the_ship_does_not(simulate, ship_file):
    quiet = ('--noise', '0')
    clean = simulate(*quiet)
    bag = simulate(*quiet, '--effect', 'fouling=0.5', '--effect', 'log_scale=0.1')
    assert bag.settings['effects'] == [
        {'name': 'fouling', 'scope': 'hull', 'parameters': {'friction_factor': 0.5}},
        {'name': 'log_scale', 'scope': 'sensor', 'parameters': {'factor': 0.1}},
    ]
    assert 'not wind, waves, current' in str(bag.settings['resistance'])
    assert Ship.from_yaml(bag.attachments['ship.yaml'], subject='bag') == Ship.load(ship_file)
    assert np.all(bag.truth.resistance_m_s2[1:] > 1.2 * clean.truth.resistance_m_s2[1:])
    log, true = (one.of(Channel.SPEED_THROUGH_WATER).value[:, 0] for one in (bag, clean))
    np.testing.assert_allclose(log[:20], 1.1 * true[:20], rtol=1e-6)
    assert bag.of(Channel.POSITION).value[-1, 0] < clean.of(Channel.POSITION).value[-1, 0] - 1.0


def test_an_effect_of_the_ship_file_is_in_ship_and_truth(ship_file: Path, tmp_path: Path) -> None:
    stated = 'effects: [{name: current, parameters: {along_track_m_s: {value: 1.0, sd: 0.1}}}]'
    path = tmp_path / 'ship.yaml'
    path.write_text(ship_file.read_text().replace('effects: []', stated))
    line = ['simulate', '--ship', str(path), '-o', str(tmp_path / 'a.mcap'), *SHORT]
    assert main([*line, '--speed', '6', '--noise', '0']) == 0
    bag = read(tmp_path / 'a.mcap')
    assert [effect['name'] for effect in bag.settings['effects']] == ['current']
    assert Ship.from_yaml(bag.attachments['ship.yaml'], subject='').effects[0].name == 'current'
    np.testing.assert_allclose(bag.of(Channel.POSITION).value[20, 0], 7.0 * 20.0, rtol=1e-6)


def test_another_run_of_the_day_has_the_same_current(simulate) -> None:
    line = ('--noise', '0', '--speed', '6', '--effect', 'current=1', '--heading', str(np.pi))
    own, of_first = simulate(*line), simulate(*line, '--first-heading', '0')
    np.testing.assert_allclose(own.of(Channel.POSITION).value[20, 0], -7.0 * 20.0, rtol=1e-6)
    np.testing.assert_allclose(of_first.of(Channel.POSITION).value[20, 0], -5.0 * 20.0, rtol=1e-6)
    assert (own.settings['first_heading_rad'], of_first.settings['first_heading_rad']) == (
        pytest.approx(np.pi),
        0.0,
    )


def test_inputs_say_which_sensors_see_it(simulate) -> None:
    bag = simulate(
        '--noise', '0', '--inputs', 'wind_apparent,depth', '--effect', 'wind=4', '--speed', '6'
    )
    assert set(bag.block.channel.tolist()) == {Channel.WIND_APPARENT, Channel.DEPTH}
    np.testing.assert_allclose(bag.of(Channel.WIND_APPARENT).value[:20, 0], -10.0, rtol=1e-6)


def test_the_json_says_what_was_made(ship_file: Path, tmp_path, capsys) -> None:
    path = tmp_path / 'a.mcap'
    assert main(['simulate', '--ship', str(ship_file), '-o', str(path), *SHORT, '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['bag'] == str(path)
    assert said['messages'] == {
        'speed_through_water': 81,
        'position': 81,
        'heading': 81,
        'shaft': 81,
    }
    assert said['end_ns'] - said['start_ns'] == 80_000_000_000


@pytest.mark.parametrize(
    ('effect', 'said'),
    [
        ('barnacles=1', "ERROR: effect 'barnacles' is not known; known are added_"),
        ('current=1,up=2', "ERROR: effect 'current=1,up=2': parameter 'up' is not"),
    ],
)
def test_a_user_error_is_told_and_leaves_no_bag(ship_file, tmp_path, capsys, effect, said):
    path = tmp_path / 'a.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), *SHORT]
    assert main([*line, '--effect', effect]) == 1
    assert capsys.readouterr().err.startswith(said)
    assert not path.exists()


@pytest.mark.parametrize(
    ('given', 'first'),
    [
        ('2025-03-01', '2025-03-01T00:00:00+00:00'),
        ('2025-03-01T06:30:00+01:00', '2025-03-01T05:30:00+00:00'),
        ('2025-03-01T06:30:00.25Z', '2025-03-01T06:30:00.250000+00:00'),
    ],
)
def test_the_stamps_begin_at_the_date_given(simulate, given: str, first: str) -> None:
    bag = simulate('--start', given, '--noise', '0')
    moment_ns = round(datetime.fromisoformat(first).timestamp() * 1000) * 1_000_000
    assert bag.block.stamp_ns[0] == moment_ns
    assert bag.settings['start_ns'] == moment_ns
    # the same motion, at another time
    np.testing.assert_array_equal(bag.block.value, simulate('--noise', '0').block.value)


DATES = ('yesterday', '2026-13-01', '1970-01-01', '2100-01-01')


@pytest.mark.parametrize(
    ('option', 'value', 'said'),
    [
        ('--seed', '-1', '-1'),
        ('--inputs', 'sonar', 'sonar'),
        *((name, value, value) for name, value in (('--rate', '0'), ('--noise', '-1'))),
        *((name, value, value) for name, value in (('--heading', 'inf'), ('--speed', '0'))),
        *(('--start', date, f'{date!r}, expected a date of ISO 8601') for date in DATES),
    ],
)
def test_an_impossible_value_is_wrong_usage(ship_file, tmp_path, option, value, said, capsys):
    line = ['simulate', '--ship', str(ship_file), '-o', str(tmp_path / 'a.mcap')]
    with pytest.raises(SystemExit) as ended:
        main([*line, option, value])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]
