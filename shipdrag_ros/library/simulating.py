# SPDX-License-Identifier: Apache-2.0
"""A coastdown that is known to the last digit: simulated, sensed, written as a bag."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.library.listener import Listener
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.truth import ATTACHMENT, TrueCurve
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import (
    STANDARD_INPUTS,
    START_NS,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)
from shipdrag_ros.simulation.effects import LIBRARY, values_of

SPEED_FRACTION = 0.8
"""Of the highest speed of the baseline: where a simulation begins."""

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


def write_bag(path: Path, block: Block, ship: Ship, truth: TrueCurve, listener: Listener) -> None:
    """
    Write a simulated record; what is begun and not ended is removed.
    """
    writer = BagWriter(path)
    try:
        with writer, listener.progress(f'writing {path}') as progress:
            writer.attach('ship.yaml', ship.to_yaml())
            writer.attach('parameters.yaml', Parameters().to_yaml())
            writer.attach(ATTACHMENT, truth.to_yaml())
            for done in range(0, len(block), _AT_ONCE):
                writer.write_samples(block[done : done + _AT_ONCE])
                progress(done, len(block))
    except BaseException:
        path.unlink(missing_ok=True)
        raise


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
