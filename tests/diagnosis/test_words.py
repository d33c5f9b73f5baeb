# SPDX-License-Identifier: Apache-2.0
"""Every verdict has a sentence that does not say more than is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.result import Candidate, DiagnosisResult, EffectEstimate, Gap, Where
from shipdrag_ros.diagnosis.words import answers, place, probability, sentence
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Verdict
from shipdrag_ros.parameter import Parameter

FOULING = EffectEstimate('fouling', 0.9995, {'friction_factor': Parameter(0.4013, 0.0121)})
WAVES = EffectEstimate(
    'waves',
    0.95,
    {
        'force_n': Parameter(51234.0, 3000.0),
        'from': Parameter(-1.0, 0.0),
        'wave_length_m': Parameter(80.0, 10.0),
    },
)


def diagnosis(
    verdict: Verdict,
    *candidates: tuple[tuple[str, ...], float],
    nothing: float = 0.0,
    unnamed: float = 0.0,
    effects: tuple[EffectEstimate, ...] = (),
) -> DiagnosisResult:
    return DiagnosisResult(
        verdict=verdict,
        effects=effects,
        candidates=tuple(Candidate(*each) for each in candidates),
        nothing=nothing,
        unnamed=unnamed,
        would_decide=(),
        where=Where('force', (12.0, 900.0), (3.0, 7.5)),
        before=Gap(0.2, None, 20.0),
        after=None,
        held_out_before=None,
        held_out_after=None,
        baseline='stated',
        best=effects,
    )


@pytest.mark.parametrize(
    ('found', 'said'),
    [
        (
            diagnosis(Verdict.NONE, ((), 0.97), nothing=0.97),
            'Model and data agree: nothing is missing that these runs could show (probability '
            '97.0 %).',
        ),
        (
            diagnosis(Verdict.NAMED, (('fouling',), 0.9995), effects=(FOULING,)),
            'Missing in the model: fouling (friction factor 0.401 ± 0.024); probability > 99.9 %.',
        ),
        (
            diagnosis(Verdict.NAMED, (('waves',), 0.95), effects=(WAVES,)),
            'Missing in the model: waves (force (51.2 ± 6.0) kN, from astern, wave length (80 ± '
            '20) m); probability 95.0 %.',
        ),
        (
            diagnosis(Verdict.ONE_OF, (('log_scale',), 0.6), (('radar_scale',), 0.4)),
            'Missing is one of these: log scale (60.0 %), radar scale (40.0 %). These runs cannot '
            'separate them.',
        ),
        (
            diagnosis(
                Verdict.ONE_OF, (UNKNOWN, 0.45), (('waves',), 0.3), (('wind',), 0.25), unnamed=0.45
            ),
            'Missing is one of these: something without a name (45.0 %), waves (30.0 %), wind '
            '(25.0 %). These runs cannot separate them.',
        ),
        (
            diagnosis(
                Verdict.ONE_OF, (NONE, 0.6), (('fouling',), 0.35), (('wind',), 0.05), nothing=0.6
            ),
            'Nothing is missing (60.0 %), or fouling (35.0 %). These runs cannot separate them.',
        ),
        (  # the least probable does not come first
            diagnosis(
                Verdict.ONE_OF, (('fouling',), 0.6), (('wind',), 0.3), (NONE, 0.1), nothing=0.1
            ),
            'Missing is one of these: fouling (60.0 %), wind (30.0 %); or nothing is missing '
            '(10.0 %). These runs cannot separate them.',
        ),
        (
            diagnosis(Verdict.UNKNOWN, (('wind',), 0.1), unnamed=0.9),
            'Something is missing that is none of the known effects, in the force on the ship, 12 '
            'to 900 s after the stop, at 5.8 to 14.6 knots (3.0 to 7.5 m/s) (probability 90.0 %).',
        ),
    ],
)
def test_a_verdict_in_a_sentence(found: DiagnosisResult, said: str) -> None:
    assert sentence(found) == said


def test_answers_add_up() -> None:
    found = diagnosis(Verdict.ONE_OF, (('wind',), 0.6), (('current', 'waves'), 0.3), nothing=0.04)
    told = answers(found)
    assert [each.words for each in told] == [
        'wind',
        'current + waves',
        'nothing is missing',
        'something without a name',
        'all others together',
    ]
    assert sum(each.probability for each in told) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('value', 'said'), [(1.0, '> 99.9 %'), (0.98, '98.0 %'), (0.001, '0.1 %'), (1e-9, '< 0.1 %')]
)
def test_nothing_is_told_to_be_certain(value: float, said: str) -> None:
    assert probability(value) == said


def test_tables_leave_out_what_is_not_there() -> None:
    found = diagnosis(Verdict.NAMED, (('fouling',), 0.9995), effects=(FOULING,))
    assert words.gaps_table(found).rows == (('model as stated', '0.200', '-', '20.00'),)
    (row,) = words.parameters_table(found.effects).rows
    assert row[:4] == ('fouling', 'friction_factor', '0.401', '0.012')
    size, side, _ = words.parameters_table([WAVES]).rows
    assert size[2:4] == ('51200', '3000')
    assert side[2:4] == ('astern', '-')
    assert words.noise_table(found.traces).rows == ()


def test_a_place_before_the_stop_ends_at_zero_and_not_at_minus_zero() -> None:
    found = diagnosis(Verdict.NONE)
    before = replace(found, where=Where('log', (-1786.0, 0.0), (7.2, 7.2)))
    assert '1786 to 0 s before the stop' in place(before)
    assert '12 to 900 s after the stop' in place(found)


def test_without_a_clean_hull_what_is_named_of_it_is_said_to_be_against_a_usual_one() -> None:
    fouled = diagnosis(Verdict.ONE_OF, (('fouling',), 0.5), (('wind',), 0.49))
    said = sentence(replace(fouled, baseline='fitted_here'))
    assert 'named of the hull here is against a usual hull' in said
    other = diagnosis(Verdict.ONE_OF, (('waves',), 0.5), (('wind',), 0.49))
    assert 'a usual hull' not in sentence(replace(other, baseline='fitted_here'))
