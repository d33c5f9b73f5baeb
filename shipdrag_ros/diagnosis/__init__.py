# SPDX-License-Identifier: Apache-2.0
"""Which effect is missing where model and data disagree."""

from shipdrag_ros.diagnosis.diagnose import diagnose, with_effects
from shipdrag_ros.diagnosis.legs import SailingRecord
from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Advice,
    Candidate,
    Compared,
    DiagnosisResult,
    EffectEstimate,
    Gap,
    RunTrace,
    Where,
)
from shipdrag_ros.diagnosis.sailing import diagnose_sailing
from shipdrag_ros.diagnosis.speeds import CoastRun
from shipdrag_ros.inference.decision import Verdict

__all__ = [
    'FORCE',
    'LOG_TRACK',
    'Advice',
    'Candidate',
    'CoastRun',
    'Compared',
    'DiagnosisResult',
    'EffectEstimate',
    'Gap',
    'RunTrace',
    'SailingRecord',
    'Verdict',
    'Where',
    'diagnose',
    'diagnose_sailing',
    'with_effects',
]
