# SPDX-License-Identifier: Apache-2.0
"""Water that is shallow for the ship."""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import GRAVITY_M_S2, Ship
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DENIES, DRAUGHTS, Effect, Frame, Measure, Scope
from shipdrag_ros.simulation.hydrodynamics import viscous_n

_DEEP_LENGTHS = 0.3  # of depth: no sinkage is added from there on
_FROUDE_MAX = 0.85  # of depth; above it the sinkage formula is meaningless
_CLEARANCE_MIN = 0.2  # in draughts, under the keel: a fit may try less than is accepted
_GROWTH_MAX = 0.05  # of the displaced volume


def _act(frame: Frame, depth_m: float) -> Action:
    ship = frame.ship
    draught = ship.draught_m or np.nan
    friction = 0.57 * (draught / depth_m) ** 1.79

    def resistance(speed: Float64) -> Float64:
        viscous = viscous_n(ship, speed)
        deep = ship.resistance_n(speed) - ship.air_drag_n(speed)
        wetter = (1.0 + _growth(ship, depth_m, speed)) ** (2.0 / 3.0)
        shallow: Float64 = (deep + friction * viscous) * wetter
        return shallow - deep

    n_r = float(ship.n_r(0.5 * frame.scenario.speed_m_s))
    return Action(
        resistance=(resistance,),
        n_r_change=n_r * (_added_mass_ratio(ship, depth_m) - 1.0),
        depth_m=depth_m,
    )


def _growth(ship: Ship, depth_m: float, speed: Float64) -> Float64:
    """Return the share by which the added sinkage makes the hull larger."""
    length, volume = ship.length_m, ship.displaced_volume_m3
    sinkage = 1.46 * volume / length**2 * _squat(speed, depth_m)
    sinkage -= 1.46 * volume / length**2 * _squat(speed, _DEEP_LENGTHS * length)
    waterplane = length * (ship.breadth_m or np.nan) * (1.0 + 2.0 * _block(ship)) / 3.0
    return np.clip(sinkage * waterplane / volume, 0.0, _GROWTH_MAX)


def _squat(speed: Float64, depth_m: float) -> Float64:
    squared = np.minimum(speed**2 / (GRAVITY_M_S2 * depth_m), _FROUDE_MAX**2)
    ratio: Float64 = squared / np.sqrt(1.0 - squared)
    return ratio


def _added_mass_ratio(ship: Ship, depth_m: float) -> float:
    """Return surge added mass over that in deep water; never below 1."""
    breadth, draught = ship.breadth_m or np.nan, ship.draught_m or np.nan
    form = 3.77 + 1.14 * breadth / draught - 0.233 * ship.length_m / draught - 3.43 * _block(ship)
    clearance = max(depth_m / draught - 1.0, _CLEARANCE_MIN)
    return 1.0 + max(form, 0.0) / math.pow(clearance, 1.3)


def _block(ship: Ship) -> float:
    box = ship.length_m * (ship.breadth_m or np.nan) * (ship.draught_m or np.nan)
    return ship.displaced_volume_m3 / box


EFFECT = Effect(
    name='shallow_water',
    scope=Scope.EARTH,
    parameters=(
        Parameter(
            name='depth_m',
            unit='m',
            meaning='depth of the water, from the surface',
            prior=log_normal(2.5, 0.35),
            low=1.2,
            high=100.0,
            measured_in=DRAUGHTS,
        ),
    ),
    size_power=-1.79,
    formula='C_V (1 + 0.57 (T/h)^1.79); all of it times (1 + dV/V)^(2/3), dV from the added '
    'sinkage 1.46 V/L^2 [Fr_h^2 / sqrt(1 - Fr_h^2)] less that at h = 0.3 L, at most 5 %; '
    'n_r grows by [3.77 + 1.14 B/T - 0.233 L/T - 3.43 C_B] / (h/T - 1)^1.3 of itself, if at all',
    source='Raven (2016), ITTC 7.5-04-01-01.1, for T/h below 0.5; added mass: Sheng (1981)',
    formula_sd=0.15,
    act=_act,
    struck_out_by=('depth',),
    confounders={
        'fouling': (Measure.DEPTH, Measure.DEEP_WATER),
        'locked_propeller': (Measure.DEPTH, Measure.DEEP_WATER, Measure.SHAFT),
        'towed_cable': (Measure.DEPTH, Measure.DEEP_WATER, Measure.WITHOUT_CABLE),
    },
    needs=('breadth_m', 'draught_m'),
    facts={'deep_water': DENIES},
)
