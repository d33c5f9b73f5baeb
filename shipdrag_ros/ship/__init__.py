# SPDX-License-Identifier: Apache-2.0
"""The ship file: particulars, added mass, baseline resistance."""

from shipdrag_ros.ship.facts import Fact as Fact
from shipdrag_ros.ship.facts import parse_fact as parse_fact
from shipdrag_ros.ship.model import AIR_DENSITY_KG_M3 as AIR_DENSITY_KG_M3
from shipdrag_ros.ship.model import SHIP_FILE as SHIP_FILE
from shipdrag_ros.ship.model import RunSheet as RunSheet
from shipdrag_ros.ship.model import Ship as Ship
from shipdrag_ros.ship.sections import GRAVITY_M_S2 as GRAVITY_M_S2
from shipdrag_ros.ship.sections import AddedMass as AddedMass
from shipdrag_ros.ship.sections import Air as Air
from shipdrag_ros.ship.sections import Baseline as Baseline
from shipdrag_ros.ship.sections import CoefficientBaseline as CoefficientBaseline
from shipdrag_ros.ship.sections import CoefficientSd as CoefficientSd
from shipdrag_ros.ship.sections import ConstantAddedMass as ConstantAddedMass
from shipdrag_ros.ship.sections import MerchantAddedMass as MerchantAddedMass
from shipdrag_ros.ship.sections import Propeller as Propeller
from shipdrag_ros.ship.sections import Propulsion as Propulsion
from shipdrag_ros.ship.sections import StatedEffect as StatedEffect
from shipdrag_ros.ship.sections import TableAddedMass as TableAddedMass
from shipdrag_ros.ship.sections import TableBaseline as TableBaseline
from shipdrag_ros.ship.sections import Water as Water
from shipdrag_ros.ship.term import LearntTerm as LearntTerm
