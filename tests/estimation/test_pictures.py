# SPDX-License-Identifier: Apache-2.0
"""Pictures show the data that they are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.estimation import pictures
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.report import drawing
from shipdrag_ros.ship import Ship, TableBaseline


def line(axis: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    (found,) = [item for item in axis.get_lines() if item.get_label() == label]
    x, y = found.get_data()
    return np.asarray(x), np.asarray(y)


def test_a_track_is_shown_measured_fitted_and_left_over(estimate: Estimate, ship: Ship) -> None:
    speed, position = pictures.track_pictures(estimate, ship.mass_kg)
    track = estimate.tracks['position']
    np.testing.assert_array_equal(line(position.axes[0], 'measured')[1], track.measured)
    minutes, fitted = line(position.axes[0], 'fitted')
    np.testing.assert_array_equal(fitted, track.fitted)
    np.testing.assert_allclose(minutes, np.arange(1500.0) / 60.0, atol=1e-6)
    left_over = position.axes[1].get_lines()[0].get_ydata()
    np.testing.assert_array_equal(left_over, track.measured - track.fitted)
    assert 'rms' in position.axes[1].get_title(loc='left')
    # speeds are in knots, those of a model in m/s
    log = estimate.tracks['speed_through_water'].measured
    assert speed.axes[0].get_ylabel() == '[knots]'
    np.testing.assert_allclose(line(speed.axes[0], 'measured')[1], log / M_S_PER_KNOT)
    model, _ = pictures.track_pictures(estimate, 14.0)
    assert model.axes[0].get_ylabel() == '[m/s]'
    np.testing.assert_array_equal(line(model.axes[0], 'measured')[1], log)


def test_one_input_takes_one_picture(estimate: Estimate) -> None:
    alone = replace(estimate, tracks={'position': estimate.tracks['position']})
    assert len(pictures.track_pictures(alone, 1e7)) == 1


def test_orders_are_shown_for_each_input_and_the_joint_problem(estimate: Estimate) -> None:
    figure = pictures.order_picture(estimate)
    assert len(figure.axes) == 3
    orders, variance = figure.axes[0].get_lines()[0].get_data()
    np.testing.assert_array_equal(orders, np.arange(1, 13))
    np.testing.assert_array_equal(variance, [trial.variance for trial in estimate.orders])
    assert line(figure.axes[0], 'chosen: 5')[0][0] == 5

    nan = float('nan')
    speed_only = tuple(replace(trial, variance_position=nan) for trial in estimate.orders)
    figure = pictures.order_picture(replace(estimate, orders=speed_only, order=None))
    assert len(figure.axes) == 1
    assert len(figure.axes[0].get_lines()) == 1


def test_the_curve_has_its_band_range_scales_and_truth(estimate, ship, truth):
    known = (truth.speed_m_s, truth.resistance_m_s2)
    axis = pictures.resistance_picture(estimate, ship, truth=known).axes[0]
    curve, kilo = estimate.valid_curve, ship.mass_kg / 1000.0
    knots, force = line(axis, 'today')
    np.testing.assert_allclose(knots, curve.speed_m_s / M_S_PER_KNOT)
    np.testing.assert_allclose(force, kilo * curve.resistance_m_s2)
    true = line(axis, 'truth of the simulation')[1]
    np.testing.assert_allclose(true, kilo * truth.resistance_m_s2)
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert 'valid range, Fr 0.050 to 0.180' in labels
    assert 'outside: not to be used' in labels
    everywhere = replace(estimate, froude_valid=(0.0, 1.0))
    legend = pictures.resistance_picture(everywhere, ship).axes[0].get_legend()
    assert 'outside: not to be used' not in [text.get_text() for text in legend.get_texts()]
    band = next(item for item in axis.collections if '±2' in str(item.get_label()))
    top = band.get_paths()[0].vertices[:, 1].max()
    np.testing.assert_allclose(top, kilo * (curve.resistance_m_s2 + 2 * curve.sigma_m_s2).max())
    assert axis.get_ylabel() == 'resistance [kN]'
    assert [other.get_ylabel() for other in axis.child_axes] == [
        '',
        'specific resistance r [m/s²]',
    ]

    model = replace(ship, displaced_volume_m3=0.014)
    light = pictures.resistance_picture(estimate, model).axes[0]
    assert (light.get_xlabel(), light.get_ylabel()) == (
        'speed through water [m/s]',
        'resistance [N]',
    )
    assert len(light.child_axes) == 1
    assert 'truth of the simulation' not in [item.get_label() for item in light.get_lines()]


def test_a_curve_is_drawn_over_the_clean_hull(estimate: Estimate, ship: Ship) -> None:
    clean = TableBaseline((1.0, 9.0), (2e4, 4e5), 0.05)
    stated = replace(ship, baseline=clean)
    force = pictures.resistance_picture(estimate, stated).axes[0]
    knots, kilonewtons = line(force, 'clean hull')
    inside = np.isfinite(kilonewtons)
    np.testing.assert_allclose(
        kilonewtons[inside], stated.resistance_n(knots[inside] * M_S_PER_KNOT) / 1000.0
    )
    power = pictures.power_picture(estimate.valid_curve, stated).axes[0]
    knots, kilowatts = line(power, 'today')
    curve = estimate.valid_curve
    np.testing.assert_allclose(
        kilowatts, ship.mass_kg * curve.resistance_m_s2 * curve.speed_m_s / 1000.0
    )
    assert 'clean hull' in [item.get_label() for item in power.get_lines()]
    bare = pictures.power_picture(curve, ship).axes[0]
    assert 'clean hull' not in [item.get_label() for item in bare.get_lines()]


def test_coastdowns_are_drawn_by_their_dates(estimate: Estimate, ship: Ship) -> None:
    dated = [(f'2026-0{n}-01', estimate.valid_curve) for n in range(1, 9)]
    axis = pictures.curves_picture(dated, ship).axes[0]
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert labels == [label for label, _ in dated]
    assert len({line.get_color() for line in axis.get_lines()}) == len(dated)  # told apart
    (alone,) = pictures.curves_picture(dated[:1], ship).axes[0].collections
    assert '±2' in str(alone.get_label())


def test_an_empty_valid_range_is_drawn_without_one(estimate: Estimate, ship: Ship) -> None:
    empty = replace(estimate, froude_valid=(0.9, 0.9))
    drawing.data_uri(pictures.resistance_picture(empty, ship))
