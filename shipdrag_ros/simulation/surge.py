# SPDX-License-Identifier: Apache-2.0
"""
Surge motion of a ship: steady, coasting, or as its engine orders say.

Forces enter in two ways, as a function of the speed (tabulated once) and as a
function of time (one `Leg` between two events); anything new is one of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.kernel import Law, Leg, integrate
from shipdrag_ros.simulation.noise import GaussMarkov
from shipdrag_ros.simulation.scenario import Scenario

_CELLS = 4000  # of the table of resistance; its error is far below that of any sensor
_QUIET_STEP_S = 1.0  # before the first order or turn nothing happens but the disturbances


@dataclass(frozen=True)
class Truth:
    """
    What really happened, in ascending time.

    Attributes
    ----------
    ship, scenario
        What was simulated.
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
    """

    ship: Ship
    scenario: Scenario
    time_s: Float64
    speed_through_water_m_s: Float64
    position_m: Float64
    velocity_over_ground_m_s: Float64
    heading_rad: Float64
    shaft_rad_s: Float64

    def __len__(self) -> int:
        return len(self.time_s)

    def specific_resistance(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the true r = R/m [m/s^2] at speeds through water.
        """
        return self.ship.resistance_n(speed_m_s) / self.ship.mass_kg

    def at(self, time_s: Float64) -> Truth:
        """
        Return the same motion at other times within the record.

        Parameters
        ----------
        time_s : (m,)
            Ascending or not [s].
        """
        path = CubicHermiteSpline(self.time_s, self.position_m, self.velocity_over_ground_m_s)
        velocity = [np.interp(time_s, self.time_s, v) for v in self.velocity_over_ground_m_s.T]
        return Truth(
            self.ship,
            self.scenario,
            time_s,
            np.interp(time_s, self.time_s, self.speed_through_water_m_s),
            path(time_s),
            np.column_stack(velocity),
            self.scenario.heading(time_s),
            _shaft_rad_s(self.ship, self.scenario, time_s),
        )


def simulate(ship: Ship, scenario: Scenario, *, step_s: float | None = None) -> Truth:
    """
    Integrate the surge equation over a record.

    Parameters
    ----------
    ship
        With a baseline.
    scenario
        What happens.
    step_s
        Longest step from the first order or turn on; found from the ship
        where it is not given.

    Raises
    ------
    SimulationError
        If the ship has effects, or the speed leaves the baseline's table.
    ShipdragError
        If the ship has no baseline.

    Notes
    -----
    (1 + n_r) m du/dt = T - R(u) - air drag of the current + gusts - m dc/dt,
    u the speed through water, c the slow disturbance of the water's velocity.
    In the lead-in the thrust equals the resistance at the steady speed.
    """
    if ship.effects:
        raise SimulationError(
            f'ship file: effects {[effect.name for effect in ship.effects]} cannot be simulated; '
            'leave them out'
        )
    law = _law(ship, scenario)
    length = scenario.length_s
    events = scenario.events_s()
    edges = sorted({0.0, *(moment for moment in events if 0.0 < moment < length), length})
    quiet_s = events[0] if events else length
    steps = _steps(ship, scenario, edges, quiet_s=quiet_s, step_s=step_s)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges, edges[1:], steps)]
    time = np.concatenate([*pieces, [length]])
    rng = np.random.default_rng(scenario.seed)
    water = _disturbance(scenario.water_speed, time, rng)
    gust = _disturbance(scenario.gust_force, time, rng) / ship.mass_kg

    steady = _steady_thrust_m_s2(ship, scenario)
    path = np.empty((len(time), 3))
    path[0] = scenario.speed_m_s, 0.0, 0.0
    first = 0
    for start, end, n in zip(edges, edges[1:], steps):
        part = slice(first, first + n + 1)
        leg = Leg(
            step_s=(end - start) / n,
            gust_m_s2=gust[part],
            water_m_s=water[part],
            **_forces(ship, scenario, start, steady),
        )
        path[part] = integrate(law, leg, *path[first])
        _check_range(law, time[part], path[part, 0])
        first += n
    return _truth(ship, scenario, time, path, water)


def _law(ship: Ship, scenario: Scenario) -> Law:
    """Tabulate the resistance."""
    low, high = ship.baseline_range_m_s
    if not low <= scenario.speed_m_s <= high:
        raise SimulationError(
            f'speed_m_s is {scenario.speed_m_s!r}, the baseline is stated for '
            f'{low:.4g}..{high:.4g} m/s; choose a speed inside or extend the baseline'
        )
    # twice the steady speed leaves room for disturbances and keeps the cells fine
    speeds = np.linspace(low, min(high, 2.0 * scenario.speed_m_s), _CELLS + 1)
    table = CubicSpline(speeds, ship.resistance_n(speeds) / ship.mass_kg)
    return Law(
        low_m_s=low,
        cell_m_s=float(speeds[-1] - low) / _CELLS,
        resistance=np.ascontiguousarray(table.c),
        n_r=ship.n_r_polynomial(),
        air_1_m=float(ship.air_drag_n(1.0)) / ship.mass_kg,
        current_m_s=np.array(scenario.current_m_s, np.float64),
    )


def _steps(
    ship: Ship,
    scenario: Scenario,
    edges: list[float],
    *,
    quiet_s: float,
    step_s: float | None,
) -> list[int]:
    """Return the number of steps between events."""
    noises = (scenario.water_speed, scenario.gust_force)
    slow = min([noise.correlation_time_s / 10.0 for noise in noises if noise], default=np.inf)
    if step_s is None:
        r = float(ship.resistance_n(scenario.speed_m_s)) / ship.mass_kg
        step_s = min(0.25, scenario.speed_m_s / r / 200.0)
        if run_down_s := _run_down_s(ship):
            step_s = min(step_s, run_down_s / 40.0)
    longest = [_QUIET_STEP_S if start < quiet_s else step_s for start in edges[:-1]]
    return [
        max(1, int(np.ceil((end - start) / min(longest_s, slow))))
        for start, end, longest_s in zip(edges, edges[1:], longest)
    ]


def _steady_thrust_m_s2(ship: Ship, scenario: Scenario) -> float:
    """Return the thrust per mass that keeps the speed of the lead-in."""
    speed, yaw = scenario.speed_m_s, scenario.heading_rad
    east, north = scenario.current_m_s
    over_ground = speed + east * np.cos(yaw) + north * np.sin(yaw)
    # the baseline holds the still-air drag at the speed through water
    of_current = ship.air_drag_n(over_ground) - ship.air_drag_n(speed)
    return float(ship.resistance_n(speed) + of_current) / ship.mass_kg


def _forces(ship: Ship, scenario: Scenario, start_s: float, steady: float) -> dict[str, float]:
    """Return the fields of a `Leg` that orders and turns decide."""
    run_down_s = _run_down_s(ship)
    ordered = scenario.thrust_ordered(start_s)
    thrust = float(scenario.thrust_fraction(start_s, run_down_s=run_down_s))
    turn = scenario.turn_at(start_s)
    area = turn.drag_area_m2 if turn else 0.0
    return {
        'thrust_m_s2': steady * ordered,
        'thrust_excess_m_s2': steady * (thrust - ordered),
        'run_down_s': run_down_s,
        'yaw_rad': float(scenario.heading(start_s)),
        'yaw_rate_rad_s': turn.rate_rad_s if turn else 0.0,
        'turning_1_m': 0.5 * ship.water.density_kg_m3 * area / ship.mass_kg,
    }


def _run_down_s(ship: Ship) -> float:
    return ship.propulsion.run_down_s if ship.propulsion else 0.0


def _disturbance(noise: GaussMarkov | None, time: Float64, rng: np.random.Generator) -> Float64:
    return np.zeros_like(time) if noise is None else noise.sample(time, rng)


def _check_range(law: Law, time: Float64, speed: Float64) -> None:
    top = law.low_m_s + law.cell_m_s * law.resistance.shape[1]
    margin = 1e-9 * top  # rounding of a steady speed at the very end of the table
    magnitude = np.abs(speed)
    # written so that NaN counts
    outside = ~((magnitude >= law.low_m_s - margin) & (magnitude <= top + margin))
    if np.any(outside):
        i = int(np.argmax(outside))
        raise SimulationError(
            f'the speed is {speed[i]:.4g} m/s at {time[i]:.6g} s, the baseline is tabulated for '
            f'{law.low_m_s:.4g}..{top:.4g} m/s; shorten the record or extend the baseline'
        )


def _truth(ship: Ship, scenario: Scenario, time: Float64, path: Float64, water: Float64) -> Truth:
    heading = scenario.heading(time)
    over_ground = path[:, 0] + water
    direction = np.column_stack([np.cos(heading), np.sin(heading)])
    return Truth(
        ship,
        scenario,
        time,
        path[:, 0],
        path[:, 1:],
        over_ground[:, None] * direction + np.array(scenario.current_m_s),
        heading,
        _shaft_rad_s(ship, scenario, time),
    )


def _shaft_rad_s(ship: Ship, scenario: Scenario, time: Float64) -> Float64:
    fraction = scenario.shaft_fraction(time, run_down_s=_run_down_s(ship))
    return scenario.shaft_rad_s * fraction
