# SPDX-License-Identifier: Apache-2.0
"""A run is condensed to rows, and its context, as a diagnosis sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.diagnose import compare, effects_about
from shipdrag_ros.diagnosis.known import Facts
from shipdrag_ros.diagnosis.observation import Context, Observation, Stop, ship_runs, sight
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation import Window
from shipdrag_ros.inference.decision import NONE
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation, ShipRuns
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Propulsion, Ship, TableBaseline
from shipdrag_ros.simulation import (
    START_NS,
    Action,
    Scenario,
    Truth,
    sense,
    simulate,
    simulate_columns,
    standard_sensors,
)
from shipdrag_ros.simulation.effects import find
from shipdrag_ros.simulation.surge import turning
from tests.runs import CARGO as SHIP
from tests.runs import coasted, cut


def test_the_speed_of_a_run_is_its_own_and_the_law_reaches_over_all(seen_of, cargo):
    fast = seen_of()
    slow = replace(fast, name='slow', speed_m_s=0.5 * fast.speed_m_s)
    alone, beside = (sight(slow, seen, cargo).model for seen in ([slow], [fast, slow]))
    for model in (alone, beside):
        at = model.coefficients + motion.SPEED
        assert model.families.mean[:, at] == pytest.approx(slow.speed_m_s)
        assert model.families.precision[:, at] == pytest.approx((0.3 * slow.speed_m_s) ** -2)
    assert alone.law.speed_m_s[-1] < fast.speed_m_s < beside.law.speed_m_s[-1]


def test_a_free_propeller_that_stands_is_odd_once_however_many_runs_show_it(cargo):
    def odds(count: int) -> float:
        runs = [coasted('fouling=0.3', name=f'run {i}', seed=i) for i in range(count)]
        found = diagnose(runs, cargo, Parameters(), advise=False)
        share = {each.names: each.probability for each in found.candidates}
        return share['fouling',] / share['locked_propeller',]

    assert odds(3) > 0.7 * odds(1)


LEAD_IN_S = 900.0


def window_of(
    ship: Ship, *inputs: str, late_s: float = 0.0, every_s: int = 1, since_s: float = 0.0
) -> Window:
    """Cut a run of given inputs; positions every so often, from some time on."""
    scenario = Scenario(speed_m_s=6.0, lead_in_s=LEAD_IN_S, duration_s=1200.0, heading_rad=1.2)
    block = sense(simulate(ship, scenario), standard_sensors(inputs=inputs), seed=3)
    after_s = (block.stamp_ns - START_NS) * 1e-9
    placed = block.channel == Channel.POSITION
    block = block[~placed | ((after_s >= since_s) & (np.round(after_s) % every_s == 0.0))]
    stop_ns = START_NS + round((LEAD_IN_S + late_s) * 1e9)
    return Window.from_block(block, stop_ns, int(block.stamp_ns.max()), before_ns=START_NS)


@pytest.mark.parametrize(
    ('inputs', 'how'),
    [
        (('position',), {}),
        (('speed_through_water', 'position'), {'every_s': 60}),
        (('speed_through_water', 'position'), {'since_s': LEAD_IN_S}),
        (('speed_through_water', 'position'), {'since_s': LEAD_IN_S - 2.0}),
        (('speed_through_water', 'position'), {'late_s': 30.0}),
        (('speed_through_water', 'position'), {'late_s': -30.0}),
    ],
    ids=[
        'positions alone',
        'a position a minute',
        'positions from the stop on',
        'two positions before it',
        'late',
        'early',
    ],
)
def test_nothing_is_missing_whatever_is_measured_and_whoever_dates_the_stop(cargo, inputs, how):
    window = window_of(cargo, *inputs, **how)
    found = diagnose([CoastRun('run', window)], cargo, Parameters(), advise=False)
    assert {each.names: each.probability for each in found.candidates}[NONE] > 0.6
    assert found.before is not None
    assert found.before.chi2_per_sample < 1.5


def test_no_position_is_lost_at_either_end_of_the_lead(cargo: Ship) -> None:
    seen = Observation.of(window_of(cargo, 'position'), cargo, Parameters(), name='run')
    steady = seen.rows.time_s < seen.lead_in_s
    assert seen.rows.time_s[0] < 31.0
    assert seen.rows.time_s[steady][-1] > seen.lead_in_s - 6.0


def test_a_compass_says_what_yaw_from_east_says(cargo: Ship) -> None:
    def turned(window: Window) -> Window:
        yaw = replace(window.heading, value=0.5 * np.pi - window.heading.value)
        return replace(window, heading=yaw, before=window.before and turned(window.before))

    window = window_of(cargo, 'speed_through_water', 'heading')
    by_yaw = Observation.of(window, cargo, Parameters(), name='run')
    parameters = Parameters(heading_convention='compass')
    by_compass = Observation.of(turned(window), cargo, parameters, name='run')
    assert len(by_yaw.context.at_yaw) > 10
    assert by_compass.heading_rad == pytest.approx(by_yaw.heading_rad, abs=1e-9)
    np.testing.assert_allclose(by_compass.context.value, by_yaw.context.value, atol=1e-9)


@pytest.mark.parametrize('input_', ['position', 'speed_through_water'])
def test_an_instrument_that_was_not_read_is_no_explanation(cargo: Ship, input_: str) -> None:
    seen = Observation.of(window_of(cargo, input_), cargo, Parameters(), name='run')
    names = {effect.name for effect in effects_about([seen])}
    assert {'fouling', 'current'} <= names
    assert ('log_scale' in names) == ('radar_scale' not in names) == (input_ != 'position')


def test_light_air_is_that_of_the_day(cargo: Ship, seen_of: Callable[..., Observation]) -> None:
    first = seen_of()
    sizes = []
    for hours in (2.0, 48.0):
        stop = first.context.stop
        later = replace(stop, since_ns=stop.since_ns + round(hours * 3600e9))
        other = replace(first, name='other', context=replace(first.context, stop=later))
        sizes.append(ship_runs([first, other], cargo).size)
    assert sizes[1] == sizes[0] + 2


def test_a_log_that_one_run_lacks_is_as_well_known_in_either_order(cargo: Ship) -> None:
    both, bare = (
        Observation.of(window_of(cargo, *inputs), cargo, Parameters(), name='run')
        for inputs in (('speed_through_water', 'position'), ('position',))
    )
    found = []
    for seen in ([both, bare], [bare, both]):
        runs = ship_runs(seen, cargo)
        families = runs.priors(Explanation(), np.zeros(runs.size))
        place = runs.places[seen.index(both)]
        at = place[[runs.coefficients + i for i in (motion.SCALE, motion.OFFSET, motion.LAG)]]
        found.append((families.mean[:, at], families.precision[:, at], families.log_chance))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other)
    assert found[0][1].max() < 1e6  # none is known to be right


def test_a_course_that_wanders_on_the_glide_is_no_turn(cargo: Ship) -> None:
    seen = Observation.of(window_of(cargo, 'position'), cargo, Parameters(), name='run')
    time_s = seen.context.port_s
    assert len(time_s) > 10
    after_s = np.maximum(time_s - seen.lead_in_s, 0.0)
    # to one side and back within ten minutes, by half a standard deviation of a heading
    course_rad = 0.02 * np.sin(after_s / 95.0) * (after_s < 600.0)
    way_m = np.cumsum(course_rad * 3.0 * np.diff(time_s, prepend=time_s[0]))
    away = seen.context.whitener[: len(way_m), : len(way_m)] @ way_m
    assert float(away @ away) < 4.0


@pytest.fixture(scope='module')
def seen() -> Observation:
    context = ('speed_over_ground', 'heading', 'shaft', 'wind_apparent', 'depth')
    inputs = ('speed_through_water', 'position', *context)
    run = coasted(heading_rad=0.7, inputs=inputs, seed=5)
    return Observation.of(run.window, SHIP, Parameters(), name='run')


@pytest.fixture(scope='module')
def runs(seen: Observation) -> ShipRuns:
    return ship_runs((seen,), SHIP)


def test_a_motion_that_cannot_be_computed_is_refused_in_words(seen: Observation) -> None:
    comparing = compare((seen,), SHIP, Facts(SHIP))
    comparing.runs.start[0] = np.nan
    with pytest.raises(
        DiagnosisError, match='cannot be computed at the speeds of the runs: check'
    ):
        comparing.fit_nothing()


def test_an_observation_is_condensed_and_knows_the_stop(seen: Observation) -> None:
    assert seen.heading_rad == pytest.approx(0.7, abs=0.01)
    # it ends with the last whole bin
    assert seen.duration_s == pytest.approx(1200.0, abs=15.0)
    assert 1100.0 < seen.lead_in_s < 1200.5
    assert seen.speed_m_s == pytest.approx(8.0, abs=0.05)
    assert len(seen.rows.time_s) < 500
    assert set(seen.rows.kind.tolist()) == {0, 1, 2}


def with_effect(runs: ShipRuns, name: str) -> tuple[Explanation, Float64]:
    """Return an effect, and unknowns near its start."""
    hypothesis = Explanation((next(ways_of(find(name), SHIP, 1200.0, 1)),))
    at = np.zeros(runs.width(hypothesis))
    at[: runs.size] = runs.start
    at[runs.size : runs.size + len(hypothesis.unknowns)] = 0.3
    return hypothesis, at


@pytest.mark.parametrize('name', ['current', 'fouling', 'wind', 'log_lag', 'shallow_water'])
def test_the_derivatives_by_an_effect_are_those_of_the_residual(runs: ShipRuns, name: str) -> None:
    hypothesis, at = with_effect(runs, name)
    step, count = 0.02, len(hypothesis.unknowns)
    moved = []
    for i in range(count):
        moved.append(at.copy())
        moved[-1][runs.size + i] += step
    base, *others = runs.linearise_run(0, [hypothesis] * (1 + count), [at, *moved])
    assert base is not None
    for i, other in enumerate(others):
        assert other is not None
        line = int(np.flatnonzero(base.place == runs.size + i)[0])
        for now, then in ((base.along, other.along), (base.rest, other.rest)):
            off = (now[0] - then[0]) / step - now[1 + line]
            size = np.sqrt(np.mean(now[1 + line] ** 2))
            assert np.sqrt(np.mean(off**2)) < 0.05 * size + 1e-6


@pytest.mark.parametrize('name', ['', 'time_offset', 'fouling'])
def test_the_derivatives_by_the_stop_hold_what_an_effect_does(runs: ShipRuns, name: str) -> None:
    hypothesis, at = with_effect(runs, name) if name else (Explanation(), runs.start.copy())
    at[runs.size :] = 1.5
    stop, step_s = runs.places[0][runs.coefficients + motion.STOP], 1.0
    later = at.copy()
    later[stop] += step_s
    base, other = runs.linearise_run(0, [hypothesis] * 2, [at, later])
    assert base is not None
    assert other is not None
    by_log = runs.runs[0].model.rows.kind == LOG
    number = 1 + int(np.flatnonzero(base.place == stop)[0])
    for now, then in (
        (base.along[:, by_log], other.along[:, by_log]),
        (base.rest, other.rest),
    ):
        changed = (now[0] - then[0]) / step_s
        off = changed - now[number]
        assert np.sqrt(np.mean(off**2)) < 0.05 * np.sqrt(np.mean(changed**2))


def test_hypotheses_together_are_as_each_alone(runs: ShipRuns) -> None:
    every = [with_effect(runs, name) for name in ('turning', 'current', 'fouling')]
    together = runs.linearise_run(0, [each for each, _ in every], [at for _, at in every])
    for (hypothesis, at), one in zip(every, together, strict=True):
        (alone,) = runs.linearise_run(0, [hypothesis], [at])
        assert one is not None
        assert alone is not None
        np.testing.assert_allclose(one.along, alone.along, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one.rest, alone.rest, rtol=1e-9, atol=1e-9)


def test_what_an_effect_does_begins_with_the_stop_of_each_hypothesis(runs: ShipRuns) -> None:
    hypothesis, at = with_effect(runs, 'fouling')
    run, stop = runs.runs[0], runs.places[0][runs.coefficients + motion.STOP]
    rows = run.model.rows
    by_log = rows.kind == LOG
    shown = {}
    for later_s in (0.0, 50.0):
        at[stop] = later_s
        began = runs.began(0, at)
        actions = [began.still, began.still + hypothesis.actions(run.frame, 0, at[runs.size :])[0]]
        along = run.simulate(actions, began.speed_m_s, began.later_s).along
        shown[later_s] = (along[1] - along[0])[by_log]
    time_s = rows.time_s[by_log]
    after = (time_s > 60.0) & (time_s < time_s[-1] - 50.0)
    moved = np.interp(time_s[after] + 50.0, time_s, shown[50.0])
    assert np.abs(shown[0.0][after]).max() > 0.1
    np.testing.assert_allclose(moved, shown[0.0][after], atol=0.01)


def test_wind_and_depth_are_felt_by_their_sensors(seen: Observation, runs: ShipRuns) -> None:
    winds, first = 2 * len(seen.context.at_wind), len(seen.context.port_s)
    assert first > 0
    for name, at in (('wind', slice(0, winds)), ('shallow_water', slice(winds, winds + 1))):
        hypothesis, where = with_effect(runs, name)
        where[runs.size] = 0.5 if name == 'wind' else -0.5
        (table,) = runs.linearise_run(0, [hypothesis], [where])
        assert table is not None
        assert np.abs(table.rest[0, first:][at]).max() > 3.0


_TIMES = np.arange(0.0, 5610.0, 10.0)


@pytest.mark.parametrize(('gain', 'turned_rad'), [(1.05, 0.0), (1.0, 0.05)])
def test_an_anemometer_that_is_wrong_by_its_sd_is_no_other_speed(cargo, gain, turned_rad):
    scenario = Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=1200.0, heading_rad=0.7)
    inputs = ('speed_through_water', 'wind_apparent')
    block = sense(simulate(cargo, scenario), standard_sensors(inputs=inputs), seed=3)
    window, stop = cut(block, 600.0), Stop(int(block.stamp_ns.min()), 600.0, 0.7, 8.0)
    times = np.arange(0.0, 1800.0, 10.0)
    right = Context.of(window, cargo, times, stop)
    ahead, port = block.value[block.channel == Channel.WIND_APPARENT, :2].T
    cos, sin = gain * np.cos(turned_rad), gain * np.sin(turned_rad)
    value = block.value.copy()
    value[block.channel == Channel.WIND_APPARENT, 0] = cos * ahead - sin * port
    value[block.channel == Channel.WIND_APPARENT, 1] = cos * port + sin * ahead
    wrong = Context.of(cut(replace(block, value=value), 600.0), cargo, times, stop)
    away = wrong.whitener @ (wrong.value - right.value)
    # one standard deviation of one unknown
    assert float(away @ away) < 1.5


def _shaft_of(cargo: Ship, after: Callable[[Float64, Float64], Float64]) -> tuple[Context, Truth]:
    """Return the context of a run whose shaft, over the steady one, is some function after it."""
    speed = np.linspace(0.0, 10.0, 101)
    baseline = TableBaseline(tuple(speed), tuple(3e3 * speed**2), 0.01)
    ship = replace(cargo, baseline=baseline, propulsion=Propulsion(2.0, 0.5))
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=610.0, duration_s=5000.0))
    block = sense(truth, standard_sensors(inputs=('speed_through_water', 'shaft')), seed=3)
    shaft = block.channel == Channel.SHAFT
    after_s = (block.stamp_ns[shaft] - START_NS) * 1e-9 - 610.0
    part = np.interp(after_s + 610.0, truth.time_s, truth.speed_through_water_m_s) / 8.0
    value = block.value.copy()
    value[shaft, 0] = 11.0 * np.where(after_s > 0.0, after(after_s, part), 1.0)
    window, first = cut(replace(block, value=value), 610.0), int(block.stamp_ns.min())
    return Context.of(window, ship, _TIMES, Stop(first, 610.0, 0.0, 8.0)), truth


def test_a_free_shaft_that_friction_stops_is_no_other_propeller(cargo: Ship) -> None:
    found, truth = _shaft_of(cargo, lambda _, part: 0.5 * part * turning(part, 0.25))
    assert found.turns
    columns = simulate_columns(
        truth.ship, truth.scenario, [Action()], _TIMES, speed_m_s=np.array([8.0])
    )
    chi2 = {}
    for friction_m_s in (0.0, 2.0):
        action = Action(free_shaft=0.5, friction_m_s=friction_m_s)
        away = found.whitener @ (found.value - found.predict(columns, [action], 610.0)[0])
        chi2[friction_m_s] = float(away @ away)
    assert chi2[0.0] > 10.0
    assert chi2[2.0] < 1.0


def test_rows_of_the_shaft_hold_no_reading_from_before_its_fall(cargo: Ship) -> None:
    # one minute of them says that the water turns her propeller
    found, _ = _shaft_of(cargo, lambda after_s, _: np.exp(-after_s / 2.0))
    assert not found.turns
    assert len(found.at_shaft) > 80
    assert np.abs(found.value[: len(found.at_shaft)]).max() < 0.01


def test_a_run_that_ends_before_the_shaft_has_fallen_has_no_row_of_it(cargo: Ship) -> None:
    scenario = Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=20.0)
    block = sense(simulate(cargo, scenario), standard_sensors(), seed=3)
    stop = Stop(int(block.stamp_ns.min()), 600.0, 0.0, 8.0)
    found = Context.of(cut(block, 600.0), cargo, np.arange(0.0, 621.0, 10.0), stop)
    assert len(found.at_shaft) == 0
