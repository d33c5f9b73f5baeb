# SPDX-License-Identifier: Apache-2.0
"""Pictures show the data that they are given."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.replay.hulls import Hull
from shipdrag_ros.replay.truth import TrueCurve
from shipdrag_ros.report import drawing, pictures


def line(axis: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    (found,) = [item for item in axis.get_lines() if item.get_label() == label]
    x, y = found.get_data()
    return np.asarray(x), np.asarray(y)


def test_a_track_is_shown_measured_fitted_and_left_over(estimate: Estimate) -> None:
    figure = pictures.track_picture(estimate)
    assert len(figure.axes) == 4
    track = estimate.tracks['position']
    np.testing.assert_array_equal(line(figure.axes[1], 'measured')[1], track.measured)
    time_s, fitted = line(figure.axes[1], 'fitted')
    np.testing.assert_array_equal(fitted, track.fitted)
    np.testing.assert_allclose(time_s, np.arange(1500.0), atol=1e-6)
    left_over = figure.axes[3].get_lines()[0].get_ydata()
    np.testing.assert_array_equal(left_over, track.measured - track.fitted)
    assert 'rms' in figure.axes[3].get_title(loc='left')


def test_one_input_takes_one_column(estimate: Estimate) -> None:
    alone = replace(estimate, tracks={'position': estimate.tracks['position']})
    assert len(pictures.track_picture(alone).axes) == 2


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


def test_the_curve_has_its_band_range_scales_and_truth(
    estimate: Estimate, truth: TrueCurve
) -> None:
    axis = pictures.resistance_picture(estimate, mass_kg=2e7, truth=truth).axes[0]
    speed, r = line(axis, 'estimated r')
    np.testing.assert_array_equal(speed, estimate.valid_curve.speed_m_s)
    np.testing.assert_array_equal(r, estimate.valid_curve.resistance_m_s2)
    np.testing.assert_array_equal(line(axis, 'true r of the simulation')[1], truth.resistance_m_s2)
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert 'valid range, Fr 0.050 to 0.180' in labels
    assert 'outside: not to be used' in labels
    everywhere = replace(estimate, froude_valid=(0.0, 1.0))
    legend = pictures.resistance_picture(everywhere).axes[0].get_legend()
    assert 'outside: not to be used' not in [text.get_text() for text in legend.get_texts()]
    band = next(item for item in axis.collections if '±2' in str(item.get_label()))
    top = band.get_paths()[0].vertices[:, 1].max()
    curve = estimate.valid_curve
    np.testing.assert_allclose(top, (curve.resistance_m_s2 + 2 * curve.sigma_m_s2).max())
    assert len(axis.child_axes) == 2
    assert axis.child_axes[1].get_ylabel() == 'resistance [kN]'
    light = pictures.resistance_picture(estimate, mass_kg=14.0).axes[0]
    assert light.child_axes[1].get_ylabel() == 'resistance [N]'

    plain = pictures.resistance_picture(estimate).axes[0]
    assert len(plain.child_axes) == 1
    assert 'true r of the simulation' not in [item.get_label() for item in plain.get_lines()]


def test_an_empty_valid_range_is_drawn_without_one(estimate: Estimate) -> None:
    empty = replace(estimate, froude_valid=(0.9, 0.9))
    drawing.data_uri(pictures.resistance_picture(empty))


def test_hulls_beyond_the_colours_are_still_drawn(estimate: Estimate) -> None:
    hulls = [
        Hull(f'hull {n}', 0.1, FroudeMax.INFLECTION, (), estimate.valid_curve) for n in range(8)
    ]
    axis = pictures.comparison_picture(hulls).axes[0]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        hull.label for hull in hulls
    ]
    (dot,) = [line for line in axis.get_lines() if line.get_marker() == 'o'][:1]
    assert dot.get_xdata() == [0.1]


@pytest.mark.parametrize('name', ['picture.svg', 'picture.png'])
def test_a_picture_is_saved_as_its_name_says(
    estimate: Estimate, tmp_path: Path, name: str
) -> None:
    drawing.save(pictures.order_picture(estimate), tmp_path / name)
    head = (tmp_path / name).read_bytes()[:100]
    assert head.startswith(b'\x89PNG') if name.endswith('png') else b'<?xml' in head


def test_the_same_data_give_the_same_bytes(estimate: Estimate) -> None:
    first, second = (drawing.data_uri(pictures.order_picture(estimate)) for _ in range(2))
    assert first == second
    kind, data = first.split(',', 1)
    assert kind == 'data:image/svg+xml;base64'
    assert b'</svg>' in base64.b64decode(data)
