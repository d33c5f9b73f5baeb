# SPDX-License-Identifier: Apache-2.0
"""`shipdrag simulate`: a coastdown that is known to the last digit, as a bag."""

from __future__ import annotations

import argparse
import math
from collections import Counter
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli.arguments import add_json, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.truth import ATTACHMENT, TrueCurve
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import (
    STANDARD_INPUTS,
    STANDARD_SD,
    START_NS,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)
from shipdrag_ros.simulation.effects import LIBRARY, parse, values_of

_AT_ONCE = 1000  # messages between two looks at the progress
_TRUE_POINTS = 201
_TRUE_MARGIN = 1.05
_FIRST_YEAR, _LAST_YEAR = 1980, 2037  # the stamp of a message has 31 bits of seconds
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SPEED_FRACTION = 0.8  # of what the baseline reaches
_RESISTANCE = (
    'what depends on the speed through water alone: the baseline and what effects add to it as '
    'functions of that speed, over the mass of the ship as she is; not wind, waves, current, '
    'turns or thrust'
)


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """What a simulation was asked for, as `truth.yaml` states it."""

    speed_m_s: float
    duration_s: float
    lead_in_s: float
    heading_rad: float
    rate_hz: float
    noise: float
    seed: int
    inputs: tuple[str, ...] = STANDARD_INPUTS
    effects: tuple[StatedEffect, ...] = ()
    first_heading_rad: float | None = None
    start_ns: int = START_NS

    def stated(self, ship: Ship) -> dict[str, object]:
        """
        Return them in plain terms, with all effects that act on the ship.
        """
        effects = [
            {
                'name': effect.name,
                'scope': str(LIBRARY[effect.name].scope),
                'parameters': values_of(effect, ship),
            }
            for effect in (*ship.effects, *self.effects)
        ]
        plain = {**asdict(self), 'inputs': list(self.inputs), 'effects': effects}
        if self.first_heading_rad is None:
            plain['first_heading_rad'] = self.heading_rad
        return {**plain, 'resistance': _RESISTANCE}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Sail steadily, stop the engine and let a simulated ship coast; write what log, position, '
        'heading and shaft sensors read, with the truth attached as truth.yaml.'
    )
    parser.add_argument(
        '--ship', required=True, type=Path, metavar='FILE', help='ship file with a baseline (YAML)'
    )
    parser.add_argument(
        '-o',
        '--out',
        required=True,
        type=Path,
        metavar='BAG',
        help='MCAP file to make; an existing one is not overwritten',
    )
    parser.add_argument(
        '--speed',
        type=number(0.0, 40.0, unit='m/s', above=True),
        metavar='M_S',
        help='steady speed through water before the stop [m/s] (default: '
        f'{_SPEED_FRACTION:g} of the highest speed that the baseline is given for)',
    )
    parser.add_argument(
        '--duration',
        type=number(0.0, 1e6, unit='s', above=True),
        default=1500.0,
        metavar='S',
        help='record from the stop on [s]',
    )
    parser.add_argument(
        '--lead-in',
        type=number(0.0, 1e6, unit='s'),
        default=600.0,
        metavar='S',
        help='steady sailing before the stop [s]',
    )
    parser.add_argument(
        '--heading',
        type=number(-2 * math.pi, 2 * math.pi, unit='rad'),
        default=0.0,
        metavar='RAD',
        help='heading [rad], anticlockwise from east as in REP-103: 1.5708 is north',
    )
    parser.add_argument(
        '--effect',
        action='append',
        default=[],
        metavar='NAME=VALUE[,PARAM=VALUE]...',
        help='add an effect that the ship file does not state; may be repeated. Known: '
        + '; '.join(_form(name) for name in LIBRARY)
        + '. docs/effects.md says what each does',
    )
    parser.add_argument(
        '--first-heading',
        type=number(-2 * math.pi, 2 * math.pi, unit='rad'),
        metavar='RAD',
        help='heading of the first run [rad], to which current, wind and waves are stated; give '
        'it to simulate another run of the same day (default: this run is the first)',
    )
    parser.add_argument(
        '--start',
        type=moment_ns,
        metavar='DATE',
        help='date of the first stamp, ISO 8601, UTC unless it says otherwise: 2026-03-01 or '
        '2026-03-01T06:30:00+01:00 (default: 2026-06-01T08:00:00)',
    )
    _add_sensors(parser)
    add_json(parser)


def _add_sensors(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        '--inputs',
        type=_inputs,
        default=','.join(STANDARD_INPUTS),
        metavar='INPUT[,INPUT]...',
        help=f'sensors on board, of {", ".join(channel.input for channel in STANDARD_SD)}',
    )
    parser.add_argument(
        '--rate',
        type=number(0.001, 1000.0, unit='Hz'),
        default=1.0,
        metavar='HZ',
        help='readings of each sensor [Hz]',
    )
    parser.add_argument(
        '--noise',
        type=number(0.0, 1000.0),
        default=1.0,
        metavar='FACTOR',
        help='factor [-] on the white noise of the sensors: 0.05 m/s of the log, 10 m of the '
        'position, 0.5 deg of heading and rudder, 0.02 rad/s of the shaft, 0.1 m/s of the speed '
        'over ground, 0.5 m/s of the wind, 0.2 m of the depth; 0: exact readings',
    )
    parser.add_argument(
        '--seed',
        type=_seed,
        default=0,
        metavar='N',
        help='seed of the noise: the same seed gives the same readings',
    )


def run(options: argparse.Namespace) -> int:
    """
    Simulate and write the bag.
    """
    output = Output(options.json)
    ship = Ship.load(options.ship)
    speed_m_s = options.speed
    if speed_m_s is None:
        speed_m_s = round(_SPEED_FRACTION * _highest_speed(ship), 3)
    settings = SimulationSettings(
        speed_m_s=speed_m_s,
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
    block, truth = make(ship, settings)
    write_bag(options.out, block, ship, truth, output)
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


def make(ship: Ship, settings: SimulationSettings) -> tuple[Block, TrueCurve]:
    """
    Simulate a coastdown; return what the sensors read, and the truth.

    Raises
    ------
    SimulationError
        If the settings ask for something impossible.
    """
    scenario = Scenario(
        speed_m_s=settings.speed_m_s,
        lead_in_s=settings.lead_in_s,
        duration_s=settings.duration_s,
        heading_rad=settings.heading_rad,
        seed=settings.seed,
    )
    motion = simulate(
        ship, scenario, effects=settings.effects, reference_rad=settings.first_heading_rad
    )
    block = sense(
        motion,
        standard_sensors(rate_hz=settings.rate_hz, noise=settings.noise, inputs=settings.inputs),
        seed=settings.seed,
        start_ns=settings.start_ns,
    )
    # the fit starts a little above or below the true speed
    highest = min(_TRUE_MARGIN * settings.speed_m_s, _highest_speed(ship))
    # a table that begins above rest, as a fitted one does, says nothing of slower speeds
    speed = np.linspace(ship.baseline_range_m_s[0], highest, _TRUE_POINTS)
    truth = TrueCurve(speed, motion.specific_resistance(speed), settings.stated(ship))
    return block, truth


def write_bag(path: Path, block: Block, ship: Ship, truth: TrueCurve, output: Output) -> None:
    """
    Write a simulated record; what is begun and not ended is removed.
    """
    writer = BagWriter(path)
    try:
        with writer, output.progress(f'writing {path}') as progress:
            writer.attach('ship.yaml', ship.to_yaml())
            writer.attach('parameters.yaml', Parameters().to_yaml())
            writer.attach(ATTACHMENT, truth.to_yaml())
            for done in range(0, len(block), _AT_ONCE):
                writer.write_samples(block[done : done + _AT_ONCE])
                progress(done, len(block))
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _highest_speed(ship: Ship) -> float:
    """Return the highest speed [m/s] that the baseline is given for."""
    if ship.baseline is None:
        raise SimulationError(
            f'ship {ship.name!r} has no baseline resistance; add `baseline` to its ship file'
        )
    if isinstance(ship.baseline, TableBaseline):
        return ship.baseline.speed_m_s[-1]
    # a rounding error above the last point of the table is outside of it
    return float(np.nextafter(ship.speed(ship.baseline.wave_froude[-1]), 0.0))


def _form(name: str) -> str:
    """Return how an effect is given."""
    first, *others = LIBRARY[name].parameters
    unit = f' [{first.unit}]' if first.unit else ''
    return f'{name}={first.name}{unit}' + ''.join(f',{other.name}=' for other in others)


def _inputs(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(','))
    known = [channel.input for channel in STANDARD_SD]
    if unknown := [name for name in names if name not in known]:
        raise argparse.ArgumentTypeError(f'{unknown}, expected some of {", ".join(known)}')
    return names


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'{text!r}, expected a whole number, 0 or more')
    return int(text)


def moment_ns(text: str) -> int:
    """
    Read a date or a time of ISO 8601 [ns since the epoch].
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = _EPOCH
    # a clock that starts near zero is taken for one that does not know the date
    if not _FIRST_YEAR <= moment.year <= _LAST_YEAR:
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected a date of ISO 8601 from {_FIRST_YEAR} to {_LAST_YEAR}, as '
            '2026-03-01 or 2026-03-01T06:30:00Z'
        )
    utc = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (utc - _EPOCH) // timedelta(microseconds=1) * 1000
