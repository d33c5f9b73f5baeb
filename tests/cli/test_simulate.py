# SPDX-License-Identifier: Apache-2.0
"""A simulated bag holds what was asked for, and its truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from shipdrag_ros.cli import main
from shipdrag_ros.messages import Source, decode
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.report.truth import TrueCurve
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
    with path.open('rb') as file:
        reader = make_reader(file)
        blocks = [
            decode(
                Source(channel.topic.strip('/'), schema.name), [message.data], [message.log_time]
            ).block
            for schema, channel, message in reader.iter_messages()
            if schema is not None
        ]
        attachments = {item.name: item.data.decode() for item in reader.iter_attachments()}
    return Bag(concatenate(blocks), attachments)


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


def test_lengths_and_rate(simulate) -> None:
    bag = simulate('--rate', '4')
    span_s = (bag.block.stamp_ns.max() - bag.block.stamp_ns.min()) * 1e-9
    assert span_s == 80.0
    assert len(bag.of(Channel.SPEED_THROUGH_WATER)) == 321
    assert (bag.settings['duration_s'], bag.settings['lead_in_s']) == (60.0, 20.0)


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


def test_the_heading_turns_from_east_to_north(simulate) -> None:
    bag = simulate('--heading', str(np.pi / 2), '--noise', '0')
    np.testing.assert_allclose(bag.of(Channel.HEADING).value[:, 0], np.pi / 2, rtol=1e-9)
    east, north = bag.of(Channel.POSITION).value[-1]
    assert north > 100.0
    assert abs(east) < 1e-6 * north


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


def test_the_json_says_what_was_made(
    ship_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
    ('arguments', 'said'),
    [
        (('--speed', '30'), 'ERROR: '),
        (('--ship', 'no such.yaml'), 'ERROR: no such.yaml: 1 problem(s)'),
        (('-o', '/no/such/folder/a.mcap'), "ERROR: '/no/such/folder/a.mcap' cannot be made"),
    ],
)
def test_a_user_error_is_told_and_leaves_no_bag(
    ship_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    said: str,
) -> None:
    path = tmp_path / 'a.mcap'
    assert main(['simulate', '--ship', str(ship_file), '-o', str(path), *SHORT, *arguments]) == 1
    assert capsys.readouterr().err.startswith(said)
    assert not path.exists()


def test_a_ship_without_baseline_cannot_be_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'ship.yaml').write_text('{length_m: 150, displaced_volume_m3: 20200}')
    line = ['simulate', '--ship', str(tmp_path / 'ship.yaml'), '-o', str(tmp_path / 'a.mcap')]
    assert main(line) == 1
    assert 'no baseline' in capsys.readouterr().err


def test_an_existing_bag_is_kept(
    ship_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'a.mcap'
    path.write_bytes(b'precious')
    assert main(['simulate', '--ship', str(ship_file), '-o', str(path), *SHORT]) == 1
    assert 'exists' in capsys.readouterr().err
    assert path.read_bytes() == b'precious'


@pytest.mark.parametrize(
    'arguments',
    [('--seed', '-1'), ('--rate', '0'), ('--noise', '-1'), ('--heading', 'inf'), ('--speed', '0')],
)
def test_an_impossible_value_is_wrong_usage(
    ship_file: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    line = ['simulate', '--ship', str(ship_file), '-o', str(tmp_path / 'a.mcap'), *arguments]
    with pytest.raises(SystemExit) as end:
        main(line)
    assert end.value.code == 2
