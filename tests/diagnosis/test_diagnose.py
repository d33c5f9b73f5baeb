# SPDX-License-Identifier: Apache-2.0
"""A hidden effect is named, added to the ship, and then no longer missing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose, verdict, words
from shipdrag_ros.diagnosis.diagnose import compare, observed
from shipdrag_ros.diagnosis.known import Facts
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.inference.decision import NONE, Verdict
from shipdrag_ros.inference.rows import LOG, POSITION
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import CoefficientBaseline, Fact, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import LIBRARY, parse
from shipdrag_ros.simulation.surge import turning
from tests.runs import CARGO as SHIP
from tests.runs import coasted, cut

PARAMETERS = Parameters()


def run(
    *effects: str, heading_rad: float = 0.3, seed: int = 1, lead_in_s: float = 1800.0
) -> CoastRun:
    return coasted(
        *effects,
        lead_in_s=lead_in_s,
        coast_s=1500.0,
        heading_rad=heading_rad,
        reference_rad=0.3,
        seed=seed,
    )


def test_a_run_that_tells_too_little_is_left_out_and_said_so() -> None:
    found = diagnose([run(), run(seed=2, lead_in_s=120.0)], SHIP, PARAMETERS)
    assert found.verdict is Verdict.NONE
    assert found.held_out_before is None
    (left_out,) = (note for note in found.notes if note.startswith('left out: '))
    assert 'at least 300 s are needed' in left_out
    with pytest.raises(DiagnosisError, match='at least 300 s are needed'):
        diagnose([run(lead_in_s=120.0)], SHIP, PARAMETERS)


def test_a_speed_that_no_resistance_is_known_for_asks_for_its_unit() -> None:
    log_alone = run('log_scale=0.9438').window.without('position', 'not on board')
    found = diagnose([CoastRun('log', log_alone)], SHIP, PARAMETERS)
    said = words.sentence(found)
    assert said.startswith('log: the speed before the stop was read as 15.5 m/s (30.2 knots)')
    assert '(0.0 to 19.4 knots): is the unit wrong?' in said
    assert '--map speed_through_water=COLUMN:kn' in said
    assert '15.50' not in said
    assert not found.candidates
    todo = r'log: the speed before .* knots\); state a `baseline` that holds this speed'
    with pytest.raises(DiagnosisError, match=todo):
        diagnose([CoastRun('log', log_alone)], SHIP, PARAMETERS, facts=[Fact('units_checked')])


@pytest.mark.parametrize('table', [True, False])
def test_a_baseline_that_ends_above_the_run_goes_on_with_the_square(table: bool) -> None:
    base = SHIP.baseline
    assert isinstance(base, CoefficientBaseline)
    low = 0.1 if table else base.wave_froude[1]
    if table:
        speed = SHIP.speed(np.linspace(low, 0.24, 9))
        force = SHIP.resistance_n(speed)
        known = TableBaseline(tuple(speed.tolist()), tuple(force.tolist()), 0.02)
        ship = replace(SHIP, baseline=known)
    else:
        froude, wave = base.wave_froude[1:], base.wave_coefficient[1:]
        ship = replace(SHIP, baseline=replace(base, wave_froude=froude, wave_coefficient=wave))
    found = diagnose([run('log_scale=0.1')], ship, PARAMETERS)
    assert [each.name for each in found.effects] == ['log_scale']
    said = f'below {SHIP.speed(low):.3g} m/s'
    assert any(said in note and 'square of the speed' in note for note in found.notes)


def test_a_radar_that_bends_the_way_before_the_stop_is_said_to() -> None:
    straight = run()
    assert straight.window.before is not None
    start = straight.window.before.position.value[0]

    def bent(series: Series) -> Series:
        way = series.value - start
        reach = 6000.0
        wrong = 1.0 + 0.03 * np.sin(np.pi * np.hypot(*way.T) / reach)
        return replace(series, value=start + way * wrong[:, None])

    before = replace(straight.window.before, position=bent(straight.window.before.position))
    window = replace(straight.window, position=bent(straight.window.position), before=before)
    found = diagnose([CoastRun('bent', window)], SHIP, PARAMETERS)
    assert found.verdict not in (Verdict.NONE, Verdict.NAMED)
    assert NONE in [each.names for each in found.held]
    assert found.where is None
    assert any('wander apart' in note for note in found.notes)


def test_a_drag_for_a_while_without_a_turn_is_not_called_turning() -> None:
    found = diagnose([run('turning=25,start_s=300,duration_s=200,rate_rad_s=0')], SHIP, PARAMETERS)
    assert found.verdict is Verdict.UNKNOWN
    assert found.where is not None
    assert found.where.channel == 'force'


def test_a_log_that_swings_within_minutes_is_something_without_a_name() -> None:
    still = run()
    log = still.window.speed_through_water
    phase = 2.0e-9 * np.pi * (log.time_ns - log.time_ns[0]) / 300.0
    less = 1.0 - 0.02 * (1.0 - np.cos(phase))  # air under it, which comes and goes
    window = replace(still.window, speed_through_water=replace(log, value=log.value * less))
    found = diagnose([CoastRun('swings', window)], SHIP, PARAMETERS)
    assert found.verdict is Verdict.UNKNOWN


def test_what_is_in_one_run_alone_is_not_asked_of_the_other() -> None:
    turning = 'turning=25,start_s=300,duration_s=200,rate_rad_s=0.001'
    runs = [run(turning), run(heading_rad=0.3 + 3.14159, seed=2)]
    found = diagnose(runs, SHIP, PARAMETERS)
    assert found.candidates[0].names == ('turning',)
    assert found.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    assert found.held_out_after is not None
    assert found.held_out_after.chi2_per_sample < 1.5


def test_what_two_runs_share_is_named_and_sharper_than_by_one() -> None:
    runs = [run('current=0.3'), run('current=0.3', heading_rad=0.3 + np.pi, seed=2)]
    found = diagnose(runs, SHIP, PARAMETERS)
    assert found.verdict is Verdict.NAMED
    assert [each.name for each in found.effects] == ['current']
    assert found.would_decide == ()  # nothing is advised any more
    size = found.effects[0].parameters['along_track_m_s']
    assert abs(size.value - 0.3) < 3.0 * size.sd
    assert found.after is not None
    assert found.held_out_after is not None
    assert found.after.chi2_per_sample < 0.5 * found.before.chi2_per_sample
    assert found.held_out_after.chi2_per_sample < 1.2
    alone = diagnose(runs[:1], SHIP, PARAMETERS, advise=False)
    one = next(e for c in alone.candidates for e in c.effects if e.name == 'current')
    assert size.sd < one.parameters['along_track_m_s'].sd


FACTS = (*map(Fact, ('no_towed_cable', 'deep_water', 'draughts_read')), Fact('shaft', 'free'))


def short_run(name: str, effect: str, size: float, seed: int) -> CoastRun:
    effects = [f'{effect}={size}'] if size else []
    return coasted(*effects, name=name, coast_s=1000.0, rate_hz=0.5, seed=seed)


@pytest.mark.parametrize(
    ('name', 'parameter', 'channel', 'sizes'),
    [
        ('fouling', 'friction_factor', 'force', (0.0, 0.35)),
        ('fouling', 'friction_factor', 'force', (0.3, 0.3)),
        ('log_scale', 'factor', 'log', (0.0, 0.1)),
    ],
)
def test_runs_differ_where_one_size_does_not_fit_both(
    name: str, parameter: str, channel: str, sizes: tuple[float, float]
) -> None:
    runs = [short_run(str(j), name, size, seed=j) for j, size in enumerate(sizes)]
    found = diagnose(runs, SHIP, Parameters(), facts=FACTS)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == name
    last = effect.parameters[parameter]
    assert abs(last.value - sizes[1]) < 3.0 * last.sd
    if sizes[0] == sizes[1]:
        assert found.runs_differ == ()
        assert words.differing(found.runs_differ) == ''
        return
    assert [each.run for each in found.runs_differ] == ['0', '1']
    for each, size in zip(found.runs_differ, sizes, strict=True):
        assert (each.effect, each.parameter) == (name, parameter)
        assert abs(each.size.value - size) < 3.0 * each.size.sd
        assert each.size.sd < 0.08
    assert found.held_out_after is None  # no run tells of another
    assert found.where is not None
    assert found.where.channel == channel
    first, second, *_ = words.summary(found)
    missing = 'Missing in the model, and not alike in these runs: '
    assert first.startswith(missing + name.replace('_', ' '))
    assert second.startswith('These runs differ: no one size fits all')


def test_an_error_of_the_log_that_swings_is_in_the_log(cargo: Ship) -> None:
    scenario = Scenario(speed_m_s=7.0, lead_in_s=900.0, duration_s=900.0)
    block = sense(simulate(cargo, scenario), standard_sensors(), seed=2)
    after = np.maximum((block.stamp_ns - START_NS) * 1e-9 - 900.0, 0.0)
    swing = 1.0 + 0.05 * np.sin(2.0 * np.pi * after / 200.0)
    of_log = block.channel == FIRST
    block = replace(block, value=np.where(of_log, swing, 1.0)[:, None] * block.value)
    window = cut(block, 900.0)
    found = diagnose([CoastRun('run', window)], cargo, Parameters(), advise=False)
    assert (found.verdict, found.unnamed > 0.9) == (Verdict.UNKNOWN, True)
    assert found.where is not None
    assert found.where.channel == 'log'


def test_latitude_and_longitude_are_in_the_scale_of_the_earth(cargo: Ship) -> None:
    scenario = Scenario(speed_m_s=7.0, lead_in_s=900.0, duration_s=900.0)
    truth = simulate(cargo, scenario, effects=[parse('radar_scale=0.08')])
    block = sense(truth, standard_sensors(), seed=2)
    window = cut(block, 900.0)
    of_earth = replace(window, geodetic=frozenset({'position'}))
    for given, may in ((window, True), (of_earth, False)):
        found = diagnose([CoastRun('run', given)], cargo, Parameters(), advise=False)
        assert any('radar_scale' in each.names for each in found.candidates) == may
        said = [note for note in found.notes if 'radar_scale is ruled out' in note]
        assert len(said) == (not may)


def test_what_a_bare_ship_file_leaves_unexamined_is_said_with_what_to_state(cargo: Ship) -> None:
    bare = replace(cargo, air=None, propeller=None, breadth_m=None, draught_m=None)
    run = coasted(speed_m_s=7.0, seed=2)
    for ship, expected in (
        (cargo, []),
        (
            bare,
            [
                '`propeller` in the ship file: locked propeller, windmilling propeller',
                '`breadth_m` and `draught_m` in the ship file: shallow water',
                '`air` in the ship file: wind',
            ],
        ),
    ):
        found = diagnose([run], ship, Parameters(), advise=False)
        start = 'not examined without '
        said = [note.removeprefix(start) for note in found.notes if note.startswith(start)]
        assert said == expected
        unseen = {
            name.replace(' ', '_') for one in said for name in one.split(': ')[1].split(', ')
        }
        assert set(found.limits) == set(LIBRARY) - unseen


@pytest.mark.parametrize('stall_m_s', [1.6, 3.0, 5.0])
def test_where_a_free_shaft_stops_makes_nothing_less_likely(cargo: Ship, stall_m_s: float) -> None:
    scenario = Scenario(speed_m_s=8.0, lead_in_s=900.0, duration_s=1500.0)
    truth = simulate(cargo, scenario)
    block = sense(truth, standard_sensors(), seed=2)
    time_s = (block.stamp_ns - START_NS) * 1e-9
    shaft = block.channel == Channel.SHAFT
    after = shaft & (time_s > 960.0)  # it has run down, and the water turns it
    speed = np.interp(time_s[after], truth.time_s, truth.speed_through_water_m_s)
    value = block.value.copy()
    steady = np.median(value[shaft & (time_s < 900.0), 0])
    value[after, 0] = 0.55 * steady * speed / 8.0 * turning(speed, stall_m_s)
    window = cut(replace(block, value=value), 900.0)
    found = diagnose([CoastRun('run', window)], cargo, Parameters(), advise=False)
    assert found.verdict is Verdict.NONE
    assert found.nothing > 0.9


FIRST, SECOND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2


@pytest.mark.parametrize('first_heard', [True, False])
def test_the_first_that_was_heard_is_used_and_what_the_other_reads_is_said(cargo, first_heard):
    scenario = Scenario(speed_m_s=8.0, lead_in_s=900.0, duration_s=900.0)
    inputs = ('speed_through_water', 'speed_through_water_2', 'position')
    block = sense(simulate(cargo, scenario), standard_sensors(inputs=inputs), seed=5)
    off = np.where(block.channel == SECOND, 1.04, 1.0)[:, None]
    block = replace(block, value=off * block.value)
    if not first_heard:
        block = block[block.channel != FIRST]
    run = CoastRun('run', cut(block, 900.0))
    (seen,), notes = observed([run], cargo, Parameters(), lambda *_: None)
    assert set(seen.rows.kind.tolist()) == {LOG, POSITION}
    if first_heard:
        (note,) = notes
        beside = 'run: speed_through_water_2 is not used beside speed_through_water, against '
        assert note.startswith(f'{beside}which it reads +')
        assert float(note.split('reads ')[1].split(' ')[0]) == pytest.approx(4.0, abs=0.5)
        assert seen.speed_m_s == pytest.approx(8.0, rel=0.01)
    else:
        assert notes == ()
        assert seen.speed_m_s == pytest.approx(8.32, rel=0.01)


COAST_S = 1200


def run_of(*effects: str, heading_rad: float = 0.7, seed: int = 5) -> CoastRun:
    return coasted(*effects, heading_rad=heading_rad, reference_rad=0.7, seed=seed)


def test_what_an_effect_makes_of_r_is_known_by_positions_alone_too() -> None:
    of_both = [
        diagnose([coasted(inputs=inputs, seed=5)], SHIP, Parameters(), advise=False).limits
        for inputs in (('position', 'heading'), ('position', 'heading', 'speed_through_water'))
    ]
    for name in ('fouling', 'waves', 'added_mass'):
        # of sizes that differ
        shares = [each[name].percent_of_r / each[name].value for each in of_both]
        assert shares[0] == pytest.approx(shares[1], rel=0.05)


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
        # a minute and a half late: what dates the stop is late too
        ('time_offset=90', 'offset_s', 90.0),
        # no small change of what it is without
        ('time_offset=150', 'offset_s', 150.0),
    ],
)
def test_what_is_hidden_is_named_with_its_size(text: str, parameter: str, size: float) -> None:
    found = answer(text)
    name = text.partition('=')[0]
    assert [effect.name for effect in found.effects] == [name]
    assert found.where is not None
    assert found.where.channel == 'log'
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
    assert 'any size' in {row[3] for row in words.limits_table(found).rows}


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


def test_water_and_air_of_one_day_in_a_ship_file_are_said_to_be_that() -> None:
    run = coasted(name='today', coast_s=600.0, rate_hz=0.5)
    stated = (
        StatedEffect('current', {'along_track_m_s': Parameter(0.0, 0.1)}),
        StatedEffect('fouling', {'friction_factor': Parameter(0.0, 0.1)}),
    )
    found = diagnose([run], replace(SHIP, effects=stated), Parameters(), advise=False)
    (said,) = [note for note in found.notes if 'one day' in note]
    assert said.startswith('the ship file states current, which')
    assert 'along the heading of today' in said
    assert said in words.summary(found)
