# SPDX-License-Identifier: Apache-2.0
"""Surge motion of a ship and the sensors that read it."""

from shipdrag_ros.simulation.noise import GaussMarkov
from shipdrag_ros.simulation.scenario import STOP, EngineOrder, Scenario, Turn
from shipdrag_ros.simulation.sensors import START_NS, Sensor, sense, standard_sensors
from shipdrag_ros.simulation.surge import Truth, simulate

__all__ = [
    'START_NS',
    'STOP',
    'EngineOrder',
    'GaussMarkov',
    'Scenario',
    'Sensor',
    'Truth',
    'Turn',
    'sense',
    'simulate',
    'standard_sensors',
]
