# SPDX-License-Identifier: Apache-2.0
"""Two estimators of one window: where they disagree, the band says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.samples import Float64

# Differences over the root of the sum of both variances; both share the data, so that a clean
# record makes less. Chosen on 1000 simulated clean coastdowns (four ships, 100 and 500 samples,
# seeds 0..24; white noise, steady record, run-down, current and outliers, gusts learnt), of which
# 1 is taken to disagree.
ALLOWED = 2.0
_POINTS = 65  # evenly in speed, of the comparison


def widened(found: Estimate, other: Estimate, below_m_s: float) -> Estimate:
    """
    Widen the band of an estimate where another differs by more than both bands allow.

    Parameters
    ----------
    found, other
        Of the same window.
    below_m_s
        Above this speed they are not compared: what the other knows of the
        thrust is not enough there.

    Returns
    -------
    Estimate
        With what exceeds `ALLOWED` joint standard deviations added in quadrature,
        and a note with both figures; unchanged where nothing does.
    """
    mine, its = found.curve, other.valid_curve
    top = min(mine.speed_m_s[-1], below_m_s)
    if len(its) < 2 or min(top, its.speed_m_s[-1]) <= max(mine.speed_m_s[0], its.speed_m_s[0]):
        return found
    speeds = np.linspace(
        max(mine.speed_m_s[0], its.speed_m_s[0]), min(top, its.speed_m_s[-1]), _POINTS
    )
    r, sigma = _at(mine, speeds)
    its_r, its_sigma = _at(its, speeds)
    square = (r - its_r) ** 2 - ALLOWED**2 * (sigma**2 + its_sigma**2)
    worst = int(np.argmax(square))
    if square[worst] <= 0.0:
        return found
    excess = np.interp(mine.speed_m_s, speeds, np.sqrt(np.maximum(square, 0.0)))
    apart = speeds[square > 0.0]
    note = (
        f'two estimators disagree at {apart[0]:.3g} to {apart[-1]:.3g} m/s: at '
        f'{speeds[worst]:.3g} m/s {found.estimator} says '
        f'{r[worst]:.3g} ± {2.0 * sigma[worst]:.1g} m/s², {other.estimator} '
        f'{its_r[worst]:.3g} ± {2.0 * its_sigma[worst]:.1g} (two standard deviations); the band '
        'is widened to hold both: look for what is not a coastdown in the window'
    )
    return _with_excess(found, excess, note)


def _at(curve: ResistanceCurve, speeds: Float64) -> tuple[Float64, Float64]:
    """Return r and its repeatable sigma at some speeds."""
    return (
        np.interp(speeds, curve.speed_m_s, curve.resistance_m_s2),
        np.interp(speeds, curve.speed_m_s, curve.sigma_repeatable_m_s2),
    )


def _with_excess(found: Estimate, excess: Float64, note: str) -> Estimate:
    """Add an error (m,) to the band of an estimate."""
    curve = replace(
        found.curve,
        sigma_m_s2=np.hypot(found.curve.sigma_m_s2, excess),
        sigma_repeatable_m_s2=np.hypot(found.curve.sigma_repeatable_m_s2, excess),
    )
    at_last = float(np.interp(found.last_speed_m_s, curve.speed_m_s, excess))
    wider = replace(
        found,
        curve=curve,
        last_sigma_m_s2=float(np.hypot(found.last_sigma_m_s2, at_last)),
        notes=(*found.notes, note),
    )
    valid = wider.valid_curve
    return replace(
        wider,
        max_relative_sigma=float(valid.sigma_repeatable_m_s2.max() / valid.resistance_m_s2.max()),
    )
