# SPDX-License-Identifier: Apache-2.0
"""A simulated coastdown as a record, with its truth."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypedDict, Unpack

import numpy as np

from shipdrag_ros.bags import Run
from shipdrag_ros.bags.locate import BagFiles
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.library.listener import Notes
from shipdrag_ros.library.record import Record
from shipdrag_ros.library.simulating import (
    SimulationSettings,
    make,
    moment_ns,
    usual_speed,
    write_bag,
)
from shipdrag_ros.library.wording import says_it_in_python
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import START_NS
from shipdrag_ros.simulation.effects import find, parse

Size = float | str | Mapping[str, float | str]
"""Of an effect: its first parameter, or all of them by name."""

NAME = 'simulated'


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
    ship: Ship,
    effects: Mapping[str, Size] | None = None,
    *,
    speed_m_s: float | None = None,
    duration_s: float = 1500.0,
    heading_rad: float = 0.0,
    start: str | None = None,
    seed: int = 0,
    **sensing: Unpack[Sensing],
) -> Record:
    """
    Sail steadily, stop the engine, let the ship coast and read her sensors.

    Parameters
    ----------
    ship
        With a baseline.
    effects
        What acts in addition, by name: `{'fouling': 0.2}` for the first parameter, or
        `{'current': {'along_track_m_s': 0.4}}`. docs/effects.md has all, in SI.
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
    if not isinstance(effects or {}, Mapping):
        raise SimulationError(f"effects {effects!r}: give names with sizes, {{'fouling': 0.3}}")
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise SimulationError(f'seed {seed!r}: expected a whole number from 0 on')
    more = {**sensing}
    if 'inputs' in more:
        more['inputs'] = tuple(sensing['inputs'])
    unknown = set(more) - set(Sensing.__annotations__)
    if unknown:
        raise SimulationError(
            f'{", ".join(sorted(unknown))}: not known; beside the arguments by name there are '
            f'{", ".join(Sensing.__annotations__)}'
        )
    known = {'lead_in_s': 600.0, 'rate_hz': 1.0, 'noise': 1.0, **more}
    settings = SimulationSettings(
        speed_m_s=usual_speed(ship) if speed_m_s is None else speed_m_s,
        duration_s=duration_s,
        heading_rad=heading_rad,
        seed=seed,
        effects=tuple(_stated(name, size) for name, size in (effects or {}).items()),
        start_ns=START_NS if start is None else moment_ns(start),
        **known,  # type: ignore[arg-type]
    )
    block, truth = make(ship, settings)
    folder = TemporaryDirectory(prefix='shipdrag-')
    bag = Path(folder.name) / f'{NAME}.mcap'
    write_bag(bag, block, ship, truth, Notes())
    # two runs of one day are known by their names
    name = f'{NAME}, seed {seed}' + (f', heading {heading_rad:.4g} rad' if heading_rad else '')
    run = Run(BagFiles(name, (bag,)), [McapFile(bag)])
    weakref.finalize(run, folder.cleanup)
    return Record([run])


def _stated(name: str, size: Size) -> StatedEffect:
    """Read an effect and its size."""
    first = find(name).parameters[0].name
    values = size if isinstance(size, Mapping) else {first: size}
    if first not in values:
        raise SimulationError(f'effect {name!r}: {first} is missing; give it with the others')
    others = [f'{key}={value}' for key, value in values.items() if key != first]
    return parse(f'{name}={",".join([str(values[first]), *others])}')
