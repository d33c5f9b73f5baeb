# SPDX-License-Identifier: Apache-2.0
"""Simulated coastdowns: one, or months of a fleet."""

from __future__ import annotations

import argparse
import csv
import math
from collections import Counter
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli.arguments import add, checked, number, whole
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.library import simulated
from shipdrag_ros.samples import SECOND_NS, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.simulation import STANDARD_INPUTS, STANDARD_SD, START_NS, voyages
from shipdrag_ros.simulation.effects import LIBRARY, effects_of, find, parse, values_of


def _form(name: str) -> str:
    """Return how an effect is given."""
    first, *others = find(name).parameters
    unit = f' [{first.unit}]' if first.unit else ''
    return f'{name}={first.name}{unit}' + ''.join(f',{other.name}=' for other in others)


KNOWN = '; '.join(map(_form, LIBRARY))
SENSORS = ', '.join(channel.input for channel in STANDARD_SD)


def add_simulate(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    course = number(-2 * math.pi, 2 * math.pi, unit='rad')
    parser.add_argument('--ship', required=True, type=Path)
    parser.add_argument('-o', '--out', required=True, type=Path)
    parser.add_argument('--speed', type=number(0.0, 40.0, unit='m/s', above=True))
    length = partial(number, 0.0, simulated.LONGEST_S, unit='s')
    parser.add_argument('--duration', type=length(above=True), default=1500.0)
    parser.add_argument('--lead-in', type=length(), default=600.0)
    parser.add_argument('--heading', type=course, default=0.0)
    parser.add_argument('--effect', action='append', default=[])
    parser.add_argument('--first-heading', type=course)
    parser.add_argument('--start', type=checked(simulated.moment_ns))
    parser.add_argument('--inputs', type=_inputs, default=','.join(STANDARD_INPUTS))
    parser.add_argument('--rate', type=number(0.001, 1000.0, unit='Hz'), default=1.0)
    parser.add_argument('--noise', type=number(0.0, 1000.0), default=1.0)
    parser.add_argument('--seed', type=whole(0), default=0)
    add(parser, '--json')


def run_simulate(options: argparse.Namespace) -> int:
    """
    Sail steadily, stop the engine and let a simulated ship coast; write what log, position,
    heading and shaft sensors read, with the truth attached as truth.yaml.

    Options
    -------
    --ship FILE
        ship file with a baseline (YAML)
    --out BAG
        MCAP file to make; an existing one is not overwritten
    --speed M_S
        steady speed through water before the stop [m/s] (default:
        {simulated.SPEED_FRACTION:g} of the highest speed that the baseline is given for)
    --duration S
        record from the stop on [s]
    --lead-in S
        steady sailing before the stop [s]
    --heading RAD
        heading [rad], anticlockwise from east as in REP-103: 1.5708 is north
    --effect NAME=VALUE[,PARAM=VALUE]...
        add an effect that the ship file does not state; may be repeated. Known: {KNOWN}.
        docs/effects.md says what each does
    --first-heading RAD
        heading of the first run [rad], to which current, wind and waves are stated; give it to
        simulate another run of the same day (default: this run is the first)
    --start DATE
        date of the first stamp, ISO 8601, UTC unless it says otherwise: 2026-03-01 or
        2026-03-01T06:30:00+01:00 (default: 2026-06-01T08:00:00)
    --inputs INPUT[,INPUT]...
        sensors on board, of {SENSORS}
    --rate HZ
        readings of each sensor [Hz]
    --noise FACTOR
        factor [-] on the white noise of the sensors: 0.05 m/s of the log, 10 m of the position,
        0.5 deg of heading and rudder, 0.02 rad/s of the shaft, 0.1 m/s of the speed over ground,
        0.5 m/s of the wind, 0.2 m of the depth; 0: exact readings
    --seed N
        seed of the noise: the same seed gives the same readings

    Examples
    --------
    shipdrag simulate --ship ship.yaml -o calm.mcap --lead-in 1800
    shipdrag simulate --ship ship.yaml -o fouled.mcap --effect fouling=0.3 --effect \
current=0.4,cross_track_m_s=0.1
    shipdrag simulate --ship ship.yaml -o weed.mcap --effects effects --effect weed=0.0014
    """
    output = Output(options.json)
    ship = Ship.load(options.ship)
    effects_of(ship)  # those that her file declares are known by name from here on
    settings = simulated.SimulationSettings(
        speed_m_s=simulated.usual_speed(ship) if options.speed is None else options.speed,
        duration_s=options.duration,
        lead_in_s=options.lead_in,
        heading_rad=options.heading,
        rate_hz=options.rate,
        noise=options.noise,
        seed=options.seed,
        inputs=options.inputs,
        effects=tuple(parse(text) for text in options.effect),
        first_heading_rad=options.first_heading,
        start_ns=START_NS if options.start is None else options.start,
    )
    block, truth = simulated.make(ship, settings)
    simulated.write_bag(options.out, block, ship, truth, output)
    counts = Counter(Channel(code).input for code in block.channel.tolist())
    output.say(
        f'{options.out}: {len(block)} messages; after {settings.lead_in_s:g} s at '
        f'{settings.speed_m_s:g} m/s the engine stops, and the ship coasts for '
        f'{settings.duration_s:g} s'
    )
    for effect in (*ship.effects, *settings.effects):
        values = values_of(effect, ship).items()
        output.say(
            f'  {effect.name}: ' + ', '.join(f'{name} = {value:g}' for name, value in values)
        )
    output.json(
        {
            'bag': str(options.out),
            'messages': counts,
            'start_ns': block.receive_ns[0],
            'end_ns': block.receive_ns[-1],
            'settings': truth.settings,
        }
    )
    return 0


def _inputs(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(','))
    if unknown := [name for name in names if name not in SENSORS.split(', ')]:
        raise argparse.ArgumentTypeError(f'{unknown}, expected some of {SENSORS}')
    return names


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


def add_simulate_fleet(parser: argparse.ArgumentParser) -> None:
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


def run_simulate_fleet(options: argparse.Namespace) -> int:
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
