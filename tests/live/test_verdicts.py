# SPDX-License-Identifier: Apache-2.0
"""A set of candidates is shown with the size that each would have, and without options."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
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


def test_a_coastdown_that_something_braked_says_that_its_glide_goes_on() -> None:
    pytest.importorskip('diagnostic_msgs')
    from shipdrag_ros.node.diagnosing import DiagnosisState, DiagnosisStatus
    from shipdrag_ros.node.diagnostics import OK, WARN, diagnosis_status

    nothing = replace(FOUND, verdict=Verdict.NONE, nothing=1.0, candidates=(Candidate((), 1.0),))
    ended = EndedCoastdown(0, 10**12, 1, EndedBy.SPEED, None)
    sound = DiagnosisStatus(DiagnosisState.DONE, coastdown=ended, found=nothing)
    braked = replace(sound, coastdown=replace(ended, ended_by=EndedBy.BRAKE))
    assert diagnosis_status(sound).level == OK
    assert sound.caveat == ''
    shown = diagnosis_status(braked)
    assert shown.level == WARN
    for text in (shown.message, of_diagnosis(nothing, braked.caveat).sentence):
        assert 'nothing is missing' in text
        assert '`shipdrag diagnose BAG` of the recording holds all of the glide' in text
    failed = replace(braked, state=DiagnosisState.IMPOSSIBLE, found=None, reason='no estimate')
    assert 'no instrument shows what' in diagnosis_status(failed).message
