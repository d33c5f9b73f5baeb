# SPDX-License-Identifier: Apache-2.0
"""
Many simulations of one scenario in one compiled call.

Hypotheses, and the steps by which their parameters are found, differ in what
acts on the ship and in nothing else: each is a column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effect import Action
from shipdrag_ros.simulation.kernel import Records, SurgeLaw, follow_columns
from shipdrag_ros.simulation.scenario import Scenario, Turn
from shipdrag_ros.simulation.sensors import lagged, log_reading
from shipdrag_ros.simulation.surge import (
    acted,
    columns_of,
    edges_of,
    extra_of,
    law_of,
    legs_of,
    outside,
    own_action,
    run_down_s,
    steps_of,
)

RUN_DOWNS = 8.0  # after an order; e^-8 of the thrust is left, which is none
_STEPS_A_RUN_DOWN = 4
_STEPS_A_SLOW_DOWN = 40  # of v / r
_STEP_S = 10.0
# looks at a motion that is read late, at first and how they grow apart: good for 1 mm/s
_LOOKS_A_RUN_DOWN, _LOOKS_GROW = 16, 1.1


@dataclass(frozen=True)
class Columns:
    """
    Motions and readings of k simulations at the same times.

    A column whose speed leaves the baseline's table is NaN from there on.

    Attributes
    ----------
    time_s : (m,)
        Time of the record.
    speed_through_water_m_s : (k, m)
    position_m : (k, m, 2)
        East and north of the start.
    velocity_over_ground_m_s : (k, m, 2)
        To the east and to the north.
    log_m_s : (k, m)
        What the log reads, its faults included.
    radar_position_m : (k, m, 2)
    radar_speed_m_s : (k, m)
        Position and speed over ground as radar or GNSS read them.
    """

    time_s: Float64
    speed_through_water_m_s: Float64
    position_m: Float64
    velocity_over_ground_m_s: Float64
    log_m_s: Float64
    radar_position_m: Float64
    radar_speed_m_s: Float64

    def __len__(self) -> int:
        return len(self.speed_through_water_m_s)


@dataclass(frozen=True)
class _Prepared:
    """
    What the kernel takes of some columns: each motion once, however instruments read it.

    `motion` (k,) is the number of each column's motion.
    """

    motion: NDArray[np.int64]
    law: SurgeLaw
    records: Records
    extra: Float64
    legs: Records
    own_legs: NDArray[np.int64]

    def paths(self, time_s: Float64, motions: NDArray[np.int64] | slice = slice(None)) -> Float64:
        """Return what `follow` does, a path a motion (p, m, 5)."""
        of_each = self.records[motions], self.extra[motions]
        paths = np.empty((len(of_each[0]), len(time_s), 5))
        follow_columns(self.law, *of_each, self.legs, self.own_legs[motions], time_s, paths)
        lost = np.maximum.accumulate(outside(self.law, paths[:, :, 0]), axis=1)
        paths[lost] = np.nan
        return paths


def simulate_columns(
    ship: Ship,
    scenario: Scenario,
    actions: Sequence[Action],
    time_s: Float64,
    *,
    speed_m_s: Float64 | float | None = None,
    later_s: Float64 | float = 0.0,
    reference_rad: float | None = None,
    step_s: float | None = None,
) -> Columns:
    """
    Simulate a scenario under many actions, one column each.

    Parameters
    ----------
    ship
        With a baseline; its own effects act in every column.
    scenario
        Without random disturbances.
    actions
        k of them; their values are taken as they are.
    time_s : (m,)
        When to look, ascending, within the record [s].
    speed_m_s : (k,) or one, optional
        Steady speed before the stop, by column; the scenario's by default.
    later_s : (k,) or one
        By how much later the stop, and all after it, is than the scenario says [s].
    reference_rad
        Heading of the first run, as in `simulate`.
    step_s
        As in `simulate`; found from the ship where it is not given, coarser
        than there, and good for 0.1 mm/s (1 mm/s where an instrument reads late).

    Raises
    ------
    SimulationError
        If the scenario has disturbances, an action's turn is impossible, or
        the times are outside the record.
    ShipdragError
        If the ship has no baseline.
    """
    time = np.asarray(time_s, np.float64)
    if scenario.water_speed or scenario.gust_force:
        raise SimulationError(
            'scenario: water_speed and gust_force differ from run to run; leave them out'
        )
    # written so that NaN fails
    if not (np.all(time >= 0.0) and np.all(time <= scenario.length_s)):
        raise SimulationError(
            f'time_s is {np.min(time):g}..{np.max(time):g} s, expected within '
            f'0..{scenario.length_s:g} s'
        )
    if np.any(np.diff(time) < 0.0):
        raise SimulationError('time_s is not ascending; sort the times')
    own = own_action(ship, scenario, reference_rad=reference_rad)
    if own != Action():
        actions = [own + action for action in actions]
    speeds = scenario.speed_m_s if speed_m_s is None else speed_m_s
    records = columns_of(ship, scenario, actions, speed_m_s=speeds, later_s=later_s)
    prepared = _prepare(ship, scenario, actions, records, step_s)
    stop_s = scenario.lead_in_s + records['later_s']
    paths = prepared.paths(time)[prepared.motion]
    speed, position, velocity = paths[:, :, 0], paths[:, :, 1:3], paths[:, :, 3:]
    log = speed.copy()
    for i, action in enumerate(actions):
        for error in action.log_error:
            log[i] += error(speed[i], time - stop_s[i])
    factor, offset = np.array([(a.log_factor, a.log_offset_m_s) for a in actions]).T[:, :, None]
    log = (1.0 + factor) * log + offset
    over_ground = np.hypot(velocity[:, :, 0], velocity[:, :, 1])
    late = np.array([any((a.log_lag_s, a.log_late_s, a.ground_lag_s)) for a in actions])
    for later in np.unique(records['later_s'][late]).tolist():
        mine = np.flatnonzero(late & (records['later_s'] == later))
        seen: Float64 = np.union1d(time, _looks_s(ship, scenario, later))
        for i, path in zip(mine.tolist(), prepared.paths(seen, prepared.motion[mine])):
            action = actions[i]
            if action.log_lag_s or action.log_late_s:
                log[i] = log_reading(action, seen, path[:, 0], time, stop_s[i])
            if action.ground_lag_s > 0.0:
                moved = np.hypot(path[:, 3], path[:, 4])
                over_ground[i] = np.interp(time, seen, lagged(seen, moved, action.ground_lag_s))
    radar = 1.0 + np.array([action.radar_factor for action in actions])[:, None]
    read = radar[:, :, None] * position, radar * over_ground
    return Columns(time, speed, position, velocity, log, *read)


def _looks_s(ship: Ship, scenario: Scenario, later_s: float) -> Float64:
    """Return when a motion must be followed to be read late, straight lines between."""
    longest = _longest_step_s(ship, scenario.speed_m_s)
    run_down = run_down_s(ship, Action())
    # what changes at once is smooth later
    first = min(longest, run_down / _LOOKS_A_RUN_DOWN if run_down else longest)
    count = int(np.ceil(np.log(longest / first) / np.log(_LOOKS_GROW)))
    steps = first * _LOOKS_GROW ** np.arange(count)
    looks = [np.array([0.0, scenario.length_s])]
    for start, end in pairwise([*scenario.events_s(), scenario.length_s]):
        even = np.arange(start + steps.sum(), end, longest)
        looks += [np.array([start]), (start + np.cumsum(steps))[:-1], even]
    found = np.concatenate(looks) + later_s
    return found[(found >= 0.0) & (found <= scenario.length_s)]


def _prepare(
    ship: Ship,
    scenario: Scenario,
    actions: Sequence[Action],
    records: Records,
    step_s: float | None,
) -> _Prepared:
    law = law_of(ship, scenario.speed_m_s)
    also = _also_s(ship, scenario, actions, step_s)
    longest = _longest_step_s(ship, scenario.speed_m_s)
    legs: list[Records] = []
    places: dict[tuple[tuple[Turn, ...], float], tuple[int, int]] = {}
    # what is earlier than the scenario says goes on for longer after it
    over_s = np.maximum(-records['later_s'], 0.0).tolist()
    keys = [(action.turns, over) for action, over in zip(actions, over_s)]
    for action, over, key in zip(actions, over_s, keys):
        if key not in places:
            of_column = acted(scenario, action) if action.turns else scenario
            of_column = replace(of_column, duration_s=of_column.duration_s + over)
            edges = edges_of(of_column, also_s=also)
            if step_s is None:
                steps = _steps(ship, of_column, edges, longest)
            else:
                steps = steps_of(ship, of_column, edges, step_s=step_s)
            first = sum(map(len, legs))
            legs.append(legs_of(ship, of_column, edges, steps))
            places[key] = first, first + len(steps)
    motions: dict[tuple[object, ...], int] = {}
    motion = [
        motions.setdefault((record.tobytes(), action.resistance, action.turns), len(motions))
        for record, action in zip(records, actions)
    ]
    once = np.unique(motion, return_index=True)[1]
    moving = [actions[i] for i in once]
    own_legs = np.array([places[keys[i]] for i in once])
    extra = extra_of(ship, law, moving)
    return _Prepared(np.array(motion), law, records[once], extra, np.concatenate(legs), own_legs)


def _also_s(
    ship: Ship, scenario: Scenario, actions: Sequence[Action], step_s: float | None
) -> list[float]:
    """Return record times that part legs beside orders and turns."""
    times = []
    if any(any(action.current_change_m_s) for action in actions):
        times.append(scenario.lead_in_s)
    if step_s is None and ship.propulsion:
        settled = RUN_DOWNS * ship.propulsion.run_down_s
        times += [scenario.moment_s(order.time_s) + settled for order in scenario.orders]
    return times


@lru_cache(maxsize=8)
def _longest_step_s(ship: Ship, speed_m_s: float) -> float:
    """Return the length of a step where no thrust runs down."""
    r = float(ship.resistance_n(speed_m_s)) / ship.mass_kg
    return min(_STEP_S, speed_m_s / r / _STEPS_A_SLOW_DOWN)


def _steps(ship: Ship, scenario: Scenario, edges: Sequence[float], longest: float) -> list[int]:
    """Return the number of steps between edges: small ones where thrust runs down."""
    run_down = run_down_s(ship, Action())
    orders = [scenario.moment_s(order.time_s) for order in scenario.orders]
    quiet_s = min(scenario.events_s(), default=scenario.length_s)
    counts = []
    for start, end in pairwise(edges):
        step = longest
        # by its middle: the end of a run-down is an edge, to the last bit or not
        middle = 0.5 * (start + end)
        if any(0.0 <= middle - order < RUN_DOWNS * run_down for order in orders):
            step = min(step, run_down / _STEPS_A_RUN_DOWN)
        # before anything happens the speed is steady, and a step of any length exact
        counts.append(1 if end <= quiet_s else max(1, int(np.ceil((end - start) / step))))
    return counts
