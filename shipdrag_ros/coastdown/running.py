# SPDX-License-Identifier: Apache-2.0
"""A coastdown from its onset to its end: when estimates are due, and what they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from shipdrag_ros.coastdown.events import (
    EndedBy,
    EndedCoastdown,
    Event,
    NoEstimate,
    NotCoastdown,
    Onset,
    Update,
)
from shipdrag_ros.coastdown.examination import estimate_examined, estimate_kept
from shipdrag_ros.coastdown.memory import ALWAYS
from shipdrag_ros.coastdown.onset import Doubt
from shipdrag_ros.coastdown.tracking import rep103_yaw
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.estimator import WindowEstimator
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.shield import shielded
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.forecast.path import PathAhead
from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

CutWindow = Callable[[int, int, int], Window]
"""From its first and last stamp, and the first of the record before it [ns]."""


class Chosen(NamedTuple):
    """A start [ns] and the parts about it that are no coastdown, as the regimes have them."""

    start_ns: int
    cuts: tuple[NotCoastdown, ...]


class RunningCoastdown:
    """
    A coastdown that has begun.

    Parameters
    ----------
    onset
        When it began.
    heading
        Mean of the heading before it, as sent [rad]; NaN where none is known.
    cut
        Cuts a window from what is kept.
    ship, parameters
        As of the monitor.
    """

    def __init__(
        self,
        onset: Onset,
        heading: float,
        *,
        cut: CutWindow,
        ship: Ship,
        parameters: Parameters,
    ) -> None:
        self.onset = onset
        self._heading_rad = (
            None if math.isnan(heading) else rep103_yaw(heading, parameters.heading_convention)
        )
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

    def update(self, stamp_ns: int, estimator: WindowEstimator, *, gliding: bool = True) -> Event:
        """
        Estimate from what there is up to a stamp [ns], or say why that cannot be.

        Nothing is foretold of a ship that is more probably not `gliding` any more.
        """
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
        ended_by: EndedBy,
        end_ns: int,
        doubt: Doubt | None,
        estimator: WindowEstimator,
        chosen: Chosen | None = None,
    ) -> list[Event]:
        """
        Say what it was, as a whole.

        Parameters
        ----------
        ended_by, end_ns
            What ended it, and when [ns].
        doubt
            Why it was none after all.
        estimator
            Of whole coastdowns.
        chosen
            What the regimes say of it; None: the rules examine it.
        """
        start_ns, final, failure = self.onset.start_ns, None, None
        cuts: tuple[NotCoastdown, ...] = ()
        stretch: tuple[tuple[int, float], ...] = ()
        if doubt is None:
            if chosen is None:
                window = self._window(end_ns)
                found = estimate_examined(window, self._ship, self._parameters, estimator)
            else:
                before_ns = round(self._parameters.steady_s * SECOND_NS)
                window = self._cut(
                    chosen.start_ns, end_ns, chosen.start_ns - before_ns * (not chosen.cuts)
                )
                start_ns = chosen.start_ns
                found = estimate_kept(window, chosen.cuts, self._ship, self._parameters, estimator)
            cuts, final, failure, end_ns = found.cuts, found.estimate, found.failure, found.end_ns
            stretch = found.stretch
            if found.start_ns != window.start_ns:  # later too where an old part has rolled out
                start_ns = found.start_ns
            refused = found.refused
        else:
            failure, refused = f'withdrawn: {doubt.text}', True
            cuts = (NotCoastdown(start_ns, end_ns, doubt.reason, failure),)
        ended = EndedCoastdown(
            start_ns,
            end_ns,
            self.onset.detected_ns,
            ended_by,
            final,
            failure,
            self._heading_rad,
            refused,
            cuts,
            stretch,
        )
        return [ended, *cuts]

    def _window(self, end_ns: int) -> Window:
        """Cut the coastdown so far, with the record before it where all of it is there."""
        window_ns = round(self._parameters.window_s * SECOND_NS)
        start_ns = max(self.onset.start_ns, end_ns - window_ns)
        before_ns = round(self._parameters.steady_s * SECOND_NS)
        first_ns = start_ns - before_ns if start_ns == self.onset.start_ns else start_ns
        return self._cut(start_ns, end_ns, first_ns)


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
