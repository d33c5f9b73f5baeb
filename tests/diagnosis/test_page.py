# SPDX-License-Identifier: Apache-2.0
"""The page of a diagnosis says what was found, and stands alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.diagnosis import words as diagnosis_words
from shipdrag_ros.diagnosis.diagnose import waiting
from shipdrag_ros.diagnosis.page import (
    motion_picture,
    probability_picture,
    residual_picture,
    write_diagnosis,
)
from shipdrag_ros.diagnosis.result import (
    Advice,
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    WeighedFact,
)
from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Fact, Ship
from tests.page import Page
from tests.runs import CARGO as SHIP


@pytest.fixture
def words(found: DiagnosisResult) -> DiagnosisResult:
    """Without what takes time to draw."""
    return replace(found, traces=(), estimates=())


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Any]:
    def write(found: DiagnosisResult, ship: Ship | None = SHIP) -> Any:
        write_diagnosis(tmp_path / 'page.html', found, ship)
        return Page(tmp_path / 'page.html')

    return write


def test_the_page_says_all_and_needs_no_network(found, written):
    assert found.verdict is Verdict.NAMED
    page = written(found)
    assert page.links == []
    assert len(page.images) == 8  # probabilities, two curves, the run, what is left
    assert all(image.startswith('data:image/svg+xml;base64,') for image in page.images)
    said = (
        diagnosis_words.sentence(found),
        'What is missing in the model of Vitus Bering',
        '<outward>',  # a name from outside is text
        'along_track_m_s',
        'velocity over ground = velocity through water + current',
        'with current',
        'model tests; friction ± 4 %, wave ± 20 %',
        'learnt from steady sailing before the stop (30 min)',
        'not scored',
        'What she needs today',
        'over the clean hull',
        'effective power',
    )
    for each in said:
        assert each in page.text, each


def test_a_set_says_what_would_decide(words: DiagnosisResult, written: Callable[..., Any]) -> None:
    offset = EffectEstimate('log_offset', 0.395, {'offset_m_s': Parameter(0.4321, 0.02)})
    candidates = (
        Candidate(('current',), 0.6, words.effects),
        Candidate(('log_offset',), 0.395, (offset,)),
    )
    decide = (Advice('a run on the reciprocal heading', 0.93), Advice('a speed log', None))
    page = written(
        replace(
            words, verdict=Verdict.ONE_OF, effects=(), candidates=candidates, would_decide=decide
        )
    )
    assert 'Missing is one of these: current (60.0 %), log offset (39.5 %).' in page.text
    assert 'a run on the reciprocal heading; decides with probability 93.0 %' in page.text
    assert 'Of each candidate, were it the one' in page.text
    assert 'log offset 39.5 % offset_m_s 0.432 0.020' in page.text
    assert 'u + offset' in page.text


def test_what_is_unknown_is_none_of_the_candidates(words, written):
    page = written(replace(words, verdict=Verdict.UNKNOWN, effects=()))
    assert 'Of each candidate, were it the one' in page.text
    assert 'none of the known effects' in page.text


def test_a_fact_that_the_data_contradict_stands_on_the_page(words, written):
    told = (
        WeighedFact(Fact('deep_water'), '', 0.97, ('shallow_water',)),
        WeighedFact(Fact('shaft', 'free'), 'out', 0.01),
    )
    page = written(replace(words, facts=told))
    assert 'The data contradict the fact `deep_water`' in page.text
    assert 'wrong with probability 97.0 %, most probably shallow water' in page.text
    assert 'contradict the fact `shaft' not in page.text
    assert 'shaft=free out after the stop the shaft was free 1.0 %' in page.text


def test_a_record_without_coastdown_has_a_page_without_traces(words, written):
    sailing = replace(words, baseline='none', notes=('compared on 40 legs',))
    page = written(sailing, ship=None)
    assert len(page.images) == 1
    assert 'compared on 40 legs' in page.text
    assert 'no baseline was needed' in page.text
    assert 's of the record' in page.text
    assert 'not scored' in page.text
    fitted = written(replace(sailing, baseline='fitted_here'))
    assert 'the runs are compared with all hulls of her length and volume' in fitted.text


def test_while_the_verdict_waits_the_page_asks_and_gives_no_figure(found, written):
    asks = waiting(found, 'is the unit of one of them wrong?')
    text = written(asks).text
    assert 'is the unit of one of them wrong?' in text
    assert 'over the clean hull' not in text
    assert 'Model and data disagree' not in text


def test_pictures_show_what_they_are_given(found: DiagnosisResult) -> None:
    (trace,) = found.traces
    log, position, _ = trace.compared
    as_drawn = {'after': 'with current', 'mass_kg': SHIP.mass_kg}
    drawn = [motion_picture(each, **as_drawn) for each in (log, position)]
    assert [len(figure.axes) for figure in drawn] == [2, 2]
    speed, place = (
        {line.get_label(): np.asarray(line.get_ydata()) for line in figure.axes[0].get_lines()}
        for figure in drawn
    )
    assert drawn[0].axes[0].get_ylabel() == '[knots]'
    shown = log.time_s >= -300.0
    np.testing.assert_array_equal(speed['measured'], log.measured[shown] / M_S_PER_KNOT)
    np.testing.assert_array_equal(speed['model as stated'], log.before[shown] / M_S_PER_KNOT)
    np.testing.assert_array_equal(speed['with current'], log.after[shown] / M_S_PER_KNOT)
    # distances count from the stop, and the model as stated falls behind
    near = position.time_s >= -300.0
    assert abs(np.interp(0.0, position.time_s[near], place['measured'])) < 20.0
    assert place['measured'][-1] - place['model as stated'][-1] > 1000.0

    left = residual_picture([position], **as_drawn)
    by_time = {line.get_label(): np.asarray(line.get_ydata()) for line in left.axes[0].get_lines()}
    np.testing.assert_array_equal(by_time['model as stated'], position.white_before)
    np.testing.assert_array_equal(by_time['with current'], position.white_after)
    assert len(left.axes[1].get_lines()[0].get_ydata()) == (position.time_s >= 0.0).sum()
    assert left.axes[1].get_xlabel() == 'speed through water [knots]'

    bars = probability_picture(diagnosis_words.answers(found)).axes[0]
    widths = [bar.get_width() for bar in bars.patches]
    assert widths[0] == max(widths) == found.candidates[0].probability
    assert sum(widths) <= 1.0 + 1e-9
