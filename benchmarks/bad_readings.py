# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns found and estimated through bad readings.

    python benchmarks/bad_readings.py [--runs N] [--ships NAME ...] [--faults WORD ...]

Three ships (`_coasts.py`) in calm sea: half an hour of steady sailing, then the thrust runs
down and the ship coasts. Log at 1 Hz, white noise and the slow wandering of the sea on it; with
it, or not, radar positions at 1 Hz. Each record is replayed as it is and again with each fault
in it, noise and all else the same, seeds 0 .. N - 1. Found: one coastdown with an estimate holds
80 % of what is found of the record as it is, and no other has an estimate. RMSE of the final r
over the valid range, root mean square over the runs, as a part of that of the same records as
they are; cover is how often +-2 sigma (repeatable) holds the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from _coasts import CARGO, TANKER, YACHT, Hull, errors

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation import GaussMarkov, Scenario, Sensor, Truth, sense, simulate

LEAD_IN_S = 1800.0
COURSE_RAD = 0.7
SEA_PART = 0.0025  # of the speed: the wandering of the log in a calm sea
SEA_S = 60.0
LOG, TRACK = Channel.SPEED_THROUGH_WATER, Channel.POSITION
SHIPS = (CARGO, TANKER, replace(YACHT, duration_s=300.0))
FAR_M = 2e4

Spoil = Callable[[np.random.Generator, Float64, Float64], Float64]
"""Spoil the values of one channel, given their times after the stop [s]; NaN: not there."""


@dataclass(frozen=True)
class Fault:
    """A kind of bad reading, of the log unless `track`."""

    name: str
    spoil: Spoil
    track: bool = False


def dropouts(share: float, value: float, *, longest: int = 1) -> Spoil:
    """Put `value` in a share of the readings, in bursts of up to `longest`."""

    def spoil(rng: np.random.Generator, time_s: Float64, values: Float64) -> Float64:
        values = values.copy()
        for first in np.flatnonzero(rng.random(len(values)) < 2.0 * share / (1 + longest)):
            values[first : first + rng.integers(1, longest + 1)] = value
        return values

    return spoil


def zero_at(place_s: float) -> Spoil:
    """Make the one reading at a time after the stop 0."""

    def spoil(rng: np.random.Generator, time_s: Float64, values: Float64) -> Float64:
        values = values.copy()
        values[np.argmin(np.abs(time_s - place_s))] = 0.0
        return values

    return spoil


def spikes(share: float, low: float, high: float) -> Spoil:
    """Let a share of the readings jump, either way, by `low` to `high`."""

    def spoil(rng: np.random.Generator, time_s: Float64, values: Float64) -> Float64:
        hit = rng.random(len(values)) < share
        jump = rng.uniform(low, high, values.shape) * rng.choice([-1.0, 1.0], values.shape)
        return np.where(hit.reshape(-1, *[1] * (values.ndim - 1)), values + jump, values)

    return spoil


def stuck(first_s: float, length_s: float = 60.0) -> Spoil:
    """Repeat one reading from a time after the stop on."""

    def spoil(rng: np.random.Generator, time_s: Float64, values: Float64) -> Float64:
        values = values.copy()
        inside = (time_s >= first_s) & (time_s < first_s + length_s)
        values[inside] = values[np.argmax(inside)]
        return values

    return spoil


def gap(first_s: float, length_s: float = 30.0) -> Spoil:
    """Leave out the readings from a time after the stop on."""

    def spoil(rng: np.random.Generator, time_s: Float64, values: Float64) -> Float64:
        values = values.copy()
        values[(time_s >= first_s) & (time_s < first_s + length_s)] = np.nan
        return values

    return spoil


PLACES_S = (
    -900,
    -300,
    -120,
    -60,
    -30,
    -15,
    -5,
    0,
    3,
    6,
    10,
    15,
    20,
    30,
    45,
    60,
    80,
    100,
    120,
    140,
)
CUTS_S = (-300.0, -70.0, -30.0, -10.0, 5.0, 30.0, 70.0)
FAULTS = (
    *(Fault(f'zeros, 1 in {n}', dropouts(1 / n, 0.0)) for n in (20, 100, 500, 2000)),
    *(
        Fault(f'bursts of zeros, 1 in {n}', dropouts(1 / n, 0.0, longest=10))
        for n in (20, 100, 500, 2000)
    ),
    *(Fault('one zero at each of 20 places', zero_at(place)) for place in PLACES_S),
    *(
        Fault(f'spikes of {low:g} to {high:g} m/s, {share:.1%}', spikes(share, low, high))
        for low, high in ((1.0, 2.0), (2.0, 6.0))
        for share in (0.003, 0.01, 0.03)
    ),
    *(Fault('stuck for 60 s, 7 places', stuck(first)) for first in CUTS_S),
    *(Fault('gap of 30 s, 7 places', gap(first)) for first in CUTS_S),
    Fault('positions of 1e308, 5 %', dropouts(0.05, 1e308), track=True),
    Fault('positions 0, 0, 5 %', dropouts(0.05, 0.0), track=True),
    Fault('positions that jump by 20 km, 5 %', spikes(0.05, 0.5 * FAR_M, FAR_M), track=True),
    *(Fault('track stuck for 60 s, 7 places', stuck(first), track=True) for first in CUTS_S),
)


@dataclass(frozen=True)
class Found:
    """
    What the monitor made of a record.

    `rmse` is in parts of the largest r, `covered` a share; NaN without an estimate.
    """

    coastdowns: tuple[tuple[float, float], ...]
    rmse: float
    covered: float


def no_estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    raise EstimationError('only the final figure matters here')


def sail(hull: Hull) -> Truth:
    """Simulate the record of a ship."""
    ship = hull.ship
    if ship.propulsion is None:
        ship = replace(ship, propulsion=Propulsion(run_down_s=3.0, sd=1.0))
    scenario = Scenario(
        speed_m_s=hull.speed_m_s,
        lead_in_s=LEAD_IN_S,
        duration_s=hull.duration_s,
        heading_rad=COURSE_RAD,
    )
    return simulate(ship, scenario)


def read(hull: Hull, truth: Truth, *, track: bool, seed: int) -> Block:
    """Read it as good sensors do."""
    sensors = [
        Sensor(
            channel=LOG,
            sd=hull.log_sd,
            coloured=GaussMarkov(SEA_PART * hull.speed_m_s, SEA_S),
        )
    ]
    if track:
        sensors.append(Sensor(channel=TRACK, sd=hull.position_sd))
    return sense(truth, sensors, seed=seed)


def spoilt(block: Block, fault: Fault, *, seed: int) -> Block:
    """Put a fault into a record."""
    channel = TRACK if fault.track else LOG
    rows = np.flatnonzero(block.channel == channel)
    columns = 2 if fault.track else 1
    time_s = (block.stamp_ns[rows] - block.stamp_ns[0]) * 1e-9 - LEAD_IN_S
    values = block.value.copy()
    bad = fault.spoil(np.random.default_rng(seed), time_s, values[rows, :columns])
    values[rows, :columns] = bad
    return replace(block, value=values)[~np.isnan(values).any(axis=1)]


def watch(ship: Ship, block: Block, truth: Truth) -> Found:
    """Replay a record."""
    monitor = Monitor(ship, Parameters(), estimate=no_estimate, final=estimate_final)
    events = monitor.update(block) + monitor.finish()
    ended = [event for event in events if isinstance(event, EndedCoastdown) and event.estimate]
    start_ns = int(block.stamp_ns[0])
    spans = tuple(
        ((one.start_ns - start_ns) * 1e-9 - LEAD_IN_S, (one.end_ns - start_ns) * 1e-9 - LEAD_IN_S)
        for one in ended
    )
    if not ended:
        return Found(spans, np.nan, np.nan)
    longest = max(ended, key=lambda one: one.end_ns - one.start_ns)
    assert longest.estimate is not None
    found = errors(longest.estimate, truth)
    return Found(spans, found.rmse, found.covered)


def holds(found: Found, clean: Found) -> bool:
    """Say whether one coastdown is there, and holds 80 % of the clean one."""
    if len(found.coastdowns) != 1 or len(clean.coastdowns) != 1:
        return False
    (start, end), (first, last) = found.coastdowns[0], clean.coastdowns[0]
    return min(end, last) - max(start, first) >= 0.8 * (last - first)


def kinds(words: list[str]) -> dict[str, list[Fault]]:
    """Group faults by name; all, or those whose name holds one of the words."""
    groups: dict[str, list[Fault]] = {}
    for fault in FAULTS:
        if not words or any(word in fault.name for word in words):
            groups.setdefault(fault.name, []).append(fault)
    return groups


def compare(hull: Hull, runs: int, words: list[str]) -> Iterator[str]:
    """Return the lines of a ship."""
    truth = sail(hull)
    ship = truth.ship
    for track in (False, True):
        blocks = [read(hull, truth, track=track, seed=seed) for seed in range(runs)]
        clean = [watch(ship, block, truth) for block in blocks]
        yield line(hull, track, 'as it is', clean, clean, [holds(one, one) for one in clean])
        for name, faults in kinds(words).items():
            if faults[0].track and not track:
                continue
            # a fault at several places: one after the other
            found = [
                watch(ship, spoilt(block, faults[seed % len(faults)], seed=1000 + seed), truth)
                for seed, block in enumerate(blocks)
            ]
            held = [holds(one, other) for one, other in zip(found, clean)]
            yield line(hull, track, name, found, clean, held)


def line(
    hull: Hull, track: bool, name: str, found: list[Found], clean: list[Found], held: list[bool]
) -> str:
    """Return a line of the table."""
    moved = [
        one.coastdowns[0][0] - other.coastdowns[0][0]
        for one, other, ok in zip(found, clean, held)
        if ok
    ]
    rmse, before = (
        np.sqrt(np.mean([one.rmse**2 for one, ok in zip(each, held) if ok] or [np.nan]))
        for each in (found, clean)
    )
    cover, cover_before = (
        np.mean([one.covered for one, ok in zip(each, held) if ok] or [np.nan])
        for each in (found, clean)
    )
    inputs = 'log, track' if track else 'log'
    worst = f'{max(map(abs, moved)):6.0f}' if moved else '     -'
    return (
        f'{hull.name:11} {inputs:10} {name:36} {len(found):4} {np.mean(held):7.1%}'
        f' {np.median(np.abs(moved)) if moved else np.nan:6.1f} {worst}'
        f' {100 * before:7.2f} {100 * rmse:7.2f} {rmse / before:6.2f}'
        f' {cover_before:7.1%} {cover:7.1%}'
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('--ships', nargs='*', default=[])
    parser.add_argument('--faults', nargs='*', default=[])
    chosen = parser.parse_args()
    print(f'N = {chosen.runs} records of each ship and inputs, seeds 0..{chosen.runs - 1};')
    print('onset moved against the record as it is [s]: median, most; RMSE in % of the largest r')
    print(
        f'{"ship":11} {"inputs":10} {"fault":36} {"N":>4} {"found":>7} {"moved":>6} {"most":>6}'
        f' {"clean":>7} {"RMSE":>7} {"ratio":>6} {"c clean":>7} {"cover":>7}'
    )
    for hull in SHIPS:
        if not chosen.ships or hull.name in chosen.ships:
            for text in compare(hull, chosen.runs, chosen.faults):
                print(text, flush=True)


if __name__ == '__main__':
    main()
