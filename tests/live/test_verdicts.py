# SPDX-License-Identifier: Apache-2.0
"""A set of candidates is shown with the size that each would have, and without options."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.diagnosis.document import document
from shipdrag_ros.diagnosis.result import Advice, Candidate, DiagnosisResult, EffectEstimate, Gap
from shipdrag_ros.display import json_text
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.live.bridge import Bridge, verdict_part
from shipdrag_ros.messages.topics import (
    AHEAD,
    OK,
    WARN,
    Health,
    NodeMessage,
    Status,
    diagnosis_message,
)
from shipdrag_ros.node.background import DiagnosisState, DiagnosisStatus
from shipdrag_ros.node.health import diagnosis_status
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


def heard(text: str) -> NodeMessage:
    """Return JSON as the topic brings it."""
    return NodeMessage('diagnosis', diagnosis_message(text, 0).payload)


def told(state: str, sentence: str, monitor: str = 'steady', **more: str) -> Health:
    states = {'lifecycle': 'active', 'monitor': monitor}
    if monitor == 'coastdown':
        states['coastdown since [ns]'] = '5000000000'
    return Health(
        (
            Status.of('state', 0, monitor, states),
            Status.of('diagnosis', 1, sentence, {'state': state, **more}),
        )
    )


def test_a_set_has_the_size_that_each_would_have_and_no_options() -> None:
    part = verdict_part(document(FOUND, None))
    assert part['sizes'] == [
        'if fouling, friction factor: 0.400 ± 0.040',
        'if towed cable, drag area: (2.50 ± 0.80) m^2',
    ]
    assert part['probabilities'] == [['fouling', 0.6], ['towed_cable', 0.4]]
    (line,) = part['decide']
    assert line.startswith('look whether a cable was out; costs a look')


def bare(state: str, sentence: str) -> dict[str, Any]:
    """Return the part without a document."""
    rest: dict[str, Any] = {'sizes': [], 'probabilities': [], 'decide': [], 'ahead': ''}
    return {'state': state, 'sentence': sentence, **rest}


def test_the_page_shows_the_document_of_the_topic_once_the_node_is_done() -> None:
    bridge = Bridge()
    bridge.hear(heard(json_text(document(FOUND, None))), 0.0)
    bridge.hear(told('running', 'running'), 0.0)
    assert bridge.parts(0.0)['verdict'] == bare('running', 'running')
    bridge.hear(told('impossible', 'impossible: Fouling cannot be judged: no baseline'), 0.0)
    none = bare('impossible', 'Fouling cannot be judged: no baseline')
    assert bridge.parts(0.0)['verdict'] == none  # the page begins: "No diagnosis: "
    bridge.hear(told('done', 'Missing is one of these'), 0.0)
    assert bridge.parts(0.0)['verdict'] == {**verdict_part(document(FOUND, None)), 'ahead': ''}


def test_before_the_stop_the_page_says_what_a_coastdown_would_show() -> None:
    bridge = Bridge()
    would = 'A coastdown from 8.2 m/s, 20 min long, would name current from 0.1 m/s.'
    for state in ('none yet', 'done'):
        bridge.hear(told(state, state, **{AHEAD: would}), 0.0)
        assert bridge.parts(0.0)['verdict']['ahead'] == would
    bridge.hear(told('done', 'done', 'coastdown', **{AHEAD: would}), 0.0)
    assert bridge.parts(0.0)['verdict']['ahead'] == ''


@pytest.mark.parametrize(
    'text', ['', '[]', '{}', 'null', '{"effects": 1}', '[' * 100_000, '{"effects": [1]}']
)
def test_a_document_of_somebody_else_changes_nothing(text: str) -> None:
    bridge = Bridge()
    bridge.hear(told('done', 'Missing: fouling.'), 0.0)
    bridge.hear(heard(text), 0.0)
    assert bridge.parts(0.0)['verdict'] == bare('done', 'Missing: fouling.')


def test_a_coastdown_that_something_braked_says_that_its_glide_goes_on() -> None:
    nothing = replace(FOUND, verdict=Verdict.NONE, nothing=1.0, candidates=(Candidate((), 1.0),))
    ended = EndedCoastdown(0, 10**12, 1, EndedBy.SPEED, None)
    found = document(nothing, None)
    sound = DiagnosisStatus(DiagnosisState.DONE, coastdown=ended, found=found)
    braked = replace(sound, coastdown=replace(ended, ended_by=EndedBy.BRAKE))
    assert diagnosis_status(sound).level == OK
    assert sound.caveat == ''
    shown = diagnosis_status(braked)
    assert shown.level == WARN
    for text in (shown.message, verdict_part({**found, 'caveat': braked.caveat})['sentence']):
        assert 'nothing is missing' in text
        assert '`shipdrag diagnose BAG` of the recording holds all of the glide' in text
    failed = replace(braked, state=DiagnosisState.IMPOSSIBLE, found=None, reason='no estimate')
    assert 'no instrument shows what' in diagnosis_status(failed).message
