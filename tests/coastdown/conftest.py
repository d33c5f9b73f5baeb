# SPDX-License-Identifier: Apache-2.0
"""Records with coastdowns, and a way to compare events to the last bit."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Event
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate

START_NS = 1_700_000_000_000_000_000
SECOND_NS = 1_000_000_000

CARGO_SHIP = """
name: cargo ship
length_m: 150.0
displaced_volume_m3: 20200.0
wetted_surface_m2: 4542.0
propulsion: {run_down_s: 8.0, sd: 2.0}
baseline:
  form_factor: 0.20
  correlation_allowance: 3.0e-4
  wave_froude: [0.0, 0.12, 0.18, 0.22, 0.26]
  wave_coefficient: [0.0, 5.0e-5, 2.8e-4, 8.0e-4, 2.0e-3]
  relative_sd: {friction: 0.02, wave: 0.10}
"""


@pytest.fixture(autouse=True)
def defects() -> set[tuple[str, int]]:
    """Allow some: an estimator of these tests returns its window, of which nothing is foretold."""
    return set()


@pytest.fixture(scope='session')
def ship() -> Ship:
    return Ship.from_yaml(CARGO_SHIP, subject='cargo ship')


def bits(thing: object) -> bytes:
    """Return bytes that differ where one bit of an event differs."""
    if isinstance(thing, np.ndarray):
        return f'{thing.dtype}{thing.shape}'.encode() + thing.tobytes()
    if isinstance(thing, Enum):
        return str(thing).encode()
    if is_dataclass(thing):
        parts = [type(thing).__name__.encode()]
        parts += [bits(getattr(thing, item.name)) for item in fields(thing)]
        return b'|'.join(parts)
    if isinstance(thing, float):
        return struct.pack('<d', thing)
    if isinstance(thing, dict):
        return b'|'.join(key.encode() + bits(value) for key, value in sorted(thing.items()))
    if isinstance(thing, list | tuple):
        return b'[' + b'|'.join(bits(item) for item in thing) + b']'
    return repr(thing).encode()


def window_itself(window: Window, ship: Ship, parameters: Parameters) -> Window:
    """Stand in for an estimator: what it was given, to the last bit."""
    return window


def refuse(window: Window, ship: Ship, parameters: Parameters) -> Window:
    """Stand in for an estimator where only onset and end matter."""
    raise EstimationError('not asked for')


@pytest.fixture(scope='session')
def watch(ship: Ship) -> Callable[..., list[Event]]:
    """Run a whole record through a monitor."""

    def run(block: Block, parameters: Parameters | None = None) -> list[Event]:
        monitor = Monitor(ship, parameters or Parameters(), estimate=refuse, final=refuse)  # type: ignore[arg-type]
        return monitor.update(block) + monitor.finish()

    return run


LOG = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.05)
RADAR = Sensor(channel=Channel.POSITION, sd=10.0)
COMPASS = Sensor(channel=Channel.HEADING, sd=0.01)
SHAFT = Sensor(channel=Channel.SHAFT, sd=0.05)
EVERYTHING = (LOG, RADAR, COMPASS, SHAFT)


@pytest.fixture(scope='session')
def record(ship: Ship) -> Callable[..., Block]:
    """Simulate a record; the onset is at START_NS + lead_in_s."""

    def make(
        *, sensors: tuple[Sensor, ...] = (LOG,), seed: int = 0, speed_m_s: float = 8.2, **scenario
    ) -> Block:
        scenario = {'lead_in_s': 900.0, 'duration_s': 900.0, **scenario}
        truth = simulate(ship, Scenario(speed_m_s=speed_m_s, **scenario))
        return sense(truth, sensors, seed=seed, start_ns=START_NS)

    return make


@pytest.fixture(scope='session')
def sensors() -> dict[str, Sensor]:
    return {'log': LOG, 'radar': RADAR, 'compass': COMPASS, 'shaft': SHAFT}
