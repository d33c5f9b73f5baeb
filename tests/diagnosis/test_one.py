# SPDX-License-Identifier: Apache-2.0
"""The one posterior names what is hidden, with sizes and limits, and knows what is stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose, verdict, words
from shipdrag_ros.diagnosis import tables as diagnosis_cells
from shipdrag_ros.diagnosis.diagnose import compare
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.inference.decision import NONE, Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import LIBRARY
from tests.runs import CARGO as SHIP
from tests.runs import coasted

COAST_S = 1200


def run_of(*effects: str, heading_rad: float = 0.7, seed: int = 5) -> CoastRun:
    return coasted(*effects, heading_rad=heading_rad, reference_rad=0.7, seed=seed)


@cache
def answer(*effects: str, ship: Ship = SHIP) -> DiagnosisResult:
    """Diagnose one run, once."""
    return diagnose([run_of(*effects)], ship, Parameters())


@pytest.mark.parametrize(
    ('text', 'parameter', 'size'),
    [
        ('log_lag=25', 'lag_s', 25.0),
        # at the best of nothing, the filter of the log stands for it
        ('time_offset=30', 'offset_s', 30.0),
    ],
)
def test_what_is_hidden_is_named_with_its_size(text: str, parameter: str, size: float) -> None:
    found = answer(text)
    name = text.partition('=')[0]
    assert [effect.name for effect in found.effects] == [name]
    known = found.effects[0].parameters[parameter]
    assert abs(known.value - size) < 4.0 * known.sd
    assert found.after is not None
    assert found.after.chi2_per_sample < found.before.chi2_per_sample


def test_without_anything_hidden_nothing_is_most_probable() -> None:
    found = answer()
    assert found.effects == ()
    assert found.candidates[0].names == NONE
    assert found.nothing > 0.75
    assert sum(each.probability for each in found.candidates) <= 1.0 + 1e-9
    # sizes that this run would have shown are excluded, and it says which
    for name in ('log_scale', 'current', 'wind', 'fouling'):
        limit = found.limits[name]
        assert 0.0 < limit.value < np.inf
    assert found.limits['log_scale'].value < 0.08  # half of what is usual where it is there
    # rough or with a propeller that stands: no size of the first is that of it alone
    assert found.limits['fouling'].would_be_named is None
    # of 8 records with it 8 name 0.38, and one with 0.3 does not
    assert 0.3 < (found.limits['locked_propeller'].would_be_named or np.inf) < 0.75
    assert found.limits['turning'].would_be_named == 0.0  # the heading shows that she turns
    assert 'turning of any size' in words.sentence(replace(found, verdict=Verdict.NONE))
    assert 'any size' in {row[3] for row in diagnosis_cells.limits(found).rows}


@pytest.mark.parametrize(
    ('text', 'name'), [('fouling=0.5', 'fouling'), ('fouling=2', 'locked_propeller')]
)
def test_a_size_that_is_not_named_by_its_limit_is_not_named_in_a_record(text, name):
    found = answer(text)
    assert found.candidates[0].names == (name,)
    assert 'fouling' not in [effect.name for effect in found.effects]


@pytest.mark.parametrize('text', ['log_lag=9', 'time_offset=10', 'wind=10'])
def test_what_a_rival_may_stand_for_is_not_promised_a_name(text: str) -> None:
    # the filter of the log, a lag for an offset in time, waves for wind
    name, _, size = text.partition('=')
    assert name not in [effect.name for effect in answer(text).effects]
    assert (answer().limits[name].would_be_named or np.inf) > float(size)


def test_of_many_effects_the_likeliest_have_a_size_that_is_named(monkeypatch) -> None:
    monkeypatch.setattr(verdict, '_RIVALS', 2)
    limits = diagnose([run_of()], SHIP, Parameters()).limits
    assert sum(each.would_be_named is not None for each in limits.values()) <= 2
    assert len(limits) > 10


def test_a_limit_grows_where_the_run_shows_less() -> None:
    whole = answer().limits['wind'].value
    window = run_of().window
    end = window.start_ns + (COAST_S // 4) * 10**9
    short = replace(
        window,
        **{
            name: replace(
                series, **{k: getattr(series, k)[series.time_ns < end] for k in vars(series)}
            )
            for name in ('speed_through_water', 'position', 'speed_over_ground')
            if len((series := getattr(window, name)).time_ns)
        },
    )
    found = diagnose([CoastRun('short', short)], SHIP, Parameters())
    assert found.limits['wind'].value > 1.1 * whole


def test_two_look_alikes_are_a_set_that_holds_the_truth() -> None:
    found = answer('wind=14')
    assert found.candidates[0].names == ('wind',)
    assert {each.names for each in found.held} <= {('wind',), ('waves',)}


def test_two_runs_share_what_belongs_to_both() -> None:
    runs = [run_of('current=0.3'), run_of('current=0.3', heading_rad=0.7 + np.pi, seed=6)]
    found = diagnose(runs, SHIP, Parameters())
    assert [effect.name for effect in found.effects] == ['current']
    alone = diagnose(runs[:1], SHIP, Parameters())
    both = found.effects[0].parameters['along_track_m_s']
    one = next(e for c in alone.candidates for e in c.effects if e.name == 'current')
    assert both.sd < one.parameters['along_track_m_s'].sd
    assert abs(both.value - 0.3) < 3.0 * both.sd


def test_the_answer_is_the_same_to_the_bit() -> None:
    one, other = answer('wind=14'), answer.__wrapped__('wind=14')
    assert one.candidates == other.candidates
    assert one.limits == other.limits


def test_probabilities_are_those_of_evidence_and_odds() -> None:
    seen = Observation.of(run_of('wind=14').window, SHIP, Parameters(), name='run')
    found = compare((seen,), SHIP, Facts(SHIP)).compare()
    assert sum(found.probability.values()) == pytest.approx(1.0)
    names = {each.names for each in found.fitted}
    assert {(name,) for name, effect in LIBRARY.items() if not effect.missing(SHIP)} <= names
