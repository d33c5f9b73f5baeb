# SPDX-License-Identifier: Apache-2.0
"""A coastdown that is known to the last digit: simulated, sensed, a record or a bag."""

from __future__ import annotations

import reprlib
import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypedDict, Unpack

import numpy as np

from shipdrag_ros import simulation
from shipdrag_ros.bags import Run
from shipdrag_ros.bags.mcap_file import BagFiles, McapFile
from shipdrag_ros.bags.writer import new_bag
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.library.record import Record, ShipGiven, ship_of
from shipdrag_ros.library.replaying import Listener, Notes
from shipdrag_ros.library.shown import says_it_in_python
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import PARAMETERS_FILE
from shipdrag_ros.replay.run_result import ATTACHMENT, TrueCurve
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import SHIP_FILE, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import STANDARD_INPUTS, START_NS, Scenario, sense, standard_sensors
from shipdrag_ros.simulation.effect import DAY_S, Effect
from shipdrag_ros.simulation.effects import find, parse, terms, values_of

SPEED_FRACTION = 0.8
"""Of the highest speed of the baseline: where a simulation begins."""

LONGEST_S = 1e6
"""Of the record before the stop, and from it on."""

_FIRST_YEAR, _LAST_YEAR = 1980, 2037  # the stamp of a message has 31 bits of seconds
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_AT_ONCE = 1000  # messages between two looks at the progress
_TRUE_POINTS = 201
_TRUE_MARGIN = 1.05
_RESISTANCE = (
    'what depends on the speed through water alone: the baseline and what effects add to it as '
    'functions of that speed, over the mass of the ship as she is; not wind, waves, current, '
    'turns or thrust'
)
Size = float | str | Mapping[str, float | str]
"""Of an effect: its first parameter, or all of them by name."""
Effects = Mapping[str, Size] | Iterable[str | StatedEffect | Effect]
"""Sizes by name, or a list."""

NAME = 'simulated'


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """What a simulation was asked for, as `truth.yaml` states it."""

    speed_m_s: float
    duration_s: float
    lead_in_s: float = 600.0
    heading_rad: float
    rate_hz: float = 1.0
    noise: float = 1.0
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
                'scope': str(find(effect.name).scope),
                'parameters': values_of(effect, ship),
            }
            for effect in (*ship.effects, *self.effects)
        ]
        plain = {**asdict(self), 'inputs': list(self.inputs), 'effects': effects}
        if self.first_heading_rad is None:
            plain['first_heading_rad'] = self.heading_rad
        return {**plain, 'resistance': _RESISTANCE}


def make(ship: Ship, settings: SimulationSettings) -> tuple[Block, TrueCurve]:
    """
    Simulate a coastdown; return what the sensors read, and the truth.

    Raises
    ------
    SimulationError
        If the settings ask for something impossible.
    """
    for name in ('lead_in_s', 'duration_s'):
        if getattr(settings, name) > LONGEST_S:
            raise SimulationError(
                f'{name} is {getattr(settings, name):g}, expected at most {LONGEST_S:g}'
            )
    scenario = Scenario(
        speed_m_s=settings.speed_m_s,
        lead_in_s=settings.lead_in_s,
        duration_s=settings.duration_s,
        heading_rad=settings.heading_rad,
        day=(settings.start_ns * 1e-9 + settings.lead_in_s) / DAY_S,
        seed=settings.seed,
    )
    motion = simulation.simulate(
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


def write_bag(path: Path, block: Block, ship: Ship, truth: TrueCurve, listener: Listener) -> None:
    """
    Write a simulated record; what is begun and not ended is removed.
    """
    acting = [each['name'] for each in truth.settings['effects']]
    attachments = {
        SHIP_FILE: ship.to_yaml(),
        PARAMETERS_FILE: Parameters().to_yaml(),
        ATTACHMENT: truth.to_yaml(),
        **{f'effects/{term.name}.yaml': term.to_yaml() for term in terms(acting)},
    }
    with new_bag(path, attachments) as bag, listener.progress(f'writing {path}') as progress:
        for done in range(0, len(block), _AT_ONCE):
            bag.write_samples(block[done : done + _AT_ONCE])
            progress(done, len(block))


def usual_speed(ship: Ship) -> float:
    """
    Return the speed [m/s] that a simulation begins at where none is asked for.

    Raises
    ------
    SimulationError
        Without a baseline.
    """
    return round(SPEED_FRACTION * _highest_speed(ship), 3)


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


def moment_ns(text: str) -> int:
    """
    Read a date or a time of ISO 8601 [ns since the epoch], UTC unless it says otherwise.

    Raises
    ------
    SimulationError
        If it is none, or lies outside of what a stamp can hold.
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = _EPOCH
    # a clock that starts near zero is taken for one that does not know the date
    if not _FIRST_YEAR <= moment.year <= _LAST_YEAR:
        raise SimulationError(
            f'{text!r}, expected a date of ISO 8601 from {_FIRST_YEAR} to {_LAST_YEAR}, as '
            '2026-03-01 or 2026-03-01T06:30:00Z'
        )
    utc = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (utc - _EPOCH) // timedelta(microseconds=1) * 1000


class Sensing(TypedDict, total=False):
    """
    Further settings of a simulation.

    Attributes
    ----------
    lead_in_s
        Steady sailing before the stop [s], 600.
    first_heading_rad
        Heading of the first run of the day [rad], to which current, wind and waves are
        stated; that of this run where it is not given.
    rate_hz
        Readings of each sensor [Hz], 1.
    noise
        Factor on the white noise of the sensors, 1; 0 for exact readings.
    inputs
        Sensors on board, of the names of the inputs.
    """

    lead_in_s: float
    first_heading_rad: float
    rate_hz: float
    noise: float
    inputs: Sequence[str]


@says_it_in_python
def simulate(
    ship: ShipGiven,
    effects: Effects | None = None,
    *,
    speed_m_s: float | None = None,
    duration_s: float = 1500.0,
    heading_rad: float = 0.0,
    start: str | datetime | None = None,
    seed: int = 0,
    **sensing: Unpack[Sensing],
) -> Record:
    """
    Sail steadily, stop the engine, let the ship coast and read her sensors.

    Parameters
    ----------
    ship
        With a baseline, or the path of its file.
    effects
        What acts in addition, by name: `{'fouling': 0.2}` for the first parameter, or
        `{'current': {'along_track_m_s': 0.4}}`; or a list, of `'fouling=0.2'` as the command
        line takes it, or of effects as a ship or a diagnosis has them. docs/effects.md has
        all, in SI.
    speed_m_s
        Steady speed through water before the stop [m/s]; None: 0.8 of the highest
        speed of the baseline.
    duration_s
        Record from the stop on [s].
    heading_rad
        Heading [rad], anticlockwise from east as in REP-103.
    start
        Date of the first stamp, ISO 8601, UTC unless it says otherwise; None:
        2026-06-01T08:00:00.
    seed
        Of the noise: the same seed gives the same readings.
    sensing
        By name: `lead_in_s` [s], `first_heading_rad` [rad], `rate_hz` [Hz], `noise` and
        `inputs`, as `shipdrag simulate` has them.

    Returns
    -------
    Record
        With its `truth`; `save` writes it as a bag.

    Raises
    ------
    SimulationError
        If something impossible is asked for.

    Notes
    -----
    Source: m (1 + n_r) du/dt = X - R(u), S1 (1). The bag is that of `shipdrag simulate`,
    to the last byte of its messages.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), {'fouling': 0.2}, duration_s=600.0, seed=3)
    >>> clean = sd.simulate(sd.Ship.example(), duration_s=600.0, seed=3)
    >>> bool(record.truth.at(6.0) > clean.truth.at(6.0))
    True
    """
    hull = ship_of(ship)
    if hull is None:
        raise SimulationError('no ship is given: a Ship, or the path of a ship file')
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise SimulationError(f'seed {seed!r}: expected a whole number from 0 on')
    more = {**sensing}
    if 'inputs' in more:
        inputs = sensing['inputs']
        more['inputs'] = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    unknown = set(more) - set(Sensing.__annotations__)
    if unknown:
        raise SimulationError(
            f'{", ".join(sorted(unknown))}: not known; beside the arguments by name there are '
            f'{", ".join(Sensing.__annotations__)}'
        )
    settings = SimulationSettings(
        speed_m_s=usual_speed(hull) if speed_m_s is None else speed_m_s,
        duration_s=duration_s,
        heading_rad=heading_rad,
        seed=seed,
        effects=_stated(effects),
        start_ns=START_NS if start is None else moment_ns(str(start)),
        **more,  # type: ignore[arg-type]
    )
    block, truth = make(hull, settings)
    folder = TemporaryDirectory(prefix='shipdrag-')
    bag = Path(folder.name) / f'{NAME}.mcap'
    write_bag(bag, block, hull, truth, Notes())
    # two runs of one day are known by their names
    name = f'{NAME}, seed {seed}' + (f', heading {heading_rad:.4g} rad' if heading_rad else '')
    run = Run(BagFiles(name, (bag,)), [McapFile(bag)])
    weakref.finalize(run, folder.cleanup)
    return Record([run])


def _stated(effects: Effects | None) -> tuple[StatedEffect, ...]:
    """Read effects and their sizes."""
    if isinstance(effects, Mapping):
        return tuple(_sized(name, size) for name, size in effects.items())
    if not isinstance(effects, str) and isinstance(given := effects or (), Iterable):
        read = [parse(each) if isinstance(each, str) else each for each in given]
        if all(hasattr(each, 'parameters') for each in read):
            return tuple(
                StatedEffect(each.name, {} if isinstance(each, Effect) else dict(each.parameters))
                for each in read
            )
    raise SimulationError(
        f"effects {reprlib.repr(effects)}: give names with sizes, {{'fouling': 0.3}} or "
        "['fouling=0.3']"
    )


def _sized(name: str, size: Size) -> StatedEffect:
    """Read an effect and its size."""
    first = find(name).parameters[0].name
    values = size if isinstance(size, Mapping) else {first: size}
    if first not in values:
        raise SimulationError(f'effect {name!r}: {first} is missing; give it with the others')
    others = [f'{key}={value}' for key, value in values.items() if key != first]
    return parse(f'{name}={",".join([str(values[first]), *others])}')
