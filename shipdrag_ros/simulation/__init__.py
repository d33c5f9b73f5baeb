# SPDX-License-Identifier: Apache-2.0
"""Surge motion of a ship and the sensors that read it."""

from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.columns import Columns, simulate_columns
from shipdrag_ros.simulation.effect import Effect, Frame, Measure, Scope
from shipdrag_ros.simulation.scenario import STOP, EngineOrder, GaussMarkov, Scenario, Turn
from shipdrag_ros.simulation.sensors import (
    STANDARD_INPUTS,
    STANDARD_SD,
    START_NS,
    Sensor,
    sense,
    standard_sensors,
)
from shipdrag_ros.simulation.surge import Truth, simulate

__all__ = [
    'STANDARD_INPUTS',
    'STANDARD_SD',
    'START_NS',
    'STOP',
    'Action',
    'Columns',
    'Effect',
    'EngineOrder',
    'Frame',
    'GaussMarkov',
    'Measure',
    'Scenario',
    'Scope',
    'Sensor',
    'Truth',
    'Turn',
    'sense',
    'simulate',
    'simulate_columns',
    'standard_sensors',
]
