# SPDX-License-Identifier: Apache-2.0
"""The forms that are tried are sound terms, and each does something."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.learning.forms import SMOOTH_OVER_FORM, LearnableForm, Span, forms
from shipdrag_ros.posterior import priors
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario
from shipdrag_ros.simulation.effect import Frame

SHIP = Ship.example()
FORMS = forms(SHIP, Span(1.0, 7.0, 1500.0))


def test_there_are_forms_by_each_variable() -> None:
    assert len(FORMS) >= 40
    assert {form.kind[0] for form in FORMS} == {'speed', 'time', 'heading'}
    assert len({form.term.name for form in FORMS}) == len(FORMS)


@pytest.mark.parametrize('form', FORMS, ids=lambda form: form.term.form.expression)
def test_each_acts_at_every_start(form: LearnableForm) -> None:
    frame = Frame(SHIP, Scenario(speed_m_s=7.0, heading_rad=0.4), 0.4)
    speed = np.linspace(1.0, 7.0, 30)
    acts = []
    for way in form.ways(SHIP, 1500.0, 4):
        action = way.action(frame, way.tried())
        acts.append(np.abs(action.resistance_n(speed)).max() + len(action.turns))
        assert np.isfinite(action.resistance_n(speed)).all()
    assert max(acts) > 0.0


def test_something_smooth_is_more_probable_than_any_form() -> None:
    for form in FORMS:
        assert form.effect().odds == pytest.approx(priors.UNNAMED_ODDS / SMOOTH_OVER_FORM)
    assert 10.0 <= SMOOTH_OVER_FORM <= 100.0
