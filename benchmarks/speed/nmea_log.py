# SPDX-License-Identifier: Apache-2.0
"""
What an NMEA 0183 log of a sailing yacht costs in information.

`SHIPDRAG_DATA=FOLDER python -m benchmarks.speed.nmea_log` imports the log, prints the
figures of its section in docs/real_records.md, and how the cost of an import
grows with the length of the log. No chance is in it; a minute.
"""

from __future__ import annotations

import gzip
import os
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from shipdrag_ros.bags import open_runs
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel, concatenate
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.formats.nmea import NmeaResult, read_nmea
from shipdrag_ros.sources.log import Log, new_bag

LOG = 'psaros_lake_geneva.nmea.gz'
KNOT = 1852.0 / 3600.0
SMOOTH_S = 9  # a running median over this many samples is taken for the truth
REPEATS = (1, 2, 4)


def main() -> None:
    """
    Print the figures.
    """
    if 'SHIPDRAG_DATA' not in os.environ:
        raise SystemExit('SHIPDRAG_DATA names no folder of records')
    source = Path(os.environ['SHIPDRAG_DATA'], LOG)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder, 'log.mcap')
        result = write(source, bag)
        show_counts(result)
        (run,) = open_runs([bag])
        block = concatenate([item for item in run.inputs() if isinstance(item, Block)])
        show_speeds(block)
        show_replay(bag)
        show_cost(source, Path(folder))


def write(source: Path, out: Path) -> NmeaResult:
    """
    Make a bag of a log.
    """
    log = Log()
    result = read_nmea(Job(source), log)
    with new_bag(out, {}) as bag:
        log.copy_to(bag)
    return result


def show_counts(result: NmeaResult) -> None:
    """
    Print what came of the sentences.
    """
    total = result.sentences
    used = sum(result.written.values())
    print(f'{total} sentences in {result.lines} lines, {used} messages')
    for name, reasons in result.rejected.items():
        for reason, rejected in reasons.items():
            print(f'  {name}: {reason}: {rejected.count}')
    print(f'  not taken: {result.not_taken}; not used: {result.not_used}')
    speed = result.rejected['speed_through_water']
    empty = sum(each.count for each in speed.values())
    print(f'  empty speeds of the log: {empty} of {empty + result.written["speed_through_water"]}')
    print(f'  stamps that repeat: {result.repeated} of {used}')


def show_speeds(block: Block) -> None:
    """
    Print the step of each speed beside its noise.
    """
    for channel in (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND):
        speed = block.value[block.channel == channel, 0] / KNOT
        steps = np.unique(np.round(np.abs(np.diff(speed)), 6))
        step = steps[steps > 0].min()
        moving = speed > 2.0
        noise = speed - median_filter(speed, SMOOTH_S, mode='nearest')
        spread = np.sqrt(np.mean(noise[moving] ** 2))
        print(
            f'{channel.input}: step {step:.3f} kn = {step * KNOT:.4f} m/s, '
            f'its own noise {step * KNOT / np.sqrt(12):.4f} m/s; '
            f'scatter about a median of {SMOOTH_S}: {spread * KNOT:.3f} m/s '
            f'({spread / step:.1f} steps); '
            f'same as the one before: {np.mean(np.diff(speed)[moving[1:]] == 0):.0%}; '
            f'zero: {np.mean(speed == 0):.1%}'
        )
        step_noise = (step / spread) ** 2 / 12.0
        frozen = step * KNOT / Parameters().frozen_s
        print(
            f'  share of the step in the variance: {step_noise:.1%}; without other noise frozen '
            f'for {Parameters().frozen_s:.0f} s below {frozen * 1000:.2f} mm/s^2'
        )
    water = block[block.channel == Channel.SPEED_THROUGH_WATER]
    ground = block[block.channel == Channel.SPEED_OVER_GROUND]
    at = np.interp(water.stamp_ns, ground.stamp_ns, ground.value[:, 0])
    both = (water.value[:, 0] > 2.0) & (at > 2.0)
    print(f'  log / over ground above 2 m/s: {water.value[both, 0].sum() / at[both].sum():.3f}')


def show_replay(bag: Path) -> None:
    """
    Print what a monitor makes of it; a yacht of stated length, mass assumed.
    """
    ship = Ship(
        length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.07, sd=0.03)
    )
    (run,) = open_runs([bag])
    replayed = replay(run, ship=ship, parameters=Parameters())
    print(f'replay: {len(replayed.coastdowns)} coastdown(s)')
    for name, counts in replayed.inputs.items():
        if counts.messages:
            print(f'  {name}: {counts.used} of {counts.messages} used, {dict(counts.rejected)}')


def show_cost(source: Path, folder: Path) -> None:
    """
    Print the cost of imports of the log once, twice and so on.
    """
    text = gzip.decompress(source.read_bytes())
    costs = []
    for times in REPEATS:
        path, bag = folder / f'{times}.nmea', folder / f'{times}.mcap'
        path.write_bytes(text * times)
        begin = time.process_time()
        write(path, bag)
        costs.append(time.process_time() - begin)
        lines = text.count(b'\n') * times
        print(f'import of {lines} lines: {costs[-1]:.1f} s of a core, {lines / costs[-1]:.0f}/s')
    slope = np.polyfit(np.log(REPEATS), np.log(costs), 1)[0]
    print(f'  slope of cost with length: {slope:.2f}')


if __name__ == '__main__':
    main()
