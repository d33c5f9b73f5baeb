# SPDX-License-Identifier: Apache-2.0
"""
Surge motion of a ship: steady, coasting, or as its engine orders say.

Forces enter in two ways, as a function of the speed (tabulated once) and as a
function of time (one leg between two events); effects add to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import terms
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import action_of
from shipdrag_ros.simulation.kernel import SurgeLaw, follow
from shipdrag_ros.simulation.scenario import GaussMarkov, Scenario

_LULL = 0.1  # of the stall speed, within which a shaft stops
_STALLS = 0.12  # of its free revs, at which the torque of a propeller is largest: B4-70, B6-80
_WINDMILLING = 0.7  # of the shaft speed that drives the ship as fast: no torque, a higher advance
_QUIET_STEP_S = 1.0  # before the first order or turn nothing happens but the disturbances


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
    law = terms.law_of(ship, scenario.speed_m_s)
    [column] = terms.columns_of(ship, scenario, [action], speed_m_s=np.array([scenario.speed_m_s]))
    scenario = terms.acted(scenario, action)
    changes = any(action.current_change_m_s)
    edges = terms.edges_of(scenario, also_s=[scenario.lead_in_s] if changes else [])
    steps = steps_of(ship, scenario, edges, step_s=step_s)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges, edges[1:], steps)]
    time = np.concatenate([*pieces, [scenario.length_s]])
    rng = np.random.default_rng(scenario.seed)
    water = _disturbance(scenario.water_speed, time, rng)
    gust = _disturbance(scenario.gust_force, time, rng) / ship.mass_kg

    path = np.empty((len(time), 5))
    follow(
        law,
        column,
        terms.extra_of(ship, law, [action])[0],
        terms.legs_of(ship, scenario, edges, steps),
        gust,
        water,
        time,
        path,
    )
    _check_range(law, time, path[:, 0])
    return Truth(
        ship,
        scenario,
        time,
        path[:, 0],
        path[:, 1:3],
        path[:, 3:],
        scenario.heading(time),
        _shaft_rad_s(ship, scenario, action, time, path[:, 0]),
        action,
    )


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
        if run_down_s := terms.run_down_s(ship, Action()):
            step_s = min(step_s, run_down_s / 40.0)
    quiet_s = min(scenario.events_s(), default=scenario.length_s)
    longest = [_QUIET_STEP_S if start < quiet_s else step_s for start in edges[:-1]]
    return [
        max(1, int(np.ceil((end - start) / min(longest_s, slow))))
        for start, end, longest_s in zip(edges, edges[1:], longest)
    ]


def _disturbance(noise: GaussMarkov | None, time: Float64, rng: np.random.Generator) -> Float64:
    return np.zeros_like(time) if noise is None else noise.sample(time, rng)


def _check_range(law: SurgeLaw, time: Float64, speed: Float64) -> None:
    is_outside = terms.outside(law, speed)
    if np.any(is_outside):
        i = int(np.argmax(is_outside))
        raise SimulationError(
            f'the speed is {speed[i]:.4g} m/s at {time[i]:.6g} s, the baseline is tabulated for '
            f'{law.low_m_s:.4g}..{terms.top_m_s(law):.4g} m/s; shorten the record or extend the '
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
    fraction = scenario.shaft_fraction(time, run_down_s=terms.run_down_s(ship, action))
    if action.residual_fraction:
        residual = scenario.shaft_fraction(time, run_down_s=action.residual_decay_s)
        fraction += action.residual_fraction * (residual - fraction)
    turned = np.zeros(len(speed))
    if action.stall_m_s > 0.0:
        turned = _WINDMILLING * speed / scenario.speed_m_s * turning(speed, action.stall_m_s)
    # an engine that turns the shaft faster, or astern, is stronger than the flow
    return scenario.shaft_rad_s * np.where(np.abs(fraction) < turned, turned, fraction)
