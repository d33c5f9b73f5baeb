# SPDX-License-Identifier: Apache-2.0
"""What a log book and earlier diagnoses say counts, and errs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose, words
from shipdrag_ros.diagnosis.document import (
    EarlierCandidate,
    EarlierDiagnosis,
    document,
    read_earlier,
)
from shipdrag_ros.diagnosis.known import Carried, Facts, StatedFact, carried, stated_facts
from shipdrag_ros.diagnosis.result import Candidate, DiagnosisResult, SeenRun
from shipdrag_ros.display import json_text
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.decision import UNKNOWN
from shipdrag_ros.parameter import Parameter, Prior
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Fact, Propeller, Ship, StatedEffect
from shipdrag_ros.simulation import START_NS
from shipdrag_ros.simulation.effect import Scope
from shipdrag_ros.simulation.effects import LIBRARY, effects_of, find
from tests.runs import CARGO as SHIP
from tests.runs import coasted

YEAR_NS = round(365.25 * 86400.0 * 1e9)
CABLE, RUDDER = Fact('no_towed_cable'), Fact('helm_amidships')


def hypothesis(*names: str, only_run: int | None = None) -> Explanation:
    ways = (next(ways_of(find(name), SHIP, 1000.0, 1)) for name in names)
    return Explanation(tuple(replace(way, run=only_run) for way in ways))


def chance(fact: Fact, found: Explanation, *, ship: Ship = SHIP, run: int | None = None) -> float:
    stated = StatedFact(fact, run, YEAR_NS)
    return math.exp(Facts(ship, (stated,)).log_likelihood(found))


def test_a_fact_is_seldom_told_where_it_is_not_so() -> None:
    assert chance(CABLE, hypothesis()) == pytest.approx(0.98)
    assert chance(CABLE, hypothesis('fouling')) == pytest.approx(0.98)
    assert chance(CABLE, hypothesis('towed_cable')) == pytest.approx(0.02)
    assert chance(CABLE, hypothesis('fouling', 'towed_cable')) == pytest.approx(0.02)
    assert chance(replace(CABLE, rate=0.1), hypothesis('towed_cable')) == pytest.approx(0.1)


def test_a_fact_of_one_run_says_nothing_of_another() -> None:
    turned = hypothesis('turning', only_run=1)
    assert chance(RUDDER, turned, run=0) == pytest.approx(0.98)
    assert chance(RUDDER, turned, run=1) == pytest.approx(0.02)
    assert chance(RUDDER, turned) == pytest.approx(0.02)


def test_the_shaft_is_expected_as_the_baseline_or_the_effect_has_it() -> None:
    assert SHIP.propeller is not None
    locked = replace(SHIP, propeller=replace(SHIP.propeller, state_in_baseline='locked'))
    fact = Fact('shaft', 'locked')
    assert chance(fact, hypothesis('locked_propeller')) == pytest.approx(0.98)
    assert chance(fact, hypothesis()) == pytest.approx(0.01)
    assert chance(fact, hypothesis(), ship=locked) == pytest.approx(0.98)
    assert chance(fact, hypothesis('residual_thrust'), ship=locked) == pytest.approx(0.01)
    # one that folds may stand or turn
    folding = replace(SHIP, propeller=Propeller(diameter_m=5.0, state_in_baseline='none'))
    every = [chance(Fact('shaft', v), hypothesis(), ship=folding) for v in ('locked', 'free')]
    assert every[0] == every[1] == pytest.approx(1.0 / 3.0)


def test_a_hull_cleaned_long_ago_may_be_fouled_again() -> None:
    def at(date: str) -> float:
        return chance(Fact('hull_cleaned', date), hypothesis('fouling'))

    # the run is of 1 January 1971, 6 h
    assert at('1970-12-01') == pytest.approx(0.02, abs=0.005)
    assert 0.02 < at('1970-01-01') < 0.5
    assert at('1971-02-01') == pytest.approx(0.98)
    assert chance(Fact('hull_cleaned', '1970-12-01'), hypothesis()) == pytest.approx(0.98)


def test_a_run_overrides_the_ship_file_and_the_diagnosis_both() -> None:
    ship = replace(SHIP, facts=(CABLE, Fact('shaft', 'free')))
    runs = [((Fact('shaft', 'locked'), RUDDER), 1), ((), 2)]
    found = stated_facts(ship, runs, [replace(RUDDER, rate=0.1)]).stated
    assert {(str(each.fact), each.run) for each in found} == {
        ('helm_amidships,rate=0.1', None),
        ('no_towed_cable', None),
        ('shaft=locked', 0),
        ('shaft=free', 1),
    }


def test_a_fact_that_the_data_contradict_is_said() -> None:
    run = coasted('shallow_water=12', rate_hz=0.5, seed=3)
    inputs = ('speed_through_water', 'position', 'depth')
    depth = coasted('shallow_water=12', rate_hz=0.5, inputs=inputs, seed=3)
    found = diagnose([depth], SHIP, Parameters(), facts=[Fact('deep_water'), CABLE])
    (deep, cable) = found.facts
    assert deep.contradicted
    assert deep.wrong is not None
    assert deep.wrong > 0.9
    assert deep.against == ('shallow_water',)
    assert not cable.contradicted
    # without an echo sounder the fact is believed
    assert (
        not diagnose([run], SHIP, Parameters(), facts=[Fact('deep_water')]).facts[0].contradicted
    )


DAY_NS = 86400 * 10**9
NOW_NS = START_NS + 1000 * DAY_NS
RUNS = (SeenRun('now', NOW_NS),)
NO_SD = Parameter(0.35, math.nan)
SIZES = {
    'fouling': {'friction_factor': Parameter(0.35, 0.04)},
    'log_scale': {'factor': Parameter(-0.1, 0.01)},
    'towed_cable': {'drag_area_m2': Parameter(3.0, 0.4)},
    'current': {'along_track_m_s': Parameter(0.4, 0.05), 'cross_track_m_s': Parameter(0.0, 0.1)},
}


def earlier(days: float = 10.0, **candidates: float) -> EarlierDiagnosis:
    """Find some candidates, so many days before; two underscores join a pair."""
    found = [
        EarlierCandidate(p, {each: SIZES[each] for each in names.split('__') if each in SIZES})
        for names, p in candidates.items()
    ]
    run = SeenRun('then', NOW_NS - round(days * DAY_NS))
    return EarlierDiagnosis(
        'then.json', SHIP.name, SHIP.length_m, (run,), (), tuple(found), of_force=True
    )


def known(
    *given: EarlierDiagnosis,
    ship: Ship = SHIP,
    facts: tuple[Fact, ...] = (),
    unread: tuple[str, ...] = (),
) -> Carried:
    told = Facts(ship, tuple(StatedFact(fact, None, NOW_NS) for fact in facts))
    found = carried(given, ship, RUNS, told, effects_of(ship).keys() - set(unread))
    assert found is not None
    return found


def weight(found: Carried, *names: str, kept: tuple[str, ...] = ()) -> float:
    """Return by how much a hypothesis is likelier."""
    ways = (next(ways_of(find(name), SHIP, 1000.0, 1)) for name in names)
    hypothesis = Explanation(tuple(replace(way, kept=way.effect.name in kept) for way in ways))
    return math.exp(found.log_weight(hypothesis))


def sizes(found: Carried, name: str) -> list[Prior]:
    """Return priors of an effect that is as it was; none where no diagnosis held it."""
    return [q.prior for way in found.ways([find(name)]) for q in way.unknowns]


def nothing() -> ComparedHypotheses[Fitted]:
    """Compare nothing with nothing."""
    alone = Fitted(Explanation(), np.zeros(0), log_evidence=0.0)
    return ComparedHypotheses((), (alone,))


def test_an_effect_declares_that_it_lasts_where_it_is_of_hull_or_instruments() -> None:
    for effect in LIBRARY.values():
        assert (effect.lasts_s > 0.0) == (effect.scope in (Scope.HULL, Scope.SENSOR))


def test_what_was_found_is_likelier_the_less_time_has_passed() -> None:
    def of(days: float) -> float:
        return weight(known(earlier(days, fouling=0.99)), 'fouling', kept=('fouling',))

    assert of(1.0) > of(100.0) > of(1000.0)
    assert of(1.0) > 10.0
    assert of(10000.0) < 1e-8
    long_ago = known(earlier(10000.0, fouling=0.99))
    assert weight(long_ago, 'fouling') == pytest.approx(1.0, abs=1e-3)


def test_never_sure_that_it_is_there_and_never_that_it_is_not() -> None:
    sure = known(earlier(0.001, fouling=1.0))
    assert 0.005 < weight(sure) < 0.05
    assert 0.005 < weight(sure, 'log_scale') < 0.05
    nothing = known(earlier(0.001, none=1.0))
    assert 0.4 < weight(nothing, 'fouling') < 0.6
    assert 1.0 < weight(nothing) < 1.3


def test_water_and_weather_of_another_day_say_nothing() -> None:
    found = known(earlier(1.0, current=0.99))
    assert weight(found, 'current') == pytest.approx(weight(found))
    assert sizes(found, 'current') == []
    (told,) = found.judged(nothing())
    assert told.effects == ()
    assert told.unused[0].startswith('current: water, weather')


def test_weights_are_one_on_the_average_over_what_may_be() -> None:
    some = ('fouling', 'log_scale', 'towed_cable')
    # what the ship file states is not missing: of the others nothing is said
    others = tuple(StatedEffect(name, {}) for name in LIBRARY if name not in some)
    given = earlier(2.0, fouling=0.5, towed_cable=0.3, fouling__log_scale=0.1, none=0.08)
    found = known(given, ship=replace(SHIP, effects=others))
    total = 0.0
    for there in subsets(some):
        odds = [find(name).odds for name in there]
        prior = math.prod(odds) / math.prod(1.0 + find(name).odds for name in some)
        total += prior * sum(weight(found, *there, kept=kept) for kept in subsets(there))
    assert total == pytest.approx(1.0)


def subsets(names: tuple[str, ...]) -> list[tuple[str, ...]]:
    return [each for n in range(len(names) + 1) for each in combinations(names, n)]


def test_a_size_that_stays_is_known_less_well_the_more_time_has_passed() -> None:
    (soon,) = sizes(known(earlier(1.0, fouling=0.9)), 'fouling')
    (late,) = sizes(known(earlier(300.0, fouling=0.9)), 'fouling')
    assert soon.first == late.first == pytest.approx(0.35)
    assert 0.1 < soon.second < 0.25 < late.second
    (scale,) = sizes(known(earlier(1.0, log_scale=0.9)), 'log_scale')
    assert (scale.first, scale.second) == pytest.approx((-0.1, 0.0174), abs=1e-3)
    # a size whose sd could not be found may be anything
    unknown = replace(
        earlier(1.0), candidates=(EarlierCandidate(0.9, {'fouling': {'friction_factor': NO_SD}}),)
    )
    assert sizes(known(unknown), 'fouling')[0].second > 0.8


@pytest.mark.parametrize('size', [Parameter(1e-200, 1e12), Parameter(5e-324, 1.0)])
def test_a_size_far_less_well_known_than_it_is_large_may_be_anything(size: Parameter) -> None:
    given = replace(
        earlier(1.0), candidates=(EarlierCandidate(0.9, {'fouling': {'friction_factor': size}}),)
    )
    assert sizes(known(given), 'fouling')[0].second == 1.0


def test_a_hull_cleaned_in_between_is_no_longer_fouled() -> None:
    day = '2029-02-22'  # three days before the runs
    cleaned = Fact('hull_cleaned', day)
    assert 0 < NOW_NS - (cleaned.time_ns or 0) < 10 * DAY_NS
    before = weight(known(earlier(fouling=0.99)), 'fouling', kept=('fouling',))
    after = weight(known(earlier(fouling=0.99), facts=(cleaned,)), 'fouling', kept=('fouling',))
    assert after == pytest.approx(0.02 * before, rel=0.01)
    long_before = Fact('hull_cleaned', '2028-01-01')
    same = known(earlier(fouling=0.99), facts=(long_before,))
    assert weight(same, 'fouling', kept=('fouling',)) == before


def test_of_the_hull_the_latest_diagnosis_counts_alone() -> None:
    old, new = earlier(20.0, fouling=0.9, log_scale=0.05), earlier(10.0, fouling=0.8)
    found = known(replace(old, name='old.json'), new)
    assert [each.diagnosis.name for each in found.weighed] == ['then.json', 'old.json']
    assert 'fouling' not in found.weighed[1].stays
    assert found.judged(nothing())[1].unused[0].endswith('and then.json is later')
    # one without a baseline speaks of the instruments alone
    sailing = replace(earlier(5.0, log_scale=0.9), of_force=False)
    assert 'fouling' in known(sailing, replace(old, name='old.json')).weighed[1].stays


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'ship': 'Another'}, "it is of the ship 'Another'"),
        ({'length_m': 100.0}, 'these runs are of'),
        ({'runs': (SeenRun('later', NOW_NS + DAY_NS),)}, 'is later than the first one'),
        ({'runs': (SeenRun('now again', NOW_NS + 10**9),)}, 'counts here already'),
        ({'before': (SeenRun('now again', NOW_NS),)}, 'counts here already'),
    ],
)
def test_what_cannot_count_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(DiagnosisError, match=said):
        known(replace(earlier(fouling=0.9), **changes))  # type: ignore[arg-type]


def test_a_run_that_two_diagnoses_hold_is_refused() -> None:
    one = earlier(10.0, fouling=0.9)
    chained = replace(earlier(5.0, fouling=0.9), name='chained.json', before=one.runs)
    with pytest.raises(DiagnosisError, match='counts in chained'):
        known(one, chained)


@pytest.fixture(scope='module')
def fouled() -> CoastRun:
    return coasted('fouling=0.35', coast_s=1000.0, rate_hz=0.5, seed=3, start_ns=NOW_NS)


def diagnosed(run: CoastRun, *given: EarlierDiagnosis) -> DiagnosisResult:
    return diagnose([run], SHIP, Parameters(), earlier=given, advise=False)


@pytest.fixture(scope='module')
def alone(fouled: CoastRun) -> DiagnosisResult:
    return diagnosed(fouled)


def test_an_earlier_diagnosis_names_what_one_run_leaves_open(fouled, alone):
    told = diagnosed(fouled, earlier(fouling=0.98))
    assert alone.verdict == 'one_of'
    assert alone.earlier == ()
    assert [effect.name for effect in told.effects] == ['fouling']
    (size,) = told.effects[0].parameters.values()
    assert abs(size.value - 0.35) < 3.0 * size.sd
    (counted,) = told.earlier
    assert not counted.effects[0].contradicted
    said = ' '.join(words.earlier(told))
    assert 'The earlier diagnosis then.json (2029-02-15' in said
    assert 'fouling' in said
    assert set(words.earlier(told)) <= set(words.summary(told))
    # what it found counts for the next one, with the runs that it holds
    passed_on = EarlierDiagnosis.of(told, SHIP, name='now')
    assert passed_on.before == earlier().runs
    assert passed_on.probability('fouling') == pytest.approx(told.effects[0].probability, abs=0.01)
    assert passed_on.last_ns == pytest.approx(NOW_NS + 1200 * 10**9, abs=20 * 10**9)


def test_an_earlier_diagnosis_that_the_runs_contradict_is_said(fouled, alone):
    told = diagnosed(fouled, earlier(log_scale=0.98))
    (effect,) = told.earlier[0].effects
    assert effect.contradicted
    assert 'contradict the earlier diagnosis then.json: log scale' in ' '.join(words.earlier(told))
    before, after = (
        sum(each.probability for each in found.candidates if 'fouling' in each.names)
        for found in (alone, told)
    )
    assert math.log(after / before) > -0.3


def test_an_earlier_size_that_the_runs_contradict_is_said(fouled, alone):
    wrong = EarlierCandidate(0.98, {'fouling': {'friction_factor': Parameter(1.2, 0.04)}})
    told = diagnosed(fouled, replace(earlier(), candidates=(wrong,)))
    (effect,) = told.earlier[0].effects
    assert effect.resized
    assert effect.contradicted
    assert 'of another size or sign than it was then' in ' '.join(words.earlier(told))
    # what a run leaves open, a size that it excludes does not name
    assert alone.verdict == told.verdict == 'one_of'
    sizes = [each.effects[0].parameters for each in told.candidates if each.names == ('fouling',)]
    assert all(abs(size['friction_factor'].value - 0.35) < 0.15 for size in sizes)


def test_an_error_of_an_instrument_that_is_not_read_now_is_no_contradiction() -> None:
    (judged,) = known(earlier(log_scale=0.97), unread=('log_scale',)).judged(nothing())
    assert not judged.effects
    assert 'an instrument of these runs can show it' in ' '.join(judged.unused)


FOULED = {'name': 'fouling', 'parameters': {'friction_factor': {'value': 0.3, 'sd': 0.04}}}
DOCUMENT: dict[str, Any] = {
    'candidates': [
        {'names': ['unknown'], 'probability': 0.1, 'effects': []},
        {'names': ['fouling'], 'probability': 0.8, 'effects': [FOULED]},
        {'names': ['none'], 'probability': 0.09, 'effects': []},
    ],
    'baseline': 'stated',
    'ship': {'name': 'Vitus Bering', 'length_m': 150.0, 'effects': ['log_scale']},
    'runs': [{'bag': 'out.mcap', 'time_ns': 1_700_000_000_000_000_000}],
    'earlier': [
        {'used': True, 'runs': [{'bag': 'old.mcap', 'time_ns': 1_600_000_000_000_000_000}]},
        {'used': False, 'runs': [{'bag': 'older.mcap', 'time_ns': 1_500_000_000_000_000_000}]},
    ],
}


def write(folder: Path, text: str) -> Path:
    path = folder / 'then.json'
    path.write_text(text)
    return path


def test_what_is_needed_is_read(tmp_path: Path) -> None:
    found = read_earlier(write(tmp_path, json.dumps(DOCUMENT)))
    assert (found.ship, found.length_m, found.stated) == ('Vitus Bering', 150.0, ('log_scale',))
    assert [run.name for run in found.runs] == ['out.mcap']
    assert [run.name for run in found.before] == ['old.mcap']
    assert found.of_force
    assert found.probability('fouling') == 0.8
    assert [each.probability for each in found.candidates] == [0.8, 0.09]
    assert found.candidates[0].effects['fouling']['friction_factor'].sd == 0.04


def test_a_result_says_what_its_file_says(tmp_path: Path, alone: DiagnosisResult) -> None:
    # something without a name says nothing of what has one, and is no sign of nothing
    unsure = replace(alone, candidates=(Candidate(UNKNOWN, 0.3), *alone.candidates[:1]))
    path = write(tmp_path, json_text(document(unsure, SHIP)))
    assert EarlierDiagnosis.of(unsure, SHIP, name=str(path)) == read_earlier(path)
    with pytest.raises(DiagnosisError, match="waits for the answer: 'is it"):
        EarlierDiagnosis.of(replace(alone, question='is it?'), SHIP, name='then')


def test_a_size_without_sd_and_a_record_without_a_ship_are_read(tmp_path: Path) -> None:
    bare = json.dumps({**DOCUMENT, 'ship': None, 'baseline': 'none'})
    found = read_earlier(write(tmp_path, bare.replace('"sd": 0.04', '"sd": null')))
    assert (found.ship, found.length_m, found.of_force) == ('', None, False)
    assert math.isnan(found.candidates[0].effects['fouling']['friction_factor'].sd)


def test_weather_of_a_day_is_read_whatever_its_sizes_were(tmp_path: Path) -> None:
    # of a version in which all waves were half as long as the ship
    waves = {'name': 'waves', 'parameters': {'force_n': {'value': 4e4, 'sd': 5e3}}}
    beside = {'names': ['waves'], 'probability': 0.1, 'effects': [waves]}
    document = {**DOCUMENT, 'candidates': [*DOCUMENT['candidates'][1:], beside]}
    assert read_earlier(write(tmp_path, json.dumps(document))).probability('waves') == 0.1


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', 'not JSON'),
        ('{"runs": [}', 'not JSON'),
        ('[' * 100_000, 'nested too deeply|not JSON'),
        ('{"candidates": NaN}', 'NaN is no number'),
        ('9' * 10_000, 'not JSON'),
        ('x' * 1_000_001, 'more than 1000000 bytes'),
        ('[]', r'the document: \[\], expected names with values'),
        ('{}', 'runs: missing'),
    ],
)
def test_what_is_no_diagnosis_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DiagnosisError, match=said) as caught:
        read_earlier(write(tmp_path, text))
    assert 'with --earlier FILE' in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(tmp_path))


@pytest.mark.parametrize(
    ('key', 'value', 'said'),
    [
        ('runs', [], 'runs: empty'),
        ('runs', [{'bag': 'x', 'time_ns': True}], 'time_ns: True'),
        ('runs', [{'bag': 'x', 'time_ns': 10**40}], 'time_ns'),
        ('runs', [{'bag': '\x1b[2J', 'time_ns': 1}], 'expected a line of text'),
        ('runs', [{'bag': 'x', 'time_ns': 1}] * 1001, 'a list of at most 1000'),
        ('ship', {'name': 'x', 'length_m': 1e400, 'effects': []}, 'not JSON|length_m'),
        ('candidates', [], 'candidates: 0'),
        ('candidates', [{'names': ['none'], 'probability': 0.6, 'effects': []}] * 2, '1.2 in all'),
        ('candidates', [{'names': ['fog'], 'probability': 0.6, 'effects': []}], 'effects others'),
        (
            'candidates',
            [{'names': ['none'], 'probability': 0.6, 'effects': [FOULED]}],
            'effects others',
        ),
        (
            'candidates',
            [{'names': ['fog'], 'probability': 0.6, 'effects': [{'name': 'fog'}]}],
            "'fog' is no effect that this version knows",
        ),
        (
            'candidates',
            [
                {
                    'names': ['fouling'],
                    'probability': 0.6,
                    'effects': [{'name': 'fouling', 'parameters': {}}],
                }
            ],
            'friction_factor: missing',
        ),
    ],
)
def test_what_is_wrong_in_it_is_said(tmp_path: Path, key: str, value: Any, said: str) -> None:
    with pytest.raises(DiagnosisError, match=said):
        read_earlier(write(tmp_path, json.dumps({**DOCUMENT, key: value})))


def test_a_file_that_is_not_there_or_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DiagnosisError, match='No such file'):
        read_earlier(tmp_path / 'none.json')
    with pytest.raises(DiagnosisError, match='Is a directory'):
        read_earlier(tmp_path)
