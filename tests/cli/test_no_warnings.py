# SPDX-License-Identifier: Apache-2.0
"""No verb shows a warning of Python or numpy, which is an error here, whatever it is given."""

from __future__ import annotations

import os
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import ESTIMATORS, Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from tests.runs import write_run

SHIP = """
name: Odd
length_m: 60.0
displaced_volume_m3: 400.0
added_mass: {model: constant, value: 0.1, sd: 0.02}
"""
DATA = 'SHIPDRAG_DATA'


def run(*line: str) -> None:
    """Run a verb, which may refuse its input."""
    assert main(line) in (0, 1)


def glide(time_s: Float64) -> Float64:
    """Steady at 4 m/s for as long as a diagnosis needs, then slower and slower."""
    after = np.maximum(time_s - STOP_S, 0.0)
    return 4.0 / (1.0 + after / 200.0)


def odd(speed: Float64, seed: int = 1) -> dict[str, Float64]:
    """Return a log and positions of a motion, with some noise."""
    rng = np.random.default_rng(seed)
    place = np.array([np.cumsum(speed), np.zeros(len(speed))]).T
    return {
        'speed_through_water': speed + rng.normal(0.0, 0.02, len(speed)),
        'position': place + rng.normal(0.0, 1.0, (len(speed), 2)),
        'heading': rng.normal(0.0, 0.01, len(speed)),
    }


STOP_S = 360.0
TIME = np.arange(600.0)
RECORDS: dict[str, dict[str, Float64]] = {
    'exact': {'speed_through_water': glide(TIME)},
    'positions': {'position': odd(glide(TIME))['position']},
    'at rest': {'speed_through_water': 0.0 * TIME, 'position': np.zeros((len(TIME), 2))},
    'even': {'speed_through_water': 0.0 * TIME + 3.0},
    'through zero': odd(glide(TIME) - 1.7),
    'faster': odd(0.5 + 0.005 * TIME),
    'steps': {'speed_through_water': np.round(glide(TIME), 0)},
    'few': {name: value[:7] for name, value in odd(glide(TIME)).items()},
    'one': {name: value[:1] for name, value in odd(glide(TIME)).items()},
    'far': {'position': np.column_stack([1e7 + TIME * 1e3, 0.0 * TIME])},
    'gaps and zeros': {
        'speed_through_water': np.where(
            TIME % 100 < 40, np.nan, np.where(TIME % 7 == 0, 0.0, glide(TIME))
        )
    },
    'infinite': {'speed_through_water': np.where(TIME % 3 == 0, np.inf, np.inf * (-1.0) ** TIME)},
}
NEXT = dict(zip(RECORDS, cycle(ESTIMATORS)))


@pytest.fixture
def ship(tmp_path: Path) -> Path:
    path = tmp_path / 'ship.yaml'
    path.write_text(SHIP)
    return path


def block_of(values: dict[str, Float64], part: slice = slice(None)) -> Block:
    stamps = (1e9 * TIME).astype(np.int64) + 10**18
    return in_arrival_order(
        [
            Block.of(Channel[key.upper()], stamps[: len(each)][part], each[part])
            for key, each in values.items()
        ]
    )


@pytest.mark.parametrize('name', RECORDS)
def test_odd_records(name: str, ship: Path, tmp_path: Path) -> None:
    bag = str(write_run(tmp_path / 'odd.mcap', block_of(RECORDS[name])))
    page = str(tmp_path / 'page.html')
    run('info', bag)
    run('check', bag)
    run('replay', bag, '--ship', str(ship), '--report', page)
    run('diagnose', bag, '--ship', str(ship), '--report', page)
    # to judge a window takes two seconds, however short it is: one is by a verb, and each
    # estimator takes the same without that
    run('diagnose', bag, '--ship', str(ship), '--window', '370', '490')
    block = block_of(RECORDS[name], slice(380, 431))
    part = str(write_run(tmp_path / 'part.mcap', block))
    parameters = tmp_path / 'parameters.yaml'
    more = ('--parameters', str(parameters), '--json', str(tmp_path / 'a.json'))
    parameters.write_text(f'estimator: {NEXT[name]}\nfroude_min: 0.001\n')
    run('replay', part, '--ship', str(ship), '--window', '0', '50', *more)
    if len(block):
        window = Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))
        for estimator in ESTIMATORS:
            with suppress(EstimationError):
                chosen = Parameters(estimator=estimator, froude_min=0.001)
                estimate_final(window, Ship.load(ship), chosen)


@pytest.mark.parametrize(
    ('table', 'columns', 'window'),
    [
        ('blueboat_221_10hz.csv', '--time t --map speed_through_water=surge', (30.5, 58)),
        ('car/Michelin60B.csv', '--rate 1 --map speed_over_ground=1:km/h', (0, 160)),
    ],
)
@pytest.mark.skipif(DATA not in os.environ, reason=f'needs the folder of records in {DATA}')
def test_measured_records(table, columns, window, ship, tmp_path):
    source, bag = str(Path(os.environ[DATA]) / table), str(tmp_path / 'run.mcap')
    run('import', source, '-o', bag, *columns.split(), '--ship', str(ship))
    page = str(tmp_path / 'page.html')
    for chosen in ((), ('--window', *map(str, window))):
        run('replay', bag, *chosen, '--report', page)
        run('diagnose', bag, *chosen, '--report', page)
