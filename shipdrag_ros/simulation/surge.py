# SPDX-License-Identifier: Apache-2.0
"""
Surge motion of a ship: steady, coasting, or as its engine orders say.

Forces enter in two ways, as a function of the speed (tabulated once) and as a
function of time (one leg between two events); effects add to both. Here ship, scenario and
actions become what the compiled integration takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation.effect import Action, Frame
from shipdrag_ros.simulation.effects import action_of
from shipdrag_ros.simulation.kernel import COLUMN, LEG, Records, SurgeLaw, follow
from shipdrag_ros.simulation.scenario import GaussMarkov, Scenario, shares

_LULL = 0.1  # of the stall speed, within which a shaft stops
_STALLS = 0.12  # of its free revs, at which the torque of a propeller is largest: B4-70, B6-80
_WINDMILLING = 0.7  # of the shaft speed that drives the ship as fast: no torque, a higher advance
_QUIET_STEP_S = 1.0  # before the first order or turn nothing happens but the disturbances
_CELLS = 4000  # of the table of resistance; its error is far below that of any sensor
_EXTRA_CELLS = 512  # of what effects add to it, which is smooth
_RANGE = 2.0  # times the steady speed: room for disturbances, and the cells stay fine


@dataclass(frozen=True)
class Truth:
    """
    What really happened, in ascending time.

    Attributes
    ----------
    ship
    scenario
        What was simulated, with what the effects change of it: current,
        depth, turns.
    time_s : (n,)
        Time of the record, uneven [s].
    speed_through_water_m_s : (n,)
    position_m : (n, 2)
        East and north of the start.
    velocity_over_ground_m_s : (n, 2)
        To the east and to the north.
    heading_rad : (n,)
        Yaw from east, anticlockwise, unwrapped.
    shaft_rad_s : (n,)
    action
        Of all effects.
    """

    ship: Ship
    scenario: Scenario
    time_s: Float64
    speed_through_water_m_s: Float64
    position_m: Float64
    velocity_over_ground_m_s: Float64
    heading_rad: Float64
    shaft_rad_s: Float64
    action: Action

    def __len__(self) -> int:
        return len(self.time_s)

    def specific_resistance(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the true r = R/m [m/s^2] at speeds through water.

        R is all that depends on the speed through water alone: the baseline
        and what effects add to it as functions of that speed (fouling,
        propeller, cable, shallow water). Wind, waves, current, turns and
        thrust are not in it. m is the mass of the ship as she is.
        """
        resistance = self.ship.resistance_n(speed_m_s) + self.action.resistance_n(speed_m_s)
        return resistance / (self.ship.mass_kg * (1.0 + self.action.mass_fraction))

    def at(self, time_s: Float64) -> Truth:
        """
        Return the same motion at other times within the record.

        Parameters
        ----------
        time_s : (m,)
            Ascending or not [s].
        """
        from scipy.interpolate import CubicHermiteSpline  # takes long to import

        path = CubicHermiteSpline(self.time_s, self.position_m, self.velocity_over_ground_m_s)
        speed = np.interp(time_s, self.time_s, self.speed_through_water_m_s)
        velocity = [np.interp(time_s, self.time_s, v) for v in self.velocity_over_ground_m_s.T]
        return replace(
            self,
            time_s=time_s,
            speed_through_water_m_s=speed,
            position_m=path(time_s),
            velocity_over_ground_m_s=np.column_stack(velocity),
            heading_rad=self.scenario.heading(time_s),
            shaft_rad_s=_shaft_rad_s(self.ship, self.scenario, self.action, time_s, speed),
        )


def simulate(
    ship: Ship,
    scenario: Scenario,
    *,
    effects: Sequence[StatedEffect] = (),
    reference_rad: float | None = None,
    step_s: float | None = None,
) -> Truth:
    """
    Integrate the surge equation over a record.

    Parameters
    ----------
    ship
        With a baseline; its own effects act too.
    scenario
        What happens.
    effects
        On top of the ship's.
    reference_rad
        Heading of the first run, along which effects of the earth are
        stated; this run is the first where it is not given.
    step_s
        Longest step from the first order or turn on; found from the ship
        where it is not given.

    Returns
    -------
    Truth
        The motion: times [s], speeds [m/s], places [m], forces [N].

    Raises
    ------
    SimulationError
        If an effect cannot be simulated, or the speed leaves the baseline's
        table.
    ShipdragError
        If the ship has no baseline.

    Notes
    -----
    (1 + n_r) m du/dt = T - R(u) - air drag of current and wind + waves
    + gusts - m dc/dt, u the speed through water, c the velocity of the water
    as far as it changes. In the lead-in the thrust equals the resistance at
    the steady speed, effects included.

    Examples
    --------
    >>> from importlib import resources
    >>> from shipdrag_ros.ship import Ship
    >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    >>> from shipdrag_ros.simulation import Scenario, simulate
    >>> truth = simulate(ship, Scenario(speed_m_s=6.0, duration_s=900.0))
    >>> f'{truth.speed_through_water_m_s[-1]:.2f} m/s'
    '2.51 m/s'
    >>> f'r(5 m/s) = {truth.specific_resistance(5.0):.5f} m/s^2'
    'r(5 m/s) = 0.00678 m/s^2'
    """
    action = own_action(ship, scenario, reference_rad=reference_rad, effects=effects)
    law = law_of(ship, scenario.speed_m_s)
    [column] = columns_of(ship, scenario, [action], speed_m_s=scenario.speed_m_s)
    scenario = acted(scenario, action)
    changes = any(action.current_change_m_s)
    edges = edges_of(scenario, also_s=[scenario.lead_in_s] if changes else [])
    steps = steps_of(ship, scenario, edges, step_s=step_s)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges, edges[1:], steps)]
    time = np.concatenate([*pieces, [scenario.length_s]])
    rng = np.random.default_rng(scenario.seed)
    water = _disturbance(scenario.water_speed, time, rng)
    gust = _disturbance(scenario.gust_force, time, rng) / ship.mass_kg

    path = np.empty((len(time), 5))
    [extra], legs = extra_of(ship, law, [action]), legs_of(ship, scenario, edges, steps)
    follow(law, column, extra, legs, gust, water, time, path)
    speed, heading = path[:, 0], scenario.heading(time)
    _check_range(law, time, speed)
    shaft = _shaft_rad_s(ship, scenario, action, time, speed)
    return Truth(ship, scenario, time, speed, path[:, 1:3], path[:, 3:], heading, shaft, action)


def own_action(
    ship: Ship,
    scenario: Scenario,
    *,
    reference_rad: float | None,
    effects: Sequence[StatedEffect] = (),
) -> Action:
    """
    Return what the ship's own effects, and others, do in a scenario.
    """
    reference = scenario.heading_rad if reference_rad is None else reference_rad
    return action_of(Frame(ship, scenario, reference), (*ship.effects, *effects))


def steps_of(
    ship: Ship, scenario: Scenario, edges: Sequence[float], *, step_s: float | None
) -> list[int]:
    """
    Return the number of steps between edges.
    """
    noises = (scenario.water_speed, scenario.gust_force)
    slow = min([noise.correlation_time_s / 10.0 for noise in noises if noise], default=np.inf)
    if step_s is None:
        r = float(ship.resistance_n(scenario.speed_m_s)) / ship.mass_kg
        step_s = min(0.25, scenario.speed_m_s / r / 200.0)
        if run_down := run_down_s(ship, Action()):
            step_s = min(step_s, run_down / 40.0)
    quiet_s = min(scenario.events_s(), default=scenario.length_s)
    longest = [_QUIET_STEP_S if start < quiet_s else step_s for start in edges[:-1]]
    return [
        max(1, int(np.ceil((end - start) / min(longest_s, slow))))
        for start, end, longest_s in zip(edges, edges[1:], longest)
    ]


def _disturbance(noise: GaussMarkov | None, time: Float64, rng: np.random.Generator) -> Float64:
    return np.zeros_like(time) if noise is None else noise.sample(time, rng)


def _check_range(law: SurgeLaw, time: Float64, speed: Float64) -> None:
    is_outside = outside(law, speed)
    if is_outside.any():
        i = int(np.argmax(is_outside))
        raise SimulationError(
            f'the speed is {speed[i]:.4g} m/s at {time[i]:.6g} s, the baseline is tabulated for '
            f'{law.low_m_s:.4g}..{_top_m_s(law):.4g} m/s; shorten the record or extend the '
            'baseline'
        )


def turning(speed_m_s: Float64, stall_m_s: Float64 | float) -> Float64:
    """
    Return the revs of a shaft whose friction is constant over those without friction.

    Torque falls as the revs grow, from its largest at few of them; below the stall the shaft
    stands, and some way above it, for it stops from a chance lull on.
    """
    stall = np.maximum(stall_m_s, 1e-9)
    load = np.minimum(stall / np.maximum(speed_m_s, 1e-9), 1.0)
    stands = 0.5 * (1.0 - np.tanh((speed_m_s / stall - 1.0) / _LULL))
    return (1.0 - (1.0 - _STALLS) * load**2) * (1.0 - stands)


def _shaft_rad_s(
    ship: Ship, scenario: Scenario, action: Action, time: Float64, speed: Float64
) -> Float64:
    fraction = scenario.shaft_fraction(time, run_down_s=run_down_s(ship, action))
    if action.residual_fraction:
        residual = scenario.shaft_fraction(time, run_down_s=action.residual_decay_s)
        fraction += action.residual_fraction * (residual - fraction)
    turned = np.zeros(len(speed))
    if action.stall_m_s > 0.0:
        turned = _WINDMILLING * speed / scenario.speed_m_s * turning(speed, action.stall_m_s)
    # an engine that turns the shaft faster, or astern, is stronger than the flow
    return scenario.shaft_rad_s * np.where(np.abs(fraction) < turned, turned, fraction)


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


def _top_m_s(law: SurgeLaw) -> float:
    """Return the highest speed of the table."""
    return law.low_m_s + law.cell_m_s * len(law.resistance)


def outside(law: SurgeLaw, speed_m_s: Float64) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """
    Say which speeds the table does not hold; NaN is one.
    """
    top = _top_m_s(law)
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
    ship: Ship,
    scenario: Scenario,
    actions: Sequence[Action],
    *,
    speed_m_s: Float64 | float,
    later_s: Float64 | float = 0.0,
) -> Records:
    """
    Return what else the kernel must know of each action.

    Parameters
    ----------
    speed_m_s : (k,) or one
        Steady speed before the stop.
    later_s : (k,) or one
        By how much later all happens [s].

    Returns
    -------
    (k,)
        Records of `COLUMN`.
    """
    records = np.zeros(len(actions), COLUMN)
    records['speed_m_s'] = speed_m_s
    records['later_s'] = later_s
    records['change_from_s'] = scenario.lead_in_s
    left_s = scenario.duration_s - records['later_s']
    per_s = np.divide(1.0, left_s, out=np.zeros(len(actions)), where=left_s > 0.0)
    east, north = scenario.current_m_s
    for record, action, a_second in zip(records, actions, per_s):
        record['wind_east_m_s'], record['wind_north_m_s'] = action.wind_m_s
        wave = hypot(*action.wave_force_n)
        if wave > 0.0:
            record['wave_m_s2'] = wave / ship.mass_kg
            record['wave_east'] = action.wave_force_n[0] / wave
            record['wave_north'] = action.wave_force_n[1] / wave
        record['current_east_m_s'] = east + action.current_m_s[0]
        record['current_north_m_s'] = north + action.current_m_s[1]
        record['change_east_m_s2'] = action.current_change_m_s[0] * a_second
        record['change_north_m_s2'] = action.current_change_m_s[1] * a_second
    records['run_down_s'] = [run_down_s(ship, action) for action in actions]
    as_they_are = 'wave_encounter_s_m', 'residual_fraction', 'residual_decay_s'
    for name in (*as_they_are, 'n_r_change', 'mass_fraction'):
        records[name] = [getattr(action, name) for action in actions]
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
    if scenario.turns:
        # linear within a leg, and at its ends perhaps a step
        early, late = shares(scenario.turns, quarters).transpose(1, 0, 2)
        per_s = 2.0 * (late - early) / length
        share = early - 0.25 * length * per_s
        rates = np.array([[turn.rate_rad_s] for turn in scenario.turns])
        areas = np.array([[turn.drag_area_m2] for turn in scenario.turns])
        areas_1_m = 0.5 * ship.water.density_kg_m3 * areas / ship.mass_kg
        for name, each in (
            ('yaw_rate_rad_s', rates * share),
            ('yaw_rate_rad_s2', rates * per_s),
            ('turning_1_m', areas_1_m * share),
            ('turning_1_m_s', areas_1_m * per_s),
        ):
            legs[name] += np.add.accumulate(each)[-1]  # in their order, to the last bit
    return legs
