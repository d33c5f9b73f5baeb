# SPDX-License-Identifier: Apache-2.0
"""
Rows of measurements along one direction, and the noise of places to port of it.

The noise is that of the steady record before the stop, colour included: what a
coastdown leaves over a fit would hold the very effect that is sought. Beside it stands
what a ship wanders by as she glides, which no steady record shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from shipdrag_ros.inference.learning import learn, of_steady
from shipdrag_ros.inference.noise import WHITE, Noise, noise_of, whiten
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

_SLOWEST = 0.02  # of the speed at the stop, that a glide is followed to
_SPEEDS = 200


@dataclass(frozen=True)
class Measured:
    """
    Rows along one direction, in ascending time.

    Attributes
    ----------
    at : (n,)
        Places of the rows in the times of the observation.
    rows
        `POSITION` rows are distances along the direction [m].
    variance : (n,)
        Of the white noise of each.
    """

    at: Int64
    rows: Rows
    variance: Float64

    @classmethod
    def of(cls, rows: Rows, variance: Float64, times: Float64) -> Measured:
        """
        Find rows among the times of all rows of the observation, (m,), ascending [s].
        """
        return cls(np.searchsorted(times, rows.time_s), rows, variance)

    def __len__(self) -> int:
        return len(self.at)


def whitener_of(
    found: Measured, ship: Ship, speed_m_s: float, lead_in_s: float, margin_s: float
) -> Float64:
    """
    Return the inverse Cholesky factor (n, n) of the noise of rows, by that of their steady part.

    Parameters
    ----------
    found
    ship
    speed_m_s
        In the lead-in, roughly.
    lead_in_s
        Length of the steady part, the stop at its end.
    margin_s
        Before the stop, that is not learnt from.
    """
    rows, time = found.rows, found.rows.time_s
    steady = time < lead_in_s - margin_s
    damping, inertia = damping_of(ship, np.array([speed_m_s]))
    seen = of_steady(
        Rows(time[steady], rows.kind[steady], rows.value[steady]),
        found.variance[steady],
        float(damping[0]),
        float(inertia[0]),
    )
    # the engine damps the steady record; behind the stop the hull does
    learnt = learn(seen, speed_m_s).typical
    speed = _slowed_m_s(ship, speed_m_s, time - lead_in_s)
    whitener = np.eye(len(time))
    white = Noise(found.variance, WHITE, *damping_of(ship, speed))
    whiten(rows, whitener, noise_of(learnt, 0, rows, white, int(np.searchsorted(time, lead_in_s))))
    shaken = np.linalg.inv(whitener.T)
    sailed = np.tril(np.broadcast_to(speed * np.diff(time, prepend=time[0]), shaken.shape))
    wandered = sailed @ yaw_wander(time) @ sailed.T
    return np.linalg.inv(np.linalg.cholesky(shaken @ shaken.T + wandered))


def _slowed_m_s(ship: Ship, speed_m_s: float, after_s: Float64) -> Float64:
    """Return the speed (n,) some time after the stop, by her baseline in calm deep water."""
    speed = speed_m_s * np.geomspace(1.0, _SLOWEST, _SPEEDS)
    stated = np.clip(speed, *ship.baseline_range_m_s)
    # beyond what the baseline states, as its square
    r = ship.resistance_n(stated) / ship.mass_kg * (speed / stated) ** 2
    glided_s = cumulative_trapezoid((1.0 + ship.n_r(stated)) / r, -speed, initial=0.0)
    return np.interp(after_s, glided_s, speed)


def yaw_wander(time_s: Float64) -> Float64:
    """
    Return the covariance (n, n) of what a heading, and the course with it, wanders by.

    A steady record shows it while she is steered with way on, not as she glides.

    Parameters
    ----------
    time_s : (n,)
    """
    apart = np.abs(time_s[:, None] - time_s) / priors.YAW_WANDERS_S.mean
    return priors.YAW_WANDERS.sd**2 * np.exp(-apart)


def damping_of(ship: Ship, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """
    Return how a ship's speed answers a small force.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s : (n,)
        Through water.

    Returns
    -------
    damping_1_s, inertia : (n,)
        dr/dv / (1 + n_r) and 1 + n_r of the baseline.
    """
    low, high = ship.baseline_range_m_s
    speed = np.clip(speed_m_s, max(low, 1e-3 * high), high)
    step = 1e-3 * speed
    above, below = np.minimum(speed + step, high), np.maximum(speed - step, low)
    rise = ship.resistance_n(above) - ship.resistance_n(below)
    inertia = 1.0 + ship.n_r(speed)
    damping = np.maximum(rise / (above - below), 0.0) / (ship.mass_kg * inertia)
    return np.maximum(damping, 1e-6), inertia
