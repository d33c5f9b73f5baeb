# SPDX-License-Identifier: Apache-2.0
"""A coastdown from its onset to its end: when estimates are due, and what they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import unwrap

from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    NoEstimate,
    NotCoastdown,
    Onset,
    Regimes,
    Update,
)
from shipdrag_ros.coastdown.heading import rep103_yaw
from shipdrag_ros.coastdown.memory import ALWAYS
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import rest_speed
from shipdrag_ros.coastdown.regimes.watch import Dated
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.estimators import WindowEstimator, shielded
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.forecast.result import Forecast, PathAhead
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

CutWindow = Callable[[int, int, int], Window]
"""From its first and last stamp, and the first of the record before it [ns]."""


class RunningCoastdown:
    """
    A coastdown that has begun.

    Parameters
    ----------
    onset
        When it began.
    heading
        Mean of the heading before it, as sent [rad]; NaN where none is known.
    dated
        As the histories have it then.
    cut
        Cuts a window from what is kept.
    ship, parameters
        As of the monitor.
    """

    def __init__(
        self,
        onset: Onset,
        heading: float,
        dated: Dated,
        *,
        cut: CutWindow,
        ship: Ship,
        parameters: Parameters,
    ) -> None:
        self.onset = onset
        self._heading_rad = (
            None if math.isnan(heading) else rep103_yaw(heading, parameters.heading_convention)
        )
        self._dated = dated
        self._cut = cut
        self._ship = ship
        self._parameters = parameters
        self._estimated = False

    def due_ns(self, stamp_ns: int) -> int:
        """
        Return the first time of an update at or after a stamp [ns].
        """
        start, step = self.onset.start_ns, round(self._parameters.update_s * SECOND_NS)
        return min(start + -(-(stamp_ns - start) // step) * step, ALWAYS)

    def update(
        self,
        stamp_ns: int,
        dated: Dated | None,
        estimator: WindowEstimator,
        *,
        gliding: bool = True,
    ) -> Event:
        """
        Estimate from what there is up to a stamp [ns], or say why that cannot be.

        It begins as the histories have it by then, `dated`; None: as they had it last. Nothing is
        foretold of a ship that is more probably not `gliding` any more.
        """
        self._dated = dated or self._dated
        window = self._window(stamp_ns)
        try:
            found = estimator(window, self._ship, self._parameters)
        except EstimationError as error:
            return NoEstimate(stamp_ns, str(error))
        # an estimator that is given may return what it likes
        if not self._estimated and isinstance(found, Estimate):
            self._estimated = not (why := too_vague(found, self._parameters))
            if why:
                return NoEstimate(stamp_ns, why)
        return self._with_forecast(stamp_ns, found, window) if gliding else Update(stamp_ns, found)

    def _with_forecast(self, stamp_ns: int, found: Estimate, window: Window) -> Update:
        try:
            return Update(stamp_ns, found, *_ahead(found, window, self._ship, self._parameters))
        except EstimationError:  # nothing is left to foretell
            return Update(stamp_ns, found)

    def end(
        self,
        dated: Dated,
        otherwise: EndedBy | None,
        regimes: Regimes | None,
        estimator: WindowEstimator,
    ) -> list[Event]:
        """
        Say what it was, as a whole.

        Parameters
        ----------
        dated
            As the histories have it.
        otherwise
            What ended it where no regime followed.
        regimes
            What she did.
        estimator
            Of whole coastdowns.
        """
        stop_ns, cuts = round(dated.stop_s * SECOND_NS), dated.cuts
        start_ns, end_ns = round(dated.start_s * SECOND_NS), round(dated.end_s * SECOND_NS)
        window = self._cut(start_ns, end_ns, start_ns - _steady_ns(dated, self._parameters))
        estimate, failure = None, None
        try:
            estimate = estimator(window, self._ship, self._parameters)
        except EstimationError as error:
            failure = str(error)
        ended_by = dated.ended_by or otherwise or EndedBy.ENGINE
        ended = EndedCoastdown(
            start_ns,
            end_ns,
            self.onset.detected_ns,
            ended_by if regimes is None else regimes.ended_by(ended_by, end_ns),
            estimate,
            failure,
            self._heading_rad,
            cuts=cuts,
            stop_ns=stop_ns,
            told_ns=window.told_ns,
            regimes=regimes,
        )
        return [ended, *cuts]

    def withdraw(
        self,
        was: NotCoastdown | None,
        ended_by: EndedBy | None,
        end_ns: int,
        regimes: Regimes | None,
    ) -> list[Event]:
        """
        Say that it was none after all, and what it was.
        """
        start_ns = self.onset.start_ns
        if was is None:
            was = NotCoastdown(start_ns, end_ns, Dismissal.OTHER, 'nothing slowed her after all')
        cut = NotCoastdown(start_ns, end_ns, was.reason, was.text)
        ended = EndedCoastdown(
            start_ns,
            end_ns,
            self.onset.detected_ns,
            ended_by or EndedBy.ENGINE,
            None,
            was.text,
            self._heading_rad,
            withdrawn=True,
            cuts=(cut,),
            regimes=regimes,
        )
        return [ended, cut]

    def _window(self, end_ns: int) -> Window:
        """Cut the coastdown so far, with the record before it where all of it is there."""
        begin_ns = min(round(self._dated.start_s * SECOND_NS), end_ns)
        start_ns = max(begin_ns, end_ns - round(self._parameters.window_s * SECOND_NS))
        before_ns = _steady_ns(self._dated, self._parameters) if start_ns == begin_ns else 0
        return self._cut(start_ns, end_ns, start_ns - before_ns)


def _steady_ns(dated: Dated, parameters: Parameters) -> int:
    """Return how much before a glide may be steady sailing: nothing, where she was not driven."""
    return 0 if dated.cuts else round(parameters.steady_s * SECOND_NS)


def _rest_of_the_glide(
    found: Estimate, window: Window, ship: Ship, parameters: Parameters
) -> tuple[Forecast, PathAhead | None]:
    """Foretell times, distances and places."""
    forecast = foretell(
        found,
        ship,
        froude_min=parameters.froude_min,
        speeds_m_s=parameters.forecast_speeds,
    )
    return forecast, PathAhead.of(window, forecast)


_ahead = shielded(_rest_of_the_glide, 'forecast', '')


def speed_at_rest(ship: Ship) -> float:
    """
    Return up to which speed a ship makes no way, as the regimes have it [m/s].
    """
    return float(unwrap(rest_speed)(HullPrior.any_body(ship)))  # one number needs no compiler


def too_vague(found: Estimate, parameters: Parameters) -> str:
    """
    Say why the first estimate of a coastdown is not given yet; '' if it is.
    """
    sigma, resistance = found.last_sigma_m_s2, found.last_resistance_m_s2
    share = parameters.first_relative_sigma
    if sigma < share * resistance:
        return ''
    known = f'{sigma / resistance:.0%} of it' if resistance > 0.0 else 'more than all of it'
    return (
        f'the resistance at {found.last_speed_m_s:.2f} m/s is uncertain by {known} so far; '
        f'the first figure waits until that is below {share:.0%}'
    )
