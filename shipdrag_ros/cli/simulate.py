# SPDX-License-Identifier: Apache-2.0
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
    factor [-] on the white noise of the sensors: 0.05 m/s of the log, 10 m of the position, 0.5
    deg of heading and rudder, 0.02 rad/s of the shaft, 0.1 m/s of the speed over ground, 0.5 m/s
    of the wind, 0.2 m of the depth; 0: exact readings
--seed N
    seed of the noise: the same seed gives the same readings

Examples
--------
shipdrag simulate --ship ship.yaml -o calm.mcap --lead-in 1800
shipdrag simulate --ship ship.yaml -o fouled.mcap --effect fouling=0.3 --effect \
current=0.4,cross_track_m_s=0.1
shipdrag simulate --ship ship.yaml -o weed.mcap --effects effects --effect weed=0.0014
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from pathlib import Path

from shipdrag_ros.cli.arguments import add, checked, number, whole
from shipdrag_ros.cli.output import Output
from shipdrag_ros.library import simulated
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, STANDARD_SD, START_NS
from shipdrag_ros.simulation.effects import LIBRARY, effects_of, find, parse, values_of


def _form(name: str) -> str:
    """Return how an effect is given."""
    first, *others = find(name).parameters
    unit = f' [{first.unit}]' if first.unit else ''
    return f'{name}={first.name}{unit}' + ''.join(f',{other.name}=' for other in others)


KNOWN = '; '.join(map(_form, LIBRARY))
SENSORS = ', '.join(channel.input for channel in STANDARD_SD)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    course = number(-2 * math.pi, 2 * math.pi, unit='rad')
    parser.add_argument('--ship', required=True, type=Path)
    parser.add_argument('-o', '--out', required=True, type=Path)
    parser.add_argument('--speed', type=number(0.0, 40.0, unit='m/s', above=True))
    parser.add_argument('--duration', type=number(0.0, 1e6, unit='s', above=True), default=1500.0)
    parser.add_argument('--lead-in', type=number(0.0, 1e6, unit='s'), default=600.0)
    parser.add_argument('--heading', type=course, default=0.0)
    parser.add_argument('--effect', action='append', default=[])
    parser.add_argument('--first-heading', type=course)
    parser.add_argument('--start', type=checked(simulated.moment_ns))
    parser.add_argument('--inputs', type=_inputs, default=','.join(STANDARD_INPUTS))
    parser.add_argument('--rate', type=number(0.001, 1000.0, unit='Hz'), default=1.0)
    parser.add_argument('--noise', type=number(0.0, 1000.0), default=1.0)
    parser.add_argument('--seed', type=whole(0), default=0)
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Simulate and write the bag.
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
