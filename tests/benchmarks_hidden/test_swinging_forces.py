# SPDX-License-Identifier: Apache-2.0
"""Forces that swing: what the benchmark hides, and that a diagnosis sees it."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.mark.parametrize(('kind', 'before'), [('after the stop', False), ('all the time', True)])
def test_the_force_swings_after_the_stop_or_always(kind: str, before: bool) -> None:
    import swinging_forces
    from hidden import cases

    case = cases._case(4, swinging_forces.KINDS[kind])
    leg, (effect,) = case.voyages[0].leg, case.effects
    time = np.arange(-1800.0, leg.duration_s)
    force = np.asarray(effect.force_n(leg, time))
    steady = float(leg.hull.still_n(np.array([leg.speed_m_s]))[0])
    assert np.any(force[time < 0.0] != 0.0) == before
    assert 0.05 * steady <= np.abs(force).max() <= 0.25 * steady
    again = cases.observe_hiding(4, ())
    assert again.ship_file == cases.observe(4).ship_file


@pytest.mark.timeout(1200)  # all of a diagnosis may have to be compiled first
def test_a_force_that_begins_to_swing_is_unknown() -> None:
    import swinging_forces

    assert swinging_forces.answer((4, 'after the stop')) == 'unknown'
