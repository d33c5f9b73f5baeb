# SPDX-License-Identifier: Apache-2.0
"""Runs as the posterior takes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.sights import sight
from shipdrag_ros.posterior import motion
from shipdrag_ros.ship import Ship


def test_the_speed_of_a_run_is_its_own_and_the_law_reaches_over_all(
    seen_of: Callable[..., Observation], cargo: Ship
) -> None:
    fast = seen_of()
    slow = replace(fast, name='slow', speed_m_s=0.5 * fast.speed_m_s)
    alone, beside = (sight(slow, seen, cargo).model for seen in ([slow], [fast, slow]))
    for model in (alone, beside):
        at = model.coefficients + motion.SPEED
        for family in model.families:
            assert family.mean[at] == pytest.approx(slow.speed_m_s)
            assert family.precision[at] == pytest.approx((0.3 * slow.speed_m_s) ** -2)
    assert alone.law.speed_m_s[-1] < fast.speed_m_s < beside.law.speed_m_s[-1]
