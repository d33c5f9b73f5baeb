# SPDX-License-Identifier: Apache-2.0
"""A set of candidates is shown with the size that each would have, and without options."""

from __future__ import annotations

import pytest

from shipdrag_ros.diagnosis import Candidate, DiagnosisResult, EffectEstimate, Gap, Verdict
from shipdrag_ros.diagnosis.result import Advice
from shipdrag_ros.live.verdicts import of_diagnosis, of_status
from shipdrag_ros.messages.heard import Status
from shipdrag_ros.parameter import Parameter

FOULING = EffectEstimate('fouling', 0.6, {'friction_factor': Parameter(0.4, 0.02)})
CABLE = EffectEstimate('towed_cable', 0.4, {'drag_area_m2': Parameter(2.5, 0.4)})
FOUND = DiagnosisResult(
    verdict=Verdict.ONE_OF,
    effects=(),
    candidates=(
        Candidate(('fouling',), 0.6, (FOULING,)),
        Candidate(('towed_cable',), 0.4, (CABLE,)),
    ),
    nothing=0.0,
    unnamed=0.0,
    would_decide=(Advice('look whether a cable was out (--fact no_towed_cable)', 0.4, 'a look'),),
    where=None,
    before=Gap(0.2, None, 20.0),
    after=None,
    held_out_before=None,
    held_out_after=None,
    baseline='stated',
    best=(FOULING,),
)


def test_of_a_bag() -> None:
    view = of_diagnosis(FOUND)
    assert view.sizes == (
        ('if fouling, friction factor', '0.400 ± 0.040'),
        ('if towed cable, drag area', '(2.50 ± 0.80) m^2'),
    )
    (line,) = view.decide
    assert line.startswith('look whether a cable was out; costs a look')


def test_of_a_node() -> None:
    pytest.importorskip('diagnostic_msgs')
    from shipdrag_ros.node.diagnosing import DiagnosisState, DiagnosisStatus
    from shipdrag_ros.node.diagnostics import diagnosis_status

    told = diagnosis_status(DiagnosisStatus(DiagnosisState.DONE, found=FOUND))
    values = {each.key: each.value for each in told.values}
    view = of_status(Status('node', 'diagnosis', 1, told.message, values))
    assert view.sizes == (
        ('if fouling, friction factor', '0.4 ± 0.04'),
        ('if towed cable, drag area m2', '2.5 ± 0.8 m^2'),
    )
    assert view.decide == of_diagnosis(FOUND).decide
