# SPDX-License-Identifier: Apache-2.0
"""From ship, scenario and actions to what the compiled integration takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import hypot

import numpy as np

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.kernel import COLUMN, LEG, Records, SurgeLaw
from shipdrag_ros.simulation.scenario import Scenario

_CELLS = 4000  # of the table of resistance; its error is far below that of any sensor
_EXTRA_CELLS = 512  # of what effects add to it, which is smooth
_AS_THEY_ARE = (
    *('wave_encounter_s_m', 'residual_fraction', 'residual_decay_s'),
    *('n_r_change', 'mass_fraction'),
)
_RANGE = 2.0  # times the steady speed: room for disturbances, and the cells stay fine


@lru_cache(maxsize=8)
def law_of(ship: Ship, speed_m_s: float) -> SurgeLaw:
    """
    Tabulate the baseline; kept, as a ship is simulated again and again.

    Raises
    ------
    SimulationError
        If the steady speed is outside the baseline's table.
    """
    low, high = ship.baseline_range_m_s
    if not low <= speed_m_s <= high:
        raise SimulationError(
            f'speed_m_s is {round(speed_m_s, 3)}, the baseline is stated for '
            f'{low:.4g}..{high:.4g} m/s; choose a speed inside or extend the baseline'
        )
    speeds = np.linspace(low, min(high, _RANGE * speed_m_s), _CELLS + 1)
    from scipy.interpolate import CubicSpline  # takes long to import

    table = CubicSpline(speeds, ship.resistance_n(speeds) / ship.mass_kg)
    span = float(speeds[-1] - low)
    return SurgeLaw(
        low_m_s=low,
        cell_m_s=span / _CELLS,
        resistance=np.ascontiguousarray(table.c.T),
        extra_cell_m_s=span / _EXTRA_CELLS,
        n_r=ship.n_r_polynomial(),
        air_1_m=float(ship.air_drag_n(1.0)) / ship.mass_kg,
    )


def top_m_s(law: SurgeLaw) -> float:
    """
    Return the highest speed of the table.
    """
    return law.low_m_s + law.cell_m_s * len(law.resistance)


def outside(law: SurgeLaw, speed_m_s: Float64) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """
    Say which speeds the table does not hold; NaN is one.
    """
    top = top_m_s(law)
    margin = 1e-9 * top  # rounding of a steady speed at the very end of the table
    magnitude = np.abs(speed_m_s)
    return ~((magnitude >= law.low_m_s - margin) & (magnitude <= top + margin))


def extra_of(ship: Ship, law: SurgeLaw, actions: Sequence[Action]) -> Float64:
    """
    Tabulate what actions add to the resistance, per ship mass.

    Returns
    -------
    (k, e)
        At speeds `extra_cell_m_s` apart; e = 0 where no action adds any.
    """
    if not any(action.resistance for action in actions):
        return np.empty((len(actions), 0))
    speeds: Float64 = law.low_m_s + law.extra_cell_m_s * np.arange(_EXTRA_CELLS + 1.0)
    speeds[-1] = min(speeds[-1], ship.baseline_range_m_s[1])  # to the last digit
    table = np.zeros((len(actions), len(speeds)))
    # steps of a hypothesis differ in one function of several
    functions = {function for action in actions for function in action.resistance}
    added = {function: function(speeds) for function in functions}
    for row, action in zip(table, actions):
        for function in action.resistance:
            row += added[function]
    table /= ship.mass_kg
    return table


def columns_of(
    ship: Ship, scenario: Scenario, actions: Sequence[Action], *, speed_m_s: Float64
) -> Records:
    """
    Return what else the kernel must know of each action.

    Parameters
    ----------
    speed_m_s : (k,)
        Steady speed before the stop.

    Returns
    -------
    (k,)
        Records of `COLUMN`.
    """
    records = np.zeros(len(actions), COLUMN)
    records['speed_m_s'] = speed_m_s
    records['change_from_s'] = scenario.lead_in_s
    per_s = 1.0 / scenario.duration_s if scenario.duration_s > 0.0 else 0.0
    east, north = scenario.current_m_s
    for record, action in zip(records, actions):
        record['wind_east_m_s'], record['wind_north_m_s'] = action.wind_m_s
        wave = hypot(*action.wave_force_n)
        if wave > 0.0:
            record['wave_m_s2'] = wave / ship.mass_kg
            record['wave_east'] = action.wave_force_n[0] / wave
            record['wave_north'] = action.wave_force_n[1] / wave
        record['current_east_m_s'] = east + action.current_m_s[0]
        record['current_north_m_s'] = north + action.current_m_s[1]
        record['change_east_m_s2'] = action.current_change_m_s[0] * per_s
        record['change_north_m_s2'] = action.current_change_m_s[1] * per_s
        record['run_down_s'] = run_down_s(ship, action)
        for name in _AS_THEY_ARE:
            record[name] = getattr(action, name)
    return records


def run_down_s(ship: Ship, action: Action) -> float:
    """
    Return the time scale in which the thrust ends.
    """
    stated = ship.propulsion.run_down_s if ship.propulsion else 0.0
    return max(stated + action.run_down_change_s, 0.0)


def acted(scenario: Scenario, action: Action) -> Scenario:
    """
    Return the scenario with what an action changes of it.

    Raises
    ------
    SimulationError
        If a turn is impossible.
    """
    east, north = scenario.current_m_s
    turns = sorted((*scenario.turns, *action.turns), key=lambda turn: turn.start_s)
    return replace(
        scenario,
        current_m_s=(east + action.current_m_s[0], north + action.current_m_s[1]),
        depth_m=min(scenario.depth_m, action.depth_m),
        turns=tuple(turns),
    )


def edges_of(scenario: Scenario, *, also_s: Sequence[float] = ()) -> list[float]:
    """
    Return the record times between which all forces are smooth.
    """
    length = scenario.length_s
    inside = {moment for moment in (*scenario.events_s(), *also_s) if 0.0 < moment < length}
    return sorted({0.0, *inside, length})


def legs_of(
    ship: Ship, scenario: Scenario, edges_s: Sequence[float], steps: Sequence[int]
) -> Records:
    """
    Return the stretches between edges.

    Returns
    -------
    (l,)
        Records of `LEG`.
    """
    legs = np.zeros(len(steps), LEG)
    edges = np.asarray(edges_s)
    length = np.diff(edges)
    legs['start_s'] = edges[:-1]
    legs['step_s'] = length / steps
    legs['steps'] = steps
    legs['thrust_ordered'] = [scenario.thrust_ordered(start) for start in edges_s[:-1]]
    legs['yaw_rad'] = scenario.heading(edges[:-1])
    quarters = edges[:-1] + np.array([[0.25], [0.75]]) * length - scenario.lead_in_s
    for turn in scenario.turns:
        # linear within a leg, and at its ends perhaps a step
        early, late = turn.share(quarters)
        per_s = 2.0 * (late - early) / length
        share = early - 0.25 * length * per_s
        area_1_m = 0.5 * ship.water.density_kg_m3 * turn.drag_area_m2 / ship.mass_kg
        if turn.rate_rad_s:
            legs['yaw_rate_rad_s'] += turn.rate_rad_s * share
            legs['yaw_rate_rad_s2'] += turn.rate_rad_s * per_s
        legs['turning_1_m'] += area_1_m * share
        legs['turning_1_m_s'] += area_1_m * per_s
    return legs
