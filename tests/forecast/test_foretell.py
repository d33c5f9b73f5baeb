# SPDX-License-Identifier: Apache-2.0
"""The rest of a glide, from the estimate of any estimator."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.display import clock, way
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.followed import Followed, Passed, interval_score
from shipdrag_ros.forecast.foretell import HullNow, KnownCurve, deceleration, foretell, if_stopped
from shipdrag_ros.forecast.result import Band, PathAhead
from shipdrag_ros.library.forecasts import milestone_sentence, milestone_table
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import MOTION_INPUTS, SECOND_NS, Channel
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation import START_NS, Scenario, Truth, sense, simulate, standard_sensors

LEAD_IN_S, DURATION_S = 600.0, 2400.0
STOP_NS = START_NS + round(LEAD_IN_S * SECOND_NS)


@pytest.fixture(scope='module')
def ship() -> Ship:
    return replace(Ship.example(), propulsion=None)


@pytest.fixture(scope='module')
def truth(ship: Ship) -> Truth:
    scenario = Scenario(speed_m_s=8.0, lead_in_s=LEAD_IN_S, duration_s=DURATION_S)
    return simulate(ship, scenario)


@pytest.fixture(scope='module')
def window(truth: Truth) -> Window:
    block = sense(truth, standard_sensors(), seed=1)
    end_ns = STOP_NS + round(DURATION_S * SECOND_NS)
    return Window.from_block(block, STOP_NS, end_ns, before_ns=START_NS)


def after(window: Window, seconds: float, ship: Ship, estimator: str) -> Estimate:
    part = window.part(STOP_NS, STOP_NS + round(seconds * SECOND_NS))
    return estimate(part, ship, Parameters(estimator=estimator))


@pytest.fixture(scope='module')
def early(window: Window, ship: Ship) -> Estimate:
    return after(window, 600.0, ship, 'one')


@pytest.fixture(scope='module')
def whole(window: Window, ship: Ship) -> Estimate:
    return estimate(window, ship, Parameters(estimator='one'))


@pytest.mark.parametrize('estimator', ['one', 's1_joint'])
def test_it_comes_as_it_was_foretold(window, truth, ship, estimator):
    found = foretell(after(window, 600.0, ship, estimator), ship, froude_min=0.05)
    gliding = truth.time_s >= LEAD_IN_S
    time_s = truth.time_s[gliding] - LEAD_IN_S - 600.0
    speed = truth.speed_through_water_m_s[gliding]
    assert found.over_ground
    followed = [each for each in found.milestones if each.speed_m_s > speed[-1]]
    assert len(followed) >= 2
    for each in followed:
        was = float(np.interp(-each.speed_m_s, -speed, time_s))
        assert each.time_s.low < was < each.time_s.high
        assert each.time_s.median == pytest.approx(was, rel=0.15)
        assert each.distance_m.low < each.distance_m.median < each.distance_m.high


def test_it_is_the_integral_of_the_law(early: Estimate, ship: Ship) -> None:
    found = foretell(early, ship)
    u = np.linspace(found.speed_m_s[0], found.speed_m_s[-1], 4000)
    a = np.exp(deceleration(KnownCurve.of(early), ship, u[::40]).log_m_s2)
    per_m_s = 1.0 / np.interp(-u, -u[::40], a)
    assert found.time_s[-1, 0] == pytest.approx(-np.trapezoid(per_m_s, u), rel=1e-2)
    assert np.all(np.diff(found.time_s[:, 0]) > 0.0)
    assert np.all(np.diff(found.distance_m[:, 0]) > 0.0)
    assert np.all(np.diff(found.time_s, axis=0) >= 0.0)
    assert np.all(np.diff(found.distance_m, axis=0) >= 0.0)


def test_it_has_no_chance_in_it(early: Estimate, ship: Ship) -> None:
    one, other = foretell(early, ship), foretell(early, ship)
    assert one.time_s.tobytes() == other.time_s.tobytes()
    assert one.distance_m.tobytes() == other.distance_m.tobytes()


def test_a_wider_estimate_gives_a_wider_band(early: Estimate, ship: Ship) -> None:
    curve = replace(
        early.curve,
        sigma_repeatable_m_s2=0.5 * early.curve.resistance_m_s2,
        slope_sigma=early.curve.slope,
    )
    wide = foretell(replace(early, whole=curve), ship).milestones[0].time_s
    narrow = foretell(early, ship).milestones[0].time_s
    assert wide.high / wide.low > 1.1 * narrow.high / narrow.low


def test_the_law_is_less_known_where_nothing_was_seen(early: Estimate, ship: Ship) -> None:
    u = early.last_speed_m_s * np.array([1.0, 0.7, 0.4])
    sd = np.sqrt(np.diag(deceleration(KnownCurve.of(early), ship, u).covariance))
    assert sd[0] < sd[1] < sd[2]


@pytest.mark.parametrize('power', [0.0, 1.0, 2.0])
def test_a_law_that_is_no_hull_is_learnt(power: float) -> None:
    craft = replace(Ship.example(), baseline=None, propulsion=None)
    u = np.linspace(4.0, 8.0, 40)
    r = 0.02 * (1.0 + craft.n_r(u)) * (u / 8.0) ** power
    known = KnownCurve(u, r, 0.01 * r, np.full(40, 0.4))
    found = deceleration(known, craft, np.array([2.0]))
    off = abs(found.log_m_s2[0] - np.log(0.02 * 0.25**power))
    assert off < 2.0 * np.sqrt(found.covariance[0, 0]) < 0.8


def test_a_curve_that_no_law_fits_is_taken_for_rough(early: Estimate, ship: Ship) -> None:
    known = KnownCurve.of(early)
    u = np.array([early.last_speed_m_s])
    waves = 1.0 + 0.2 * np.sin(60.0 * np.log(known.speed_m_s))
    sharp = known._replace(sigma_m_s2=0.02 * known.resistance_m_s2, alike=0.0 * known.alike)
    bent = sharp._replace(resistance_m_s2=waves * sharp.resistance_m_s2)
    assert deceleration(sharp, ship, u).roughness < 2.0 < deceleration(bent, ship, u).roughness


def test_the_targets(early: Estimate, ship: Ship) -> None:
    stop = early.curve.speed_m_s[-1]
    found = foretell(early, ship, froude_min=0.05, speeds_m_s=(3.0, 2.9, 100.0))
    expected = {0.25 * stop, 3.0, 2.9, float(ship.speed(0.05))}
    assert found.targets_m_s == tuple(sorted(expected, reverse=True))
    assert found.speed_m_s[0] == pytest.approx(early.last_speed_m_s)
    assert found.speed_m_s[-1] < found.targets_m_s[-1]


def test_nothing_left_to_foretell_is_said(early: Estimate, ship: Ship) -> None:
    slow = replace(early, last_speed_m_s=0.5)
    with pytest.raises(EstimationError, match=r'nothing is left to foretell: at 0\.5 m/s'):
        foretell(slow, ship)


def test_the_speed_in_time_has_its_band(early: Estimate, ship: Ship) -> None:
    found = foretell(early, ship)
    table = found.in_time()
    time_s, speed, low, high, way, way_low, way_high = table.T
    assert time_s[0] == 0.0
    assert np.all(np.diff(time_s) > 0.0)
    assert np.all(low <= speed)
    assert np.all(speed <= high)
    assert np.all(way_low <= way)
    assert np.all(way <= way_high)
    # where the band of the time says that she has a speed early, that of the speed says slow
    milestone = found.milestones[0]
    at_low = np.interp(milestone.time_s.low, time_s, low)
    assert at_low == pytest.approx(milestone.speed_m_s, rel=0.02)


def test_a_current_carries_her_over_ground_alone(early: Estimate, ship: Ship) -> None:
    still = foretell(replace(early, current_m_s=0.0), ship).milestones[0]
    carried = foretell(replace(early, current_m_s=0.5), ship).milestones[0]
    assert carried.time_s == still.time_s
    more = carried.distance_m.median - still.distance_m.median
    assert more == pytest.approx(0.5 * still.time_s.median, rel=1e-9)


def test_in_time_her_way_is_through_water_unless_asked(early: Estimate, ship: Ship) -> None:
    still = foretell(replace(early, current_m_s=0.0), ship).in_time()
    carried = foretell(replace(early, current_m_s=0.5), ship)
    assert carried.over_ground
    assert np.array_equal(carried.in_time()[:, :5], still[:, :5])
    ground = carried.in_time(over_ground=True)
    assert np.allclose(ground[:, 4] - still[:, 4], 0.5 * still[:, 0], rtol=1e-12)
    # the water moves, too: less is known of the way over ground
    width = np.diff(ground[1:, 5:], axis=1), np.diff(still[1:, 5:], axis=1)
    assert (width[0] > width[1]).all()


def test_a_current_may_set_her_back(early: Estimate, ship: Ship) -> None:
    found = foretell(replace(early, current_m_s=-1.5), ship, speeds_m_s=(1.0, 0.8))
    way = np.array([each.distance_m for each in found.milestones])
    assert way[-1, 0] < way[:, 0].max()
    assert (way[:, 1] <= way[:, 0]).all()
    assert (way[:, 0] <= way[:, 2]).all()
    still = foretell(replace(early, current_m_s=0.0), ship, speeds_m_s=(1.0, 0.8))
    assert np.abs(way).max() < still.milestones[-1].distance_m.high


def test_what_followed_may_be_behind(window, whole, ship, early):
    whole = replace(whole, current_m_s=-2.0)
    position = window.position
    track = position.value[-1] - position.value[0]
    since_s = (position.time_ns - window.start_ns) / SECOND_NS
    value = position.value - 2.0 * since_s[:, None] * track / np.hypot(*track)
    carried = replace(window, position=replace(position, value=value))
    followed = Followed.of(carried, whole)
    assert whole.last_speed_m_s < 2.0
    assert followed.way_m[-1] < followed.way_m.max() - 50.0
    checked = followed.beside(foretell(replace(early, current_m_s=-2.0), ship), STOP_NS)
    assert checked.interval_score is not None
    assert np.isfinite(checked.interval_score)


def test_it_takes_less_than_five_milliseconds(early: Estimate, ship: Ship) -> None:
    foretell(early, ship)
    spent = []
    for _ in range(20):
        start = time.process_time()
        foretell(early, ship)
        spent.append(time.process_time() - start)
    assert np.median(spent) < 5e-3


def test_what_followed_is_read_from_the_instruments(window, whole, truth, early, ship):
    checked = Followed.of(window, whole).beside(foretell(early, ship), STOP_NS)
    gliding = truth.time_s >= LEAD_IN_S
    speed = truth.speed_through_water_m_s[gliding]
    shown = [each for each in checked.milestones if each.was_s is not None]
    assert shown
    for each in shown:
        was = float(np.interp(-each.foretold.speed_m_s, -speed, truth.time_s[gliding]))
        assert each.was_s == pytest.approx(was - LEAD_IN_S - 600.0, abs=25.0)
    unseen = [each for each in checked.milestones if each.foretold.speed_m_s < speed[-1] - 0.05]
    assert all(each.was_s is None and each.was_m is None for each in unseen)
    assert checked.inside is not None


def test_a_spike_is_not_what_followed(window, whole, ship, early):
    sound = Followed.of(window, whole).beside(foretell(early, ship), STOP_NS)
    log = window.speed_through_water
    value = log.value.copy()
    value[800::97] += 4.0
    spoilt = replace(window, speed_through_water=replace(log, value=value))
    other = Followed.of(spoilt, whole).beside(foretell(early, ship), STOP_NS)
    for one, two in zip(sound.milestones, other.milestones, strict=True):
        if one.was_s is not None:
            assert two.was_s == pytest.approx(one.was_s, abs=5.0)


def test_the_interval_score() -> None:
    band = Band(1.0, 0.5, 2.0)
    assert interval_score(band, 1.0, 0.0) == pytest.approx(np.log(4.0))
    assert interval_score(band, 4.0, 0.0) == pytest.approx(np.log(4.0) + 20.0 * np.log(2.0))
    assert interval_score(band, 4.0, 4.0) == pytest.approx(np.log(6 / 4.5) + 20 * np.log(8 / 6))


def test_words(early: Estimate, ship: Ship) -> None:
    first = foretell(early, ship).milestones[0]
    text = milestone_sentence(first, ship.mass_kg, 451.0)
    assert text.endswith(' nm; was 7:31')
    early_m = milestone_table([Passed(first, -2.5, -9.0)], ship.mass_kg).rows[0]
    short = first._replace(distance_m=Band(100.0, 50.0, 300.0))  # in one unit
    shown = milestone_table([Passed(short, None, None)], ship.mass_kg).rows[0]
    assert shown[4:6] == ('0.05 nm', '0.03 nm to 0.16 nm')
    assert (early_m[3], early_m[6]) == ('before', 'before')
    assert milestone_sentence(first, ship.mass_kg, -2.5).endswith('; passed before')
    assert clock(first.time_s.median) in text
    assert way(100.0, ship.mass_kg) == '100 m'


@pytest.mark.parametrize('kind', ['speed_through_water', 'position'])
def test_the_second_of_a_kind_alone_is_foretold_and_followed(window, ship, kind):
    one, why = replace(window, before=None), 'it is not there'
    for other in sorted({*MOTION_INPUTS} - {kind}):
        one = one.without(other, why)
    second = replace(one.without(kind, why), further={f'{kind}_2': one.series(kind)})
    found = []
    for each in (one, second):
        forecast = foretell(after(each, 600.0, ship, 'one'), ship)
        assert forecast.over_ground is (kind == 'position')
        whole = estimate(each, ship, Parameters(estimator='one'))
        found.append(Followed.of(each, whole).beside(forecast, STOP_NS))
    for first, other in zip(found[0].milestones, found[1].milestones, strict=True):
        # a noisy log crosses nearly the same speed some seconds sooner or later; places do not
        within_s = 10.0 if kind == 'speed_through_water' else 0.01
        assert first.was_s == pytest.approx(other.was_s, abs=within_s)
    assert found[0].pairs


SPEED_M_S = 7.0
FOULED = StatedEffect('fouling', {'friction_factor': Parameter(0.4, 0.05)})


@pytest.fixture(scope='module')
def driven() -> Ship:
    return replace(Ship.example(), propulsion=Propulsion(20.0, 5.0))


def glide(driven: Ship) -> Truth:
    return simulate(driven, Scenario(speed_m_s=SPEED_M_S, lead_in_s=1.0, duration_s=2400.0))


@pytest.mark.parametrize('effects', [(), (FOULED,)])
def test_she_glides_as_it_was_foretold(driven: Ship, effects: tuple[StatedEffect, ...]) -> None:
    driven = replace(driven, effects=effects)
    hull = HullNow.of_file(driven)
    assert ('fouling' in hull.source) == bool(effects)
    truth = glide(driven)
    found = if_stopped(hull, driven, SPEED_M_S, START_NS)
    compared = [each for each in found.milestones if each.speed_m_s > 2.5]
    assert len(compared) >= 3
    way = np.hypot(*(truth.position_m - truth.position_m[0]).T)
    for each in compared:
        at = float(np.interp(-each.speed_m_s, -truth.speed_through_water_m_s, truth.time_s)) - 1.0
        far = float(np.interp(at + 1.0, truth.time_s, way)) - SPEED_M_S
        assert each.time_s.low < at < each.time_s.high
        assert each.time_s.median == pytest.approx(at, rel=0.05)
        assert each.distance_m.median == pytest.approx(far, rel=0.05)


def test_a_run_is_known_better_than_the_file_that_it_contradicts(driven: Ship) -> None:
    fouled = glide(replace(driven, effects=(FOULED,)))
    speed = np.linspace(2.0, SPEED_M_S, 30)
    r = fouled.specific_resistance(speed)
    hull = HullNow.of_run(speed, r, 0.02 * r, START_NS)
    later = if_stopped(HullNow.of_file(driven), driven, SPEED_M_S, START_NS).reaches(4.0).time_s
    sooner = if_stopped(hull, driven, SPEED_M_S, START_NS).reaches(4.0).time_s
    was = float(np.interp(-4.0, -fouled.speed_through_water_m_s, fouled.time_s)) - 1.0
    assert sooner.median == pytest.approx(was, rel=0.03)
    assert later.median > 1.1 * was


def test_a_longer_run_down_delays(driven: Ship) -> None:
    hull = HullNow.of_file(driven)
    longer = replace(driven, propulsion=Propulsion(60.0, 5.0))
    one, other = (
        if_stopped(hull, each, SPEED_M_S, START_NS).reaches(4.0) for each in (driven, longer)
    )
    assert 40.0 < other.time_s.median - one.time_s.median < 80.0
    assert other.distance_m.median - one.distance_m.median > 40.0 * 4.0


def test_why_nothing_is_foretold(driven: Ship) -> None:
    with pytest.raises(EstimationError, match='neither a coastdown nor a baseline'):
        HullNow.of_file(replace(driven, baseline=None))
    assert not if_stopped(HullNow.of_file(driven), driven, 0.0, START_NS).milestones


PATH_STOP_NS = START_NS + 300 * SECOND_NS
MADE_S = 400.0


def test_she_is_where_she_was_foretold_to_be() -> None:
    ship = Ship.example()
    scenario = Scenario(
        speed_m_s=8.0, lead_in_s=300.0, duration_s=1500.0, heading_rad=0.7, current_m_s=(0.3, -0.2)
    )
    truth = simulate(ship, scenario)
    block = sense(truth, standard_sensors(), seed=2)
    end_ns = PATH_STOP_NS + round(MADE_S * SECOND_NS)
    window = Window.from_block(block, PATH_STOP_NS, end_ns, before_ns=START_NS)
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    path = PathAhead.of(window, forecast)
    assert path is not None
    assert path.time_ns[0] == forecast.made_ns
    at_s = (path.time_ns - START_NS) * 1e-9
    seen = at_s < truth.time_s[-1]
    was = np.column_stack(
        [np.interp(at_s[seen], truth.time_s, axis) for axis in truth.position_m.T]
    )
    off = np.hypot(*(path.position_m[seen] - was).T)
    gone = np.hypot(*(was - was[0]).T)
    assert off[0] < 15.0
    assert off[-1] < 0.1 * gone[-1]


def test_without_positions_there_is_none() -> None:
    ship = Ship.example()
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=300.0, duration_s=500.0))
    block = sense(truth, standard_sensors(), seed=2)
    log = block[np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)]
    window = Window.from_block(
        log, PATH_STOP_NS, PATH_STOP_NS + 400 * SECOND_NS, before_ns=START_NS
    )
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    assert not forecast.over_ground
    assert PathAhead.of(window, forecast) is None


def test_of_two_antennas_the_first_that_still_speaks_shows_the_course() -> None:
    ship = Ship.example()
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=300.0, duration_s=500.0))
    block = sense(truth, standard_sensors(), seed=2)
    end_ns = PATH_STOP_NS + 400 * SECOND_NS
    window = Window.from_block(block, PATH_STOP_NS, end_ns, before_ns=START_NS)
    other = replace(window.position, value=window.position.value + np.array([1e5, 0.0]))
    silent = window.part(PATH_STOP_NS, PATH_STOP_NS + 100 * SECOND_NS).position
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    both = replace(window, further={'position_2': other})
    path, first, second = (
        PathAhead.of(each, forecast) for each in (window, both, replace(both, position=silent))
    )
    assert path is not None
    assert first is not None
    assert second is not None
    assert np.array_equal(first.position_m, path.position_m)
    assert np.allclose(second.position_m - path.position_m, [1e5, 0.0], atol=1e-3)
