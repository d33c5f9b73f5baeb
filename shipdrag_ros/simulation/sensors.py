# SPDX-License-Identifier: Apache-2.0
"""
Sensors that read a simulated motion, with the faults of real ones.

A reading is the truth at its time of measurement plus noise; what the stamp
says and when the reading arrives are faults of their own. A sensor that is
wrong throughout, by its scale for instance, is an effect of the simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import FURTHER, Block, Channel, Float64, in_arrival_order
from shipdrag_ros.simulation.effect import Action
from shipdrag_ros.simulation.scenario import GaussMarkov
from shipdrag_ros.simulation.surge import Truth


def log_reading(
    action: Action, time_s: Float64, speed_m_s: Float64, at_s: Float64, stop_s: float
) -> Float64:
    """
    Return what the log reads.

    Parameters
    ----------
    action
        With the faults: errors by speed and time, scale, offset, lag and clock, in the
        order in which a log has them.
    time_s, speed_m_s : (n,)
        True speed through water, linear between and constant outside.
    at_s : (m,)
        Stamps of the readings.
    stop_s
        End of the lead-in.

    Returns
    -------
    (m,)
        [m/s]
    """
    flow = speed_m_s.copy()
    for error in action.log_error:
        flow += error(speed_m_s, time_s - stop_s)
    flow = (1.0 + action.log_factor) * flow + action.log_offset_m_s
    if action.log_lag_s > 0.0:
        flow = lagged(time_s, flow, action.log_lag_s)
    return np.interp(at_s - action.log_late_s, time_s, flow)


@compiled
def lagged(time_s: Float64, value: Float64, lag_s: float) -> Float64:
    """
    Filter what is linear between times, exactly, from a steady start.

    Parameters
    ----------
    time_s, value : (n,)
        Ascending times [s], and what is filtered.
    lag_s
        Time constant of the first-order filter, more than 0.

    Returns
    -------
    (n,)
        What the filter shows at the times.
    """
    result = value.copy()
    for i in range(1, len(value)):
        step = time_s[i] - time_s[i - 1]
        behind = 0.0 if step == 0.0 else (value[i] - value[i - 1]) / step * lag_s
        excess = result[i - 1] - value[i - 1] + behind
        result[i] = value[i] - behind + excess * np.exp(-step / lag_s)
    return result


START_NS = 1_780_300_800_000_000_000  # 2026-06-01 08:00 UTC

# white noise of well-kept sensors, in the unit of the channel
STANDARD_SD: dict[Channel, float] = {
    Channel.SPEED_THROUGH_WATER: 0.05,
    Channel.POSITION: 10.0,
    Channel.HEADING: float(np.radians(0.5)),
    Channel.SHAFT: 0.02,
    Channel.SPEED_OVER_GROUND: 0.1,
    Channel.RUDDER: float(np.radians(0.5)),
    Channel.WIND_APPARENT: 0.5,
    Channel.DEPTH: 0.2,
}
STANDARD_SD |= {
    each: STANDARD_SD[each.kind]
    for each in Channel
    if each.input in FURTHER and each.kind in STANDARD_SD
}
STANDARD_INPUTS = ('speed_through_water', 'position', 'heading', 'shaft')


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """
    One sensor; values are in the unit of its channel.

    Attributes
    ----------
    channel
        What it measures; geodetic positions are not simulated.
    rate_hz
        Readings per second.
    sd
        Standard deviation of white noise, of each column.
    coloured
        Slow noise on top, of each column.
    outlier_fraction, outlier_size
        Share of readings that jump, either way, by 0.5 to 1.5 times the size.
    gaps_s
        Times of the record, (from, to), without readings.
    quantum
        Readings are multiples of it; 0: not rounded.
    delay_s
        Time from the measurement to its arrival.
    stamp_jitter_s
        Standard deviation of the stamp around the time of measurement.
    stated_sd
        Standard deviation that the sensor claims; NaN: it does not say.
    """

    channel: Channel
    rate_hz: float = 1.0
    sd: float = 0.0
    coloured: GaussMarkov | None = None
    outlier_fraction: float = 0.0
    outlier_size: float = 0.0
    gaps_s: tuple[tuple[float, float], ...] = ()
    quantum: float = 0.0
    delay_s: float = 0.0
    stamp_jitter_s: float = 0.0
    stated_sd: float = np.nan


def standard_sensors(
    *, rate_hz: float = 1.0, noise: float = 1.0, inputs: Sequence[str] = STANDARD_INPUTS
) -> tuple[Sensor, ...]:
    """
    Return the sensors of a well-kept ship.

    Parameters
    ----------
    rate_hz
        Readings per second of each.
    noise
        Multiplies the standard deviations of `STANDARD_SD`; 0 for exact
        readings.
    inputs
        Which sensors she has.

    Raises
    ------
    SimulationError
        If there is no such sensor.
    """
    known = {channel.input: channel for channel in STANDARD_SD}
    if unknown := [name for name in inputs if name not in known]:
        raise SimulationError(f'sensors: {unknown} are not known; known are {", ".join(known)}')
    return tuple(
        Sensor(channel=known[name], rate_hz=rate_hz, sd=noise * STANDARD_SD[known[name]])
        for name in dict.fromkeys(inputs)
    )


def sense(
    truth: Truth, sensors: Sequence[Sensor], *, seed: int, start_ns: int = START_NS
) -> Block:
    """
    Read a motion with sensors; return their samples in arrival order.

    Parameters
    ----------
    truth
        The motion.
    sensors
        At most one of a channel.
    seed
        Of all noise; the noise of one sensor does not depend on the others.
    start_ns
        Time of the start of the record [ns since the epoch].

    Returns
    -------
    Block
        Of n samples, in arrival order.

    Raises
    ------
    SimulationError
        If a sensor is impossible.

    Notes
    -----
    Source: white noise and slow disturbances as each `Sensor` declares them, drawn by numpy's
    PCG64.

    Examples
    --------
    >>> from importlib import resources
    >>> from shipdrag_ros.ship import Ship
    >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    >>> from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
    >>> scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
    >>> block = sense(simulate(ship, scenario), standard_sensors(), seed=1)
    >>> len(block)
    6004
    """
    problems = [problem for sensor in sensors for problem in _problems(sensor)]
    if len({sensor.channel for sensor in sensors}) < len(sensors):
        problems.append('two sensors of one channel, expected one')
    if problems:
        raise SimulationError('sensors: ' + '; '.join(problems))
    return in_arrival_order([_read(truth, sensor, seed, start_ns) for sensor in sensors])


def _read(truth: Truth, sensor: Sensor, seed: int, start_ns: int) -> Block:
    rng = np.random.default_rng([seed, sensor.channel])
    end_s = truth.time_s[-1]
    time = np.arange(int(end_s * sensor.rate_hz) + 1) / sensor.rate_hz
    time = time[time <= end_s]
    n = len(time)
    value = _perfect_values(truth, time, sensor.channel)
    columns = value.shape[1]
    value += sensor.sd * rng.standard_normal((n, columns))
    if sensor.coloured:
        for column in range(columns):
            value[:, column] += sensor.coloured.sample(time, rng)
    is_outlier = rng.random(n) < sensor.outlier_fraction
    jump = sensor.outlier_size * rng.uniform(0.5, 1.5, (n, columns))
    value += is_outlier[:, None] * jump * rng.choice([-1.0, 1.0], (n, columns))
    if sensor.quantum:
        value = np.round(value / sensor.quantum) * sensor.quantum
    value = _as_sent(value, sensor.channel)

    jitter = sensor.stamp_jitter_s * rng.standard_normal(n)
    keep = np.ones(n, np.bool_)
    for start, end in sensor.gaps_s:
        keep &= (time < start) | (time > end)
    variance = np.full((n, 2), np.nan)
    variance[:, :columns] = sensor.stated_sd**2
    return Block.of(
        sensor.channel,
        start_ns + _nanoseconds(time + jitter)[keep],
        (value if columns == 2 else value[:, 0])[keep],
        receive_ns=start_ns + _nanoseconds(time + sensor.delay_s)[keep],
        variance=variance[keep],
    )


def _perfect_values(whole: Truth, time: Float64, channel: Channel) -> Float64:
    """Return readings without noise, a new array of one or two columns."""
    truth, action = whole.at(time), whole.action
    # what is systematically wrong with a sensor is an effect, and of the first of a kind
    if channel.input in FURTHER:
        channel, action = channel.kind, Action()
    match channel:
        case Channel.SPEED_THROUGH_WATER:
            speed = whole.speed_through_water_m_s
            stop_s = whole.scenario.lead_in_s
            return log_reading(action, whole.time_s, speed, time, stop_s)[:, None]
        case Channel.SPEED_OVER_GROUND:
            shown: Float64 = np.hypot(*truth.velocity_over_ground_m_s.T)
            if action.ground_lag_s > 0.0:
                moved = np.hypot(*whole.velocity_over_ground_m_s.T)
                late = lagged(whole.time_s, moved, action.ground_lag_s)
                shown = np.interp(time, whole.time_s, late)
            return ((1.0 + action.radar_factor) * shown)[:, None]
        case Channel.POSITION:
            return (1.0 + action.radar_factor) * truth.position_m
        case Channel.HEADING:
            return truth.heading_rad[:, None].copy()
        case Channel.SHAFT:
            return truth.shaft_rad_s[:, None].copy()
        case Channel.RUDDER:
            return truth.scenario.rudder(truth.time_s)[:, None]
        case Channel.DEPTH:
            return np.full((len(truth), 1), truth.scenario.depth_m)
        case Channel.WIND_APPARENT:
            # the air, seen from the ship: forward and to port
            east, north = (np.array(action.wind_m_s) - truth.velocity_over_ground_m_s).T
            cos, sin = np.cos(truth.heading_rad), np.sin(truth.heading_rad)
            return np.column_stack([east * cos + north * sin, north * cos - east * sin])
        case _:
            raise SimulationError(f'sensors: {channel.name.lower()} cannot be simulated')


def _as_sent(value: Float64, channel: Channel) -> Float64:
    """Bring noisy readings to the range in which they are sent."""
    if channel is Channel.HEADING:
        return np.arctan2(np.sin(value), np.cos(value))
    if channel.kind is Channel.SPEED_OVER_GROUND:
        return np.abs(value)
    return value


def _nanoseconds(time_s: Float64) -> NDArray[np.int64]:
    return np.round(time_s * 1e9).astype(np.int64)


def _problems(sensor: Sensor) -> list[str]:
    name = sensor.channel.name.lower()
    problems = []
    if not 0.0 < sensor.rate_hz <= 1e4:
        problems.append(f'{name}: rate_hz is {sensor.rate_hz!r}, expected 0..10000 Hz')
    if not 0.0 <= sensor.outlier_fraction <= 1.0:
        problems.append(f'{name}: outlier_fraction is {sensor.outlier_fraction!r}, expected 0..1')
    for field in ('sd', 'outlier_size', 'quantum', 'delay_s', 'stamp_jitter_s'):
        value = getattr(sensor, field)
        if not 0.0 <= value < np.inf:
            problems.append(f'{name}: {field} is {value!r}, expected 0 or more')
    if sensor.coloured:
        problems.extend(f'{name}: coloured {problem}' for problem in sensor.coloured.problems())
    return problems
