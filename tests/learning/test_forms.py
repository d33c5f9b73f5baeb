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
SPAN = Span(1.0, 7.0, 1500.0, log=True, days=(20000.0, 20009.0), depth_m=(10.0, 30.0))
FORMS = forms(SHIP, SPAN)


def test_there_are_forms_by_each_variable() -> None:
    assert len(FORMS) >= 60
    by_force = {form.kind[1] for form in FORMS if form.kind[0] == 'force'}
    assert by_force == {'speed', 'time', 'heading', 'date', 'depth'}
    assert {form.kind[1] for form in FORMS if form.kind[0] == 'log'} == {'speed', 'time'}
    assert len({form.term.name for form in FORMS}) == len(FORMS)


@pytest.mark.parametrize('form', FORMS, ids=lambda form: form.term.term.expression)
def test_each_acts_at_every_start(form: LearnableForm) -> None:
    scenario = Scenario(speed_m_s=7.0, heading_rad=0.4, day=20005.0, depth_m=15.0)
    frame, speed, after = (
        Frame(SHIP, scenario, 0.4),
        np.linspace(7.0, 1.0, 30),
        np.arange(30) * 50.0,
    )
    acts = []
    for way in form.ways(SHIP, 1500.0, 4):
        action = way.action(frame, way.tried())
        shown = [action.resistance_n(speed), *(each(speed, after) for each in action.log_error)]
        acts.append(np.abs(shown).max() + len(action.turns))
        assert np.isfinite(shown).all()
    assert max(acts) > 0.0


def test_a_hump_has_a_width_of_its_own() -> None:
    humps = [form for form in FORMS if form.kind[2] == 'hump']
    assert {form.kind[:2] for form in humps} == {('force', 'speed'), ('force', 'time')} | {
        ('log', 'speed'),
        ('log', 'time'),
    }
    scenario = Scenario(speed_m_s=7.0, day=20005.0, depth_m=15.0)
    speed = np.linspace(0.5, 7.0, 400)
    form = next(form for form in humps if form.kind[:2] == ('force', 'speed'))
    effect = form.effect()
    places = [q.name for q in effect.parameters]
    assert places == ['A', 'u_c', 'w']
    root = float(SHIP.speed(1.0))
    for width in (0.01, 0.02):
        action = effect.action(Frame(SHIP, scenario, 0.0), 0.01, 4.0 / root, width)
        over = action.resistance_n(speed) / speed ** (
            2 if 'u**2*exp' in form.term.term.expression else 0
        )
        half = speed[over > over.max() / np.e]
        assert half[-1] - half[0] == pytest.approx(2.0 * width * root, rel=0.05)


def test_what_the_runs_do_not_hold_is_not_tried() -> None:
    kinds = {form.kind[:2] for form in forms(SHIP, Span(1.0, 7.0, 1500.0))}
    assert kinds == {('force', 'speed'), ('force', 'time'), ('force', 'heading')}


def test_something_smooth_is_more_probable_than_any_form() -> None:
    for form in FORMS:
        # of nine days: what changes a hull once in a hundred days is rarer
        rare = 0.09 if form.kind[1] == 'date' else 1.0
        assert form.effect().odds == pytest.approx(
            rare * priors.UNNAMED_ODDS.mean / SMOOTH_OVER_FORM
        )
    assert 10.0 <= SMOOTH_OVER_FORM <= 100.0
