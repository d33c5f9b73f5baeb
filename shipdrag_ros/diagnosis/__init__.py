# SPDX-License-Identifier: Apache-2.0
"""Which effect is missing where model and data disagree."""

from shipdrag_ros.diagnosis.diagnose import diagnose, with_effects
from shipdrag_ros.diagnosis.legs import SailingRecord
from shipdrag_ros.diagnosis.observation import CoastRun
from shipdrag_ros.diagnosis.sailing import diagnose_sailing

__all__ = ['CoastRun', 'SailingRecord', 'diagnose', 'diagnose_sailing', 'with_effects']
