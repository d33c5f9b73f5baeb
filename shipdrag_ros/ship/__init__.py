# SPDX-License-Identifier: Apache-2.0
"""The ship file: particulars, added mass, baseline resistance."""

from shipdrag_ros.ship.baseline import Baseline, CoefficientBaseline, CoefficientSd, TableBaseline
from shipdrag_ros.ship.facts import Fact, parse_fact
from shipdrag_ros.ship.model import AIR_DENSITY_KG_M3, Ship
from shipdrag_ros.ship.run_sheet import RunSheet
from shipdrag_ros.ship.sections import (
    GRAVITY_M_S2,
    AddedMass,
    Air,
    ConstantAddedMass,
    MerchantAddedMass,
    Propeller,
    Propulsion,
    StatedEffect,
    TableAddedMass,
    Water,
)
from shipdrag_ros.ship.term import LearntTerm

__all__ = [
    'AIR_DENSITY_KG_M3',
    'GRAVITY_M_S2',
    'AddedMass',
    'Air',
    'Baseline',
    'CoefficientBaseline',
    'CoefficientSd',
    'ConstantAddedMass',
    'Fact',
    'LearntTerm',
    'MerchantAddedMass',
    'Propeller',
    'Propulsion',
    'RunSheet',
    'Ship',
    'StatedEffect',
    'TableAddedMass',
    'TableBaseline',
    'Water',
    'parse_fact',
]
