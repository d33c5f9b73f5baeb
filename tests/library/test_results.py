# SPDX-License-Identifier: Apache-2.0
"""Results show themselves: in a line, in a notebook, as a frame, as a picture, as a page."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

import shipdrag_ros as sd
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import StatedEffect
from shipdrag_ros.simulation.effects import find


@pytest.fixture(scope='module')
def found(record: sd.Record) -> sd.Resistance:
    return sd.estimate(record)


@pytest.fixture(scope='module')
def diagnosis(record: sd.Record) -> sd.Diagnosis:
    return sd.diagnose(record)


def test_each_says_in_a_line_what_it_is(record, found, diagnosis):
    assert repr(record) == '<Record: Vitus Bering, 1 run, 5204 messages>'
    assert repr(found).startswith('<Resistance: Vitus Bering, 1 coastdown; ')
    assert 'kN at' in repr(found)
    assert repr(found.coastdowns[0]).startswith('<Coastdown: 2026-06-01 08:06:')
    title, _, sure = repr(diagnosis).rpartition(' (')
    assert title == '<Diagnosis: Vitus Bering, named: log scale'
    assert f'probability {sure.removesuffix(")>")}' in diagnosis.summary()


def test_a_notebook_shows_text_and_a_table_and_nothing_else(record, found, diagnosis):
    for each in (record, found, found.coastdowns[0], diagnosis):
        page = each._repr_html_()
        assert page.count('<table>') == page.count('</table>') == 1
        assert page.count('<p>') == 1 + len(each.summary().splitlines())
    named = sd.Record(record.runs, given=sd.Ship(name='<b>', length_m=80, displaced_volume_m3=4e3))
    assert '<b>' not in named._repr_html_()
    assert '&lt;b&gt;' in named._repr_html_()


def test_a_summary_is_a_text_that_prints(record, found, diagnosis):
    for each in (record, found, found.coastdowns[0], diagnosis):
        text = each.summary()
        assert isinstance(text, str)
        assert repr(text) == str(text)
        assert not text.startswith('(')
        assert text._repr_html_().count('<p>') == len(text.splitlines())


def test_nothing_that_a_result_holds_fills_a_screen(record, found, diagnosis):
    (coastdown,) = found.coastdowns
    parts = (found.curve, coastdown.event, coastdown.estimate, coastdown.run, record.truth)
    for each in (*parts, diagnosis.found, found.ship, record.samples()):
        assert len(repr(each)) < 1500, type(each).__name__
        assert repr(each).startswith(f'{type(each).__name__}(')


def test_a_log_with_its_sign_turned_is_said() -> None:
    seconds = np.arange(1500.0)
    knots = 14.0 / (1.0 + np.maximum(seconds - 700.0, 0.0) / 400.0)
    for sign in (1.0, -1.0):
        frame = {'t': seconds, 'log': sign * knots}
        record = sd.read(
            pd.DataFrame(frame),
            ship=sd.Ship(length_m=80.0, displaced_volume_m3=4000.0),
            columns={'speed_through_water': 'log:kn'},
            time='t',
        )
        summary = sd.estimate(record).summary()
        assert ('the sign of the log is wrong' in summary) == (sign < 0.0)


def test_the_frame_is_the_curve(found: sd.Resistance) -> None:
    frame = found.to_frame()
    curve = found.curve
    assert frame['resistance_m_s2'].to_numpy().tobytes() == curve.resistance_m_s2.tobytes()
    assert np.all(np.diff(frame['speed_m_s']) > 0.0)
    newtons = frame['resistance_m_s2'] * found.ship.mass_kg
    assert np.allclose(frame['resistance_n'], newtons)
    assert np.allclose(frame['over_clean_hull'], newtons / frame['clean_hull_n'] - 1.0)
    assert len(found.coastdowns[0].to_frame()) == len(frame)


def test_without_pandas_the_frame_says_what_is_missing(found: sd.Resistance, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, 'pandas', None)
    with pytest.raises(sd.ShipdragError, match='pip install pandas'):
        found.to_frame()


def test_plots_are_drawn_on_the_axes_given(record, found, diagnosis):
    figure, axes = plt.subplots(1, 3)
    try:
        for ax, each in zip(axes, (record, found, diagnosis)):
            assert each.plot(ax) is ax
            assert ax.lines
            assert ax.get_xlabel()
            assert ax.get_ylabel()
        alone = found.coastdowns[0].plot()
        assert isinstance(alone, Axes)
        assert alone.figure is not figure
    finally:
        plt.close('all')


def test_the_diagnosis_is_told_in_full(diagnosis: sd.Diagnosis) -> None:
    (effect,) = diagnosis.effects
    factor = effect.parameters['factor']
    assert abs(factor.value + 0.15) < 4.0 * factor.sd
    frame = diagnosis.to_frame()
    row = frame[frame['effect'] == 'log_scale'].iloc[0]
    # what is named is of all hypotheses that hold it, a row of its own candidate
    (alone,) = diagnosis.candidates[0].effects
    own = alone.parameters['factor']
    assert (row['parameter'], row['value'], row['sd']) == ('factor', own.value, own.sd)
    assert abs(own.value - factor.value) < factor.sd
    assert own.sd < factor.sd
    better = diagnosis.ship_with_effects()
    assert [each.name for each in better.effects] == ['log_scale']
    assert diagnosis.gap_after is not None
    assert diagnosis.gap_after.chi2_per_sample < diagnosis.gap_before.chi2_per_sample
    assert diagnosis.gaps().rows
    with pytest.raises(sd.ShipdragError, match='run 7 is not there'):
        diagnosis.plot(run=7)
    with pytest.raises(sd.ShipdragError, match=r"'depth' was not compared .* but speed_through"):
        diagnosis.plot(quantity='depth')


def test_pages_are_written(found: sd.Resistance, diagnosis: sd.Diagnosis, tmp_path: Path) -> None:
    for each in (found, diagnosis):
        each.report(tmp_path / 'page.html')
        assert (tmp_path / 'page.html').read_text(encoding='utf-8').startswith('<!')
        with pytest.raises(sd.ShipdragError, match='cannot be written: No such file'):
            each.report(tmp_path / 'nowhere' / 'page.html')


def test_several_coastdowns_are_one_curve(record: sd.Record) -> None:
    other = sd.simulate(
        sd.Ship.example(),
        duration_s=900.0,
        lead_in_s=400.0,
        heading_rad=np.pi,
        seed=4,
        first_heading_rad=0.0,
    )
    both = sd.estimate([other, sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)])
    assert both.combined is not None
    assert both.curve is not None
    assert both.curve.speed_m_s.tobytes() == both.combined.speed_m_s.tobytes()
    assert '2 coastdowns together.' in both.summary()
    try:
        assert len(both.plot().lines) >= 3
    finally:
        plt.close('all')


def test_where_there_is_no_coastdown_it_says_why() -> None:
    steady = sd.simulate(sd.Ship.example(), duration_s=5.0, lead_in_s=400.0)
    found = sd.estimate(steady)
    assert found.coastdowns == ()
    assert repr(found) == '<Resistance: Vitus Bering, no coastdowns>'
    assert found.summary().startswith('No coastdown found')
    slow = sd.simulate(sd.Ship.example(), duration_s=25.0, lead_in_s=400.0)
    assert 'one stretch was looked at and dismissed.' in sd.estimate(slow).summary()
    for ask in (lambda: found.curve, found.plot, found.to_frame):
        with pytest.raises(sd.ShipdragError, match='No coastdown found'):
            ask()
    assert 'No coastdown found' in found._repr_html_()


def test_a_ship_may_be_given_by_its_file_and_a_stop_by_no_text(record, tmp_path) -> None:
    path = tmp_path / 'ship.yaml'
    path.write_text(record.ship.to_yaml())
    found, by_file = (sd.estimate(record, ship=ship) for ship in (sd.Ship.load(path), path))
    assert by_file.summary() == found.summary()
    with pytest.raises(sd.ShipdragError, match='expected a Ship, or the path'):
        sd.estimate(record, ship=3)
    for verb in (sd.estimate, sd.diagnose):
        with pytest.raises(sd.ShipdragError, match='cannot be read: No such file'):
            verb(record, ship=tmp_path / 'none.yaml')
        with pytest.raises(sd.ShipdragError, match="stop is '602': expected seconds"):
            verb(record, stop='602')
    by_float, by_int = (sd.estimate(record, stop=stop) for stop in (602.0, np.int64(602)))
    assert by_int.summary() == by_float.summary()


def test_what_is_no_record_is_refused() -> None:
    with pytest.raises(sd.ShipdragError, match=r'make one with shipdrag_ros\.read'):
        sd.estimate(['run.mcap'])  # type: ignore[list-item]
    for verb in (sd.estimate, sd.diagnose):
        with pytest.raises(sd.ShipdragError, match=r'make one with shipdrag_ros\.read'):
            verb(None)  # type: ignore[operator]
    for source in (None, [3]):
        with pytest.raises(sd.ShipdragError, match='results of'):
            sd.trends(source)  # type: ignore[arg-type]
    for arguments, why in (
        ({'effects': 'fouling=0.3'}, 'give names with sizes'),
        ({'effects': [3.0] * 100}, r'effects \[3\.0, 3\.0, .{,30}\]: give names with sizes'),
        ({'effects': ['weed=1']}, "'weed' is not known"),
        ({'effects': [find('fouling')]}, 'friction_factor is missing, expected'),
        ({'seed': -1}, 'expected a whole number'),
        ({'lead_in': 3.0}, 'lead_in'),
        ({'duration_s': 1e12}, r'duration_s is 1e\+12, expected at most 1e\+06'),
        ({'effects': {'current': {'cross_track_m_s': 1.0}}}, 'along_track_m_s is missing'),
        ({'effects': {'weed': 1.0}}, "'weed' is not known"),
        ({'start': 'yesterday'}, 'expected a date of ISO 8601'),
    ):
        with pytest.raises(sd.ShipdragError, match=why):
            sd.simulate(sd.Ship.example(), **arguments)


def test_a_window_has_a_start_and_an_end(record: sd.Record) -> None:
    with pytest.raises(sd.ShipdragError, match='expected its start and end'):
        sd.estimate(record, window=5)  # type: ignore[arg-type]


def test_one_fact_may_stand_alone(record: sd.Record) -> None:
    with pytest.raises(sd.ShipdragError, match="fact 'a_guess'"):
        sd.diagnose(record, facts='a_guess')


def test_a_trend_says_what_it_is_of() -> None:
    nothing = sd.trends([])
    assert nothing.summary() == 'No coastdown was given: no trend.'
    with pytest.raises(sd.ShipdragError, match='there is no ship'):
        nothing.plot()
    with pytest.raises(sd.ShipdragError, match="no ship is called 'North'"):
        nothing.of('North')
    with pytest.raises(sd.ShipdragError, match='expected one of cleaning'):
        sd.trends([], events={'North': [('2026-03-01', 'painting')]})
    with pytest.raises(sd.ShipdragError, match='own events'):
        sd.trends('store', events={})


def test_a_simulation_takes_the_path_of_a_ship_a_date_and_the_name_of_a_sensor(tmp_path: Path):
    ship = tmp_path / 'ship.yaml'
    ship.write_text(sd.Ship.example().to_yaml())
    short = {'duration_s': 10.0, 'lead_in_s': 10.0, 'inputs': 'speed_through_water'}
    record = sd.simulate(ship, start=datetime(2026, 3, 1, tzinfo=UTC), **short)
    assert record.ship == sd.Ship.load(ship)
    assert {topic.topic for topic in record.runs[0].topics} == {'/speed_through_water'}
    same = sd.simulate(str(ship), start='2026-03-01', **short)
    assert record.runs[0].span_ns == same.runs[0].span_ns
    with pytest.raises(sd.ShipdragError, match='no ship is given'):
        sd.simulate(None)


def test_effects_are_given_by_name_or_as_a_list() -> None:
    ship, short = sd.Ship.example(), {'duration_s': 10.0, 'lead_in_s': 10.0}
    stated = [StatedEffect('fouling', {'friction_factor': Parameter(0.2, 0.0)})]
    for given in (['fouling=0.2'], stated, ('fouling=0.2',)):
        made = sd.simulate(ship, given, **short)
        assert made.truth.to_yaml() == sd.simulate(ship, {'fouling': 0.2}, **short).truth.to_yaml()
    assert made.truth.settings['effects'][0]['parameters'] == {'friction_factor': 0.2}
