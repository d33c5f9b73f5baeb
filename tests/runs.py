# SPDX-License-Identifier: Apache-2.0
"""A coastdown that is simulated, read with sensors and cut, and a bag of any record."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.diagnosis import CoastRun
from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    STANDARD_INPUTS,
    START_NS,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)
from shipdrag_ros.simulation.effects import parse

CARGO = Ship.load(Path(__file__).parents[1] / 'config' / 'vitus_bering.yaml')


def coasted(
    *effects: str,
    name: str = 'run',
    ship: Ship = CARGO,
    speed_m_s: float = 8.0,
    lead_in_s: float = 1200.0,
    coast_s: float = 1200.0,
    heading_rad: float = 0.0,
    reference_rad: float | None = None,
    rate_hz: float = 1.0,
    noise: float = 1.0,
    inputs: Sequence[str] = STANDARD_INPUTS,
    seed: int = 1,
    start_ns: int = START_NS,
) -> CoastRun:
    """Return a run in which effects are hidden, with the record before the stop."""
    scenario = Scenario(
        speed_m_s=speed_m_s, lead_in_s=lead_in_s, duration_s=coast_s, heading_rad=heading_rad
    )
    hidden = [parse(text) for text in effects]
    truth = simulate(ship, scenario, effects=hidden, reference_rad=reference_rad)
    sensors = standard_sensors(rate_hz=rate_hz, noise=noise, inputs=inputs)
    return CoastRun(name, cut(sense(truth, sensors, seed=seed, start_ns=start_ns), lead_in_s))


def cut(block: Block, lead_in_s: float) -> Window:
    """Return what a record holds from a time of it on, with the record before that."""
    first = int(block.stamp_ns.min())
    stop_ns = first + round(lead_in_s * 1e9)
    return Window.from_block(block, stop_ns, int(block.stamp_ns.max()), before_ns=first)


def write_run(
    path: Path, block: Block, ship: Ship | None = None, parameters: str = '', **options: Any
) -> Path:
    """Write a block, and maybe a ship and parameters, to a file."""
    with BagWriter(path, **options) as bag:
        if ship is not None:
            bag.attach('ship.yaml', ship.to_yaml())
        if parameters:
            bag.attach('parameters.yaml', parameters)
        bag.write_samples(block)
    return path


def seen(name: str) -> Any:
    """Return a run of which nothing but the name is known."""
    return SimpleNamespace(name=name, span_ns=None)
