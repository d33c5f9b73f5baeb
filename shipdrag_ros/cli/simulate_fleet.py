# SPDX-License-Identifier: Apache-2.0
"""
Simulate months of a few ships whose hulls foul, by a law and by surprise, and are cleaned,
with or without a note of it; every run in another load, water, weather and with a log that
drifts. Writes a folder a ship with ship.yaml, events.csv and the bags, each with its
BAG.run.yaml, and beside them truth.yaml and truth.csv, which `fleet` does not read. A few
files are lost, cut off, unreadable, or from a clock without a date.

Options
-------
--out DIR
    folder; must be empty or new
--ships N
    how many ships
--months M
    how long [30 days]
--every DAYS
    between two runs of a ship [days]; 7 for weekly runs
--seed S
    the same seed gives the same files
--sound
    no file is lost, damaged or dated wrongly

Examples
--------
shipdrag simulate-fleet -o fleet --ships 1 --months 1 --seed 4
shipdrag simulate-fleet -o weekly --ships 1 --months 0.5 --every 7 --sound
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from dataclasses import asdict, replace
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli.arguments import add, number, whole
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.simulation import voyages

TRUTH = 'truth'
_PATTERN = 'vitus_bering.yaml'
_REFERENCE = 0.65  # of the highest speed of the baseline, where the truth is stated
_PRICES = Economics(
    fuel_usd_per_t=600.0,
    sfoc_g_per_kwh=180.0,
    propulsive_efficiency=0.65,
    days_at_sea_per_year=240.0,
    cleaning_usd=40_000.0,
)
_CUT = 0.6  # of a file that is cut off


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    months = number(0.0, 600.0, unit='months', above=True)
    parser.add_argument('-o', '--out', required=True, type=Path)
    parser.add_argument('--ships', type=whole(1, 1000), default=3)
    parser.add_argument('--months', type=months, default=12.0)
    parser.add_argument('--every', type=number(0.1, 1000.0, unit='days'), default=28.0)
    parser.add_argument('--seed', type=whole(0), default=0)
    parser.add_argument('--sound', action='store_true')
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Simulate the fleet and say what was written.
    """
    output = Output(options.json)
    out: Path = options.out
    out.mkdir(parents=True, exist_ok=True)
    if any(out.iterdir()):
        raise SimulationError(f'{str(out)!r} is not empty; give a new folder')
    text = files('shipdrag_ros').joinpath('data', _PATTERN).read_text(encoding='utf-8')
    plan = voyages.plan_fleet(
        replace(Ship.from_yaml(text, subject=_PATTERN), economics=_PRICES),
        ships=options.ships,
        months=options.months,
        every_days=options.every,
        seed=options.seed,
        sound=options.sound,
    )
    rows: list[dict[str, Any]] = []
    total = sum(len(ship.runs) for ship in plan)
    with output.progress(f'simulating {total} runs') as progress:
        for ship in plan:
            folder = out / ship.ship.name.lower().replace(' ', '_')
            _write_ship(folder, ship)
            for each in ship.runs:
                rows.append(_truth_row(folder.name, ship, each))
                _write_run(folder, each, recording=f'{options.seed}-{len(rows)}')
                progress(len(rows), total)
    _write_truth(out, plan, rows, seed=options.seed)
    fates = Counter(each.fate.value for ship in plan for each in ship.runs)
    output.say(
        f'{out}: {len(plan)} ship(s), {total} runs over {options.months:g} months; '
        + ', '.join(f'{many} {fate.replace("_", " ")}' for fate, many in fates.items())
    )
    output.say(f'What is true stands in {out / TRUTH}.yaml and {TRUTH}.csv.')
    output.json({'folder': str(out), 'ships': len(plan), 'runs': total, 'files': fates})
    return 0


def _write_ship(folder: Path, planned: voyages.PlannedShip) -> None:
    folder.mkdir()
    (folder / 'ship.yaml').write_text(planned.ship.to_yaml(), encoding='utf-8')
    known = [change for change in planned.history.changes if change.known]
    lines = ['date,kind,note', *(f'{_date(change)},{change.kind},' for change in known)]
    (folder / 'events.csv').write_text('\n'.join(lines) + '\n', encoding='utf-8')


def _write_run(folder: Path, planned: voyages.PlannedRun, *, recording: str) -> None:
    if planned.fate is voyages.Fate.LOST:
        return
    path = folder / _file(planned)
    with BagWriter(path, recording_id=recording) as bag:
        bag.write_samples(planned.samples())
    if planned.fate is voyages.Fate.CUT:
        content = path.read_bytes()
        path.write_bytes(content[: int(_CUT * len(content))])
    elif planned.fate is voyages.Fate.UNREADABLE:
        path.write_bytes(bytes(len(path.read_bytes())))
    about = {
        'draught_m': planned.ship.draught_m,
        'displaced_volume_m3': planned.ship.displaced_volume_m3,
        'water': {
            'temperature_c': planned.temperature_c,
            'density_kg_m3': planned.ship.water.density_kg_m3,
        },
    }
    path.with_name(f'{path.name}.run.yaml').write_text(strict_yaml.dump(about), encoding='utf-8')


def _truth_row(
    folder: str, planned: voyages.PlannedShip, each: voyages.PlannedRun
) -> dict[str, Any]:
    speed_m_s = _REFERENCE * planned.ship.baseline_range_m_s[1]
    clean = float(each.ship.resistance_n(speed_m_s))
    scattered = float(each.fouled().resistance_n(speed_m_s))
    alone = float(replace(each, scatter=1.0).fouled().resistance_n(speed_m_s))
    return {
        'ship': planned.ship.name,
        'bag': f'{folder}/{_file(each)}',
        'time_ns': each.start_ns,
        'stamped_ns': each.stamped_ns,
        'file': each.fate.value,
        'added_friction': round(each.added_friction, 6),
        'added_resistance': round(alone / clean - 1.0, 6),
        'added_with_scatter': round(scattered / clean - 1.0, 6),
        'speed_m_s': round(speed_m_s, 4),
        'draught_m': each.ship.draught_m,
        'displaced_volume_m3': each.ship.displaced_volume_m3,
        'water_temperature_c': each.temperature_c,
        'log_factor': round(each.log_factor, 6),
        'heading_rad': round(each.scenario.heading_rad, 6),
        'current_east_m_s': round(each.scenario.current_m_s[0], 4),
        'current_north_m_s': round(each.scenario.current_m_s[1], 4),
    }


def _write_truth(
    out: Path, plan: tuple[voyages.PlannedShip, ...], rows: list[dict[str, Any]], *, seed: int
) -> None:
    ships = [
        {
            'name': each.ship.name,
            'friction_at_start': each.history.at_start,
            'growth_per_year': each.history.growth_per_year,
            'changes': [
                {
                    'time_ns': voyages.FLEET_START_NS + round(change.day * voyages.DAY_NS),
                    **{key: value for key, value in asdict(change).items() if key != 'day'},
                }
                for change in each.history.changes
            ],
        }
        for each in plan
    ]
    about = {'seed': seed, 'scatter': voyages.SCATTER, 'ships': ships}
    (out / f'{TRUTH}.yaml').write_text(strict_yaml.dump(about), encoding='utf-8')
    with (out / f'{TRUTH}.csv').open('w', encoding='utf-8', newline='') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _file(planned: voyages.PlannedRun) -> str:
    return f'{datetime.fromtimestamp(planned.start_ns // SECOND_NS, UTC):%Y-%m-%d-%H%M}.mcap'


def _date(change: voyages.HullChange) -> str:
    second = voyages.FLEET_START_NS // SECOND_NS + round(change.day * 86_400)
    return f'{datetime.fromtimestamp(second, UTC):%Y-%m-%d}'
