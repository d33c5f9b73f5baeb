# SPDX-License-Identifier: Apache-2.0
"""Trends of a fleet: events, sisters, prices, ranks."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipdrag_ros.fleet.store import HullEvent
from shipdrag_ros.ship import Ship
from shipdrag_ros.trend import fleet_trends, words
from shipdrag_ros.trend.page import draw_added_resistance
from tests.trend.conftest import CLEAN, DAY_NS, START_NS, row

EVERY_TWO_WEEKS = np.arange(0.0, 720.0, 15.0)
PRICES = """
length_m: 80.0
displaced_volume_m3: 1000.0
added_mass: {model: constant, value: 0.07, sd: 0.03}
economics:
  fuel_usd_per_t: 600.0
  sfoc_g_per_kwh: 180.0
  propulsive_efficiency: 0.6
  days_at_sea_per_year: 240.0
  cleaning_usd: 5000.0
  service_speed_m_s: 6.0
"""


def rows(ship, growth, *, days=EVERY_TWO_WEEKS, seed=1, cleaned=None, length=80.0):
    rng = np.random.default_rng(seed)
    found = []
    for day in days:
        added = growth * day / 365.25 - 0.1 * (cleaned is not None and day >= cleaned)
        added += rng.normal(0.0, 0.015)
        found.append(row(day, added, ship=ship, bag=f'{ship}/{day:.0f}.mcap', length_m=length))
    return found


@pytest.fixture(scope='module')
def priced():
    return Ship.from_yaml(PRICES, subject='prices')


def test_the_hull_that_costs_most_comes_first(priced):
    ships = {'Slow': priced, 'Fast': priced}
    trends = fleet_trends(rows('Slow', 0.05) + rows('Fast', 0.15), ships, {})
    assert [trend.series.name for trend in trends] == ['Fast', 'Slow']
    assert [trend.rank for trend in trends] == [1, 2]
    first = trends[0]
    assert first.now.value == pytest.approx(0.15 * 705 / 365.25, abs=3.0 * first.now.sd)
    assert first.growth_per_year.value == pytest.approx(0.15, abs=3.0 * first.growth_per_year.sd)
    force_n = 1e-3 * 36.0 * 1.025e6 * first.now.value
    assert first.power_kw.value == pytest.approx(force_n * 6.0 / 1000.0, rel=0.01)
    assert first.costs.usd_per_year.value > trends[1].costs.usd_per_year.value > 0.0
    assert first.cleaning_from_ns is not None
    assert first.now.sd > 0.02  # the error of the added mass is shared by all runs


def test_known_and_unknown_steps(priced):
    cleaning = HullEvent(START_NS + 400 * DAY_NS, 'cleaning', 'divers')
    seen = rows('Known', 0.15, cleaned=400.0) + rows('Unknown', 0.15, cleaned=400.0, seed=2)
    trends = {trend.series.name: trend for trend in fleet_trends(seen, {}, {'Known': [cleaning]})}
    [known] = [event for event in trends['Known'].events if event.known]
    found = max(trends['Unknown'].events, key=lambda event: event.probability)
    assert (known.kind, known.known, known.probability) == ('cleaning', True, 1.0)
    assert known.time_ns == cleaning.time_ns
    assert (found.kind, found.known) == ('unknown', False)
    assert found.probability > 0.5
    for event in (known, found):
        assert event.change.value == pytest.approx(-0.1, abs=3.0 * event.change.sd)
        assert abs(event.time_ns - cleaning.time_ns) < 31 * DAY_NS
    assert any('no `economics`' in note for note in trends['Known'].notes)


def test_events_of_one_time_keep_their_kinds_and_one_noted_twice_is_one_step():
    time_ns = START_NS + 400 * DAY_NS
    noted = [('coating', ''), ('docking', ''), ('docking', 'Lisbon')]
    events = [HullEvent(time_ns, *each) for each in noted]
    [trend] = fleet_trends(rows('Test', 0.15, cleaned=400.0), {}, {'Test': events})
    found = [(event.time_ns, event.kind) for event in trend.events if event.known]
    assert found == [(time_ns, 'coating'), (time_ns, 'docking')]
    assert not any('outside the time' in note for note in trend.notes)


def test_a_docking_that_takes_off_half_of_the_resistance_is_one_step():
    """At 45 % of fouling, after which nothing of it is left; seeds 1 to 4."""
    docking = HullEvent(START_NS + 400 * DAY_NS, 'docking')
    for seed in range(1, 5):
        seen = rows('Docked', 0.15, seed=seed, cleaned=400.0)
        for each in seen:
            before = each['time_ns'] < docking.time_ns
            shift = (0.3 if before else -0.05) * CLEAN
            each['resistance_m_s2'] = (np.array(each['resistance_m_s2']) + shift).tolist()
        [trend] = fleet_trends(seen, {}, {'Docked': [docking]})
        [event] = trend.events  # no second step beside it that explains the other half
        assert event.known
        assert event.change.value == pytest.approx(-0.45, abs=3.0 * event.change.sd)
        assert event.change.sd < 0.04


def test_what_ranks_stands_first_with_its_error(priced):
    seen = rows('Slow', 0.05) + rows('Fast', 0.15)
    trends = fleet_trends(seen, {'Slow': priced, 'Fast': priced}, {})
    table = words.ranking(trends)
    assert table.columns[2] == 'costs [USD a year]'
    assert words.ranked_by(trends).startswith('Ranked by what the added resistance costs a year;')
    shown = [float(row[2].replace(',', '').split(' ± ')[0]) for row in table.rows]
    costs = [trend.costs.usd_per_year for trend in trends]
    assert shown == sorted(shown, reverse=True)
    assert shown == pytest.approx([each.value for each in costs], rel=0.05)
    # as in all other texts, and said
    spread = [float(row[2].replace(',', '').split(' ± ')[1]) for row in table.rows]
    assert spread == pytest.approx([2.0 * each.sd for each in costs], rel=0.05)
    now = trends[0].now
    assert f' ± {200.0 * now.sd:.1f} % over' in words.lines(trends[0])[0]
    assert 'in calm deep water' in words.lines(trends[0])[0]
    assert words.lines(trends[0])[0].endswith('; ± is two standard deviations.')
    for trend, each in zip(trends, costs, strict=True):  # linear in what was added
        assert each.sd / each.value == pytest.approx(trend.now.sd / trend.now.value)
        # and in JSON and CSV
        assert trend.to_dict()['costs']['usd_per_year'] == {'value': each.value, 'sd': each.sd}
    assert all(row['usd_per_year_sd'] > 0.0 for row in words.rows(trends))
    # without the prices of one, power ranks them all
    trends = fleet_trends(seen, {'Slow': priced}, {})
    table = words.ranking(trends)
    assert [row[1] for row in table.rows] == ['Fast', 'Slow']
    assert table.columns[2] == 'effective power [kW]'
    assert 'not every ship file has prices' in words.ranked_by(trends)


def test_a_wrong_clock_does_not_stretch_the_axis():
    seen = rows('Test', 0.1)
    seen[5]['time_ns'] = 946_684_800_000_000_000
    [trend] = fleet_trends(seen, {}, {})
    axes = Figure().add_subplot()
    draw_added_resistance(axes, trend)
    low, high = axes.get_xlim()
    assert high - low < 1.2 * 705.0
    assert axes.get_xlabel().endswith('1 run(s) of another time are in the list alone')


def test_a_sister_lends_her_growth():
    few = rows('Young', 0.15, days=np.array([0.0, 20.0, 40.0]), seed=3)
    many = rows('Old', 0.15)
    alone = fleet_trends(few, {}, {})[0]
    with_sister = next(
        trend for trend in fleet_trends(few + many, {}, {}) if trend.series.name == 'Young'
    )
    foreign = rows('Old', 0.15, length=120.0)
    with_foreign = next(
        trend for trend in fleet_trends(few + foreign, {}, {}) if trend.series.name == 'Young'
    )
    assert with_sister.growth_per_year.sd < 0.9 * alone.growth_per_year.sd
    assert with_foreign.growth_per_year == alone.growth_per_year


def test_two_runs_are_no_trend_and_the_ship_comes_last():
    trends = fleet_trends(rows('Two', 0.1, days=np.array([0.0, 30.0])) + rows('Many', 0.1), {}, {})
    assert [trend.series.name for trend in trends] == ['Many', 'Two']
    assert (trends[1].now, trends[1].rank) == (None, None)
    assert '2 run(s) can be used, a trend needs 3' in trends[1].notes[-1]


def test_an_outlier_is_told_and_stays():
    seen = rows('Test', 0.1)
    seen[10]['resistance_m_s2'] = (1.8 * CLEAN).tolist()
    [trend] = fleet_trends(seen, {}, {})
    [left] = [point for point in trend.points if not point.used]
    assert left.bag == seen[10]['bag']
    assert 'outlier' in left.reason


def test_an_event_outside_the_runs_is_told():
    early = HullEvent(START_NS - 400 * DAY_NS, 'docking')
    [trend] = fleet_trends(rows('Test', 0.1), {}, {'Test': [early]})
    assert trend.events == ()
    assert any('outside the time of the runs' in note for note in trend.notes)
