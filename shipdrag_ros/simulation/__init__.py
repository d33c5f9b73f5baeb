# SPDX-License-Identifier: Apache-2.0
"""Surge motion of a ship and the sensors that read it."""

from shipdrag_ros.simulation.columns import Columns as Columns
from shipdrag_ros.simulation.columns import simulate_columns as simulate_columns
from shipdrag_ros.simulation.effect import Action as Action
from shipdrag_ros.simulation.effect import Effect as Effect
from shipdrag_ros.simulation.effect import Frame as Frame
from shipdrag_ros.simulation.effect import Scope as Scope
from shipdrag_ros.simulation.scenario import STOP as STOP
from shipdrag_ros.simulation.scenario import EngineOrder as EngineOrder
from shipdrag_ros.simulation.scenario import GaussMarkov as GaussMarkov
from shipdrag_ros.simulation.scenario import Scenario as Scenario
from shipdrag_ros.simulation.scenario import Turn as Turn
from shipdrag_ros.simulation.sensors import STANDARD_INPUTS as STANDARD_INPUTS
from shipdrag_ros.simulation.sensors import STANDARD_SD as STANDARD_SD
from shipdrag_ros.simulation.sensors import START_NS as START_NS
from shipdrag_ros.simulation.sensors import Sensor as Sensor
from shipdrag_ros.simulation.sensors import sense as sense
from shipdrag_ros.simulation.sensors import standard_sensors as standard_sensors
from shipdrag_ros.simulation.surge import Truth as Truth
from shipdrag_ros.simulation.surge import simulate as simulate
