# SPDX-License-Identifier: Apache-2.0
"""Pictures show what was found, in its order."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.studies.manoeuvring.ship import mariner
from shipdrag_ros.studies.manoeuvring.simulate import turn, zigzag
from shipdrag_ros.studies.sensitivity.face import coasting, steering
from shipdrag_ros.studies.sensitivity.steering import experiment


def names(labels) -> list[str]:
    return [label.get_text() for label in labels]


def test_bars_of_kept_and_dropped_derivatives(steered):
    axis = steering.ranking_picture(steered).axes[0]
    shown = [label.split()[-1] for label in names(axis.get_yticklabels())]
    assert shown == list(steered.losses.ranking)
    assert names(axis.get_yticklabels())[0] == 'yaw moment by rudder  Nd'
    kept, dropped = axis.containers
    assert (len(kept), len(dropped)) == (24, 16)
    assert kept[0].get_width() == pytest.approx(float(np.max(steered.losses.mean)))


def test_three_models_in_four_panels(steered):
    figure = steering.check_picture(steered)
    assert [len(axis.lines) for axis in figure.axes] == [3, 3, 3, 3]
    legend = names(figure.legends[0].get_texts())
    assert legend == ['full', '24 derivatives kept', '18 measurements kept']
    full = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(full, np.degrees(steered.check.full.heading_rad))


def test_a_map_with_a_dot_at_the_best_manoeuvre():
    shown = experiment(mariner(), (zigzag(10.0), turn(35.0)))
    axis = steering.design_picture(shown).axes[0]
    assert names(axis.get_yticklabels()) == ['zigzag:10', 'turn:35']
    dots = axis.lines[0].get_ydata()
    assert [shown.manoeuvres[int(i)] for i in dots] == list(shown.best)


def test_bars_of_values_and_of_effects(coasted):
    axis = coasting.particulars_picture(coasted).axes[0]
    order = [*coasted.selection.kept, *coasted.selection.dropped]
    assert names(axis.get_yticklabels()) == order
    wide = {bar.get_y(): bar.get_width() for bar in axis.containers[0]}
    assert wide[max(wide)] == max(wide.values())
    axis = coasting.mimic_picture(coasted).axes[0]
    assert names(axis.get_yticklabels()) == [mimic.effect.name for mimic in coasted.mimics]
    assert axis.texts[0].get_text().startswith(coasted.mimics[0].particular.key)
