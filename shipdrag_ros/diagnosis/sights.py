# SPDX-License-Identifier: Apache-2.0
"""
Observed runs as the one posterior takes them: rows, a prior of the stop, and their simulation.

A ship without a baseline is simulated with a usual one, and her law is that of any hull.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, Rows
from shipdrag_ros.posterior.hypotheses import RunSight, ShipRuns, SimulatedRows
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Columns, Scenario, simulate_columns
from shipdrag_ros.simulation.effect import DAY_S, Frame


def ship_runs(seen: Sequence[Observation], ship: Ship) -> ShipRuns:
    """
    Return runs of a ship as hypotheses see them.

    Parameters
    ----------
    seen
        Effects of the earth are stated along the first.
    ship
        Her effects do not count: those of her file are hypotheses' own.
    """
    return ShipRuns(tuple(sight(run, seen, ship) for run in seen))


def day_of(run: Observation) -> float:
    """
    Return the day of the stop, counted from 1970-01-01 UTC.
    """
    return (run.context.stop.since_ns * 1e-9 + run.lead_in_s) / DAY_S


def lowest_m_s(run: Observation) -> float:
    """Return about the speed at the end."""
    speeds = [
        run.along.rows.value[run.along.rows.kind == kind][-5:]
        for kind in (0, 1)
        if (run.along.rows.kind == kind).any()
    ]
    if speeds:
        return max(float(np.median(speeds[0])), 0.05 * run.speed_m_s)
    return 0.3 * run.speed_m_s


def sight(run: Observation, seen: Sequence[Observation], ship: Ship) -> RunSight:
    """
    Return a run, or one that is yet to be made, beside some runs.

    Parameters
    ----------
    run
    seen
        What the law is spread over, and the first heading.
    ship
    """
    top = max(each.speed_m_s for each in seen)
    low = min(lowest_m_s(each) for each in seen)
    scenario = Scenario(
        speed_m_s=run.speed_m_s,
        lead_in_s=run.lead_in_s,
        # beyond the last row, whatever the difference is rounded to
        duration_s=run.duration_s + 1e-6,
        heading_rad=run.heading_rad,
        day=day_of(run),
    )
    if run.context.depth_m is not None:
        scenario = replace(scenario, depth_m=run.context.depth_m)
    frame = Frame(run.ship, scenario, seen[0].heading_rad)
    along = run.along
    rows = Rows(along.rows.time_s - run.lead_in_s, along.rows.kind, along.rows.value)
    steady = int(np.searchsorted(along.rows.time_s, run.lead_in_s))
    stop = StopPrior(max(run.stop_sd_s, 1e-3), run.run_down_s, run.run_down_sd_s)
    own = replace(run.ship, baseline=ship.baseline)  # as heavy as she was in this run
    model = RunModel.of(
        rows,
        along.variance,
        steady,
        own,
        stop,
        speed_m_s=run.speed_m_s,
        range_m_s=(low, top),
    )
    # whether a free propeller stands is the ship's, not the run's: it is odd once
    odd = next((each for each in seen if each.context.odd), None) is run
    run = replace(run, context=replace(run.context, odd=odd))
    across = run.across
    value, blocks = [run.context.value], [run.context.whitener]
    if across is not None:
        value.insert(0, across.rows.value)
        blocks.insert(0, run.across_whitener)
    stated = ship.propulsion.run_down_s if ship.propulsion else 0.0
    return RunSight(
        model,
        frame,
        np.concatenate(value),
        np.asarray(block_diag(*blocks, np.zeros((0, 0))), np.float64),
        0 if across is None else len(across),
        run.heading_sd_rad,
        stated,
        ship.baseline.run_scatter if ship.baseline else 0.0,
        -run.stop_moved_s,
        len(run.context.at_shaft) > 0,
        _simulating(run, frame),
    )


def _simulating(
    run: Observation, frame: Frame
) -> Callable[[Sequence[Action], Float64], SimulatedRows]:
    def simulate(actions: Sequence[Action], speed_m_s: Float64) -> SimulatedRows:
        columns = simulate_columns(
            frame.ship, frame.scenario, actions, run.time_s, speed_m_s=speed_m_s
        )
        along, across, distance = rows_of(run, columns)
        context = run.context.predict(columns, actions)
        at = distance[:, :0] if run.across is None else distance[:, run.across.at]
        return SimulatedRows(along, np.hstack([across, context]), at)

    return simulate


def rows_of(seen: Observation, columns: Columns) -> tuple[Float64, Float64, Float64]:
    """Return rows along and across (k, n), and the distance ahead (k, m), of each column."""
    cos, sin = math.cos(seen.heading_rad), math.sin(seen.heading_rad)
    place = columns.radar_position_m
    ahead = cos * place[..., 0] + sin * place[..., 1]
    to_port = cos * place[..., 1] - sin * place[..., 0]
    kind, at = seen.along.rows.kind, seen.along.at
    along = ahead[:, at]
    along[:, kind == LOG] = columns.log_m_s[:, at[kind == LOG]]
    along[:, kind == OVER_GROUND] = columns.radar_speed_m_s[:, at[kind == OVER_GROUND]]
    across = to_port[:, :0] if seen.across is None else to_port[:, seen.across.at]
    return along, across, ahead
