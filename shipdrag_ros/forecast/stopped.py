# SPDX-License-Identifier: Apache-2.0
"""If the engine were stopped now: the glide of a ship under power, by her hull as last known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.force import clean_hull
from shipdrag_ros.forecast import priors
from shipdrag_ros.forecast.foretell import Beginning, foretell_from
from shipdrag_ros.forecast.law import KnownCurve
from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.parameters import SPEEDS_M_S
from shipdrag_ros.posterior.priors import RUN_DOWN
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import action_of
from shipdrag_ros.simulation.scenario import Scenario

_POINTS = 60
_LOWEST = 0.05  # of the highest speed of a baseline


@dataclass(frozen=True)
class HullNow:
    """
    r(v) as last known, and where that is from, in words.
    """

    known: KnownCurve
    source: str

    @classmethod
    def of_run(
        cls, speed_m_s: Float64, resistance_m_s2: Float64, sigma_m_s2: Float64, source: str
    ) -> HullNow:
        """
        Take the curve of a coastdown that has ended; the next run differs from it.
        """
        alike = np.full(len(speed_m_s), priors.ALIKE.mean)
        level_sd = priors.ANOTHER_RUN.sd
        return cls(KnownCurve(speed_m_s, resistance_m_s2, sigma_m_s2, alike, level_sd), source)

    @classmethod
    def of_file(cls, ship: Ship) -> HullNow:
        """
        Take the baseline of a ship file and the effects that stand in it.

        Raises
        ------
        EstimationError
            If it states no baseline.
        SimulationError
            If one of its effects cannot be simulated.
        """
        if ship.baseline is None:
            raise EstimationError(
                'neither a coastdown nor a baseline of the ship file says how the hull slows her: '
                'state `baseline` in the ship file, or make a coastdown'
            )
        low, high = ship.baseline_range_m_s
        speed = np.linspace(max(low, _LOWEST * high), high, _POINTS)
        newtons, sd = clean_hull(ship, speed)
        mass, added = ship.mass_kg, np.zeros(_POINTS)
        for effect in ship.effects:
            action = action_of(Frame(ship, Scenario(speed_m_s=high), 0.0), [effect])
            mass += action.mass_fraction * ship.mass_kg
            more = action.resistance_n(speed)
            added = added + more
            sd = np.hypot(sd, _relative_sd(effect) * more)
        source = 'the clean hull of the ship file'
        if ship.effects:
            source = f'the ship file, with {", ".join(each.name for each in ship.effects)}'
        r = (newtons + added) / mass
        # a file errs alike at all speeds
        level_sd = float(np.hypot(priors.ANOTHER_RUN.sd, np.mean(sd / (newtons + added))))
        return cls(
            KnownCurve(speed, r, priors.FORM_OFF.sd * r, np.ones(_POINTS), level_sd), source
        )


def _relative_sd(effect: StatedEffect) -> float:
    """Return that of what an effect does, which grows with each of its numbers."""
    stated = [each for each in effect.parameters.values() if math.isfinite(each.value)]
    return math.hypot(*(each.sd / abs(each.value) for each in stated if each.value))


def if_stopped(
    hull: HullNow,
    ship: Ship,
    speed_m_s: float,
    now_ns: int,
    *,
    speed_sd_m_s: float = 0.0,
    gliding: bool = False,
    speeds_m_s: tuple[float, ...] = SPEEDS_M_S,
) -> Forecast:
    """
    Foretell the glide that would begin now, with the run-down of the shaft.

    Parameters
    ----------
    hull
    ship
        For n_r, the run-down and the law beyond what is known.
    speed_m_s, now_ns
        Present speed through water, and when she has it [ns].
    speed_sd_m_s
        Of the present speed.
    gliding
        The shaft has run down already.
    speeds_m_s
        Spoken of, beside shares of the present speed.

    Raises
    ------
    EstimationError
        If she lies still.
    """
    if not speed_m_s > 0.0:
        raise EstimationError('she makes no way, there is no glide to foretell')
    run_down = ship.propulsion or Propulsion(RUN_DOWN.mean, RUN_DOWN.mean * RUN_DOWN.sd)
    now = Beginning(
        made_ns=now_ns,
        stop_m_s=speed_m_s,
        speed_m_s=speed_m_s,
        speed_sd_m_s=speed_sd_m_s,
        run_down_s=0.0 if gliding else run_down.run_down_s,
        run_down_sd_s=0.0 if gliding else run_down.sd,
    )
    return foretell_from(now, hull.known, ship, speeds_m_s=speeds_m_s)
