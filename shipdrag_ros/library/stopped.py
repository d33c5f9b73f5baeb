# SPDX-License-Identifier: Apache-2.0
"""If the engine were stopped at the end of a record: the hull as last known, the present speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.display import Table, ship_speed, utc
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.forecast import words
from shipdrag_ros.forecast.result import Forecast, Milestone
from shipdrag_ros.forecast.stopped import HullNow, if_stopped
from shipdrag_ros.library.forecasts import milestone_columns
from shipdrag_ros.library.shown import Shown
from shipdrag_ros.replay import accepted_samples
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

_RECENT_S = 30.0  # whose mean is the present speed
_FEWEST = 3
_SLACK = 0.05  # of the speed at the stop, that a mean may be over the last speed


@dataclass(frozen=True, repr=False)
class IfStopped(Shown):
    """
    The glide that would begin at the end of a record.

    Attributes
    ----------
    bag
        Name of the last run.
    ship
    hull
        Where the hull as last known is from, in words.
    measured
        What kind of speed it begins from.
    gliding
        Whether she glides already: there is no run-down to come.
    forecast

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=1.0, lead_in_s=400.0)
    >>> found = sd.estimate(record).if_stopped_now()
    >>> found.hull, found.measured
    ('the clean hull of the ship file', 'through water')
    """

    bag: str
    ship: Ship
    hull: str
    measured: str
    gliding: bool
    forecast: Forecast

    def _lines(self) -> Sequence[str]:
        mass = self.ship.mass_kg
        now = ship_speed(float(self.forecast.speed_m_s[0]), mass)
        said = '; '.join(words.sentence(each, mass) for each in self._shown())
        when = f'at {utc(self.forecast.made_ns)}'
        begun = f'Gliding already {when}' if self.gliding else f'If the engine were stopped {when}'
        return (f'{begun}, at {now} {self.measured}, by {self.hull}: {said}.',)

    def _shown(self) -> Sequence[Milestone]:
        mass = self.ship.mass_kg
        return words.apart(self.forecast.milestones, lambda each: ship_speed(each.speed_m_s, mass))

    def table(self) -> Table:
        """
        Show when and how far on she would have each lower speed.
        """
        mass = self.ship.mass_kg
        rows = tuple(
            (
                ship_speed(each.speed_m_s, mass),
                *words.cells(each.time_s, words.clock),
                *words.cells(each.distance_m, lambda metres: words.way(metres, mass)),
            )
            for each in self._shown()
        )
        return Table(('down to', 'in', '90 %', 'after', '90 %'), rows)

    def _title(self) -> str:
        return f'if stopped at {utc(self.forecast.made_ns)}'

    def _columns(self) -> Mapping[str, Any]:
        return milestone_columns(self.forecast.milestones)


def if_stopped_now(runs: Sequence[RunResult]) -> IfStopped:
    """
    Foretell the glide from the end of the last of some runs.

    Parameters
    ----------
    runs
        Of one ship; the latest coastdown in them is the hull as last known, or else the ship file.

    Raises
    ------
    EstimationError
        If no speed was read at its end, or nothing is known of the hull.
    """
    last = max(runs, key=lambda each: (each.span_ns or (0, 0))[1])
    usable = [
        (each.end_ns, each, run)
        for run in runs
        for each in run.coastdowns
        if each.stands and each.estimate is not None
    ]
    _, coastdown, run = max(usable, key=lambda each: each[0], default=(0, None, last))
    window, series, measured = _recent(last)
    speed, sd = float(series.value.mean()), float(series.value.std() / np.sqrt(len(series)))
    hull = HullNow.of_file(last.ship) if coastdown is None else _hull(coastdown)
    gliding = coastdown is not None and run is last and _goes_on(coastdown, speed)
    now_ns = window.end_ns
    if gliding and coastdown is not None and coastdown.end_ns >= window.start_ns:
        assert coastdown.estimate is not None  # a mean lags behind a ship that slows
        speed, sd = coastdown.estimate.last_speed_m_s, coastdown.estimate.last_speed_sigma_m_s
        now_ns, measured = coastdown.estimate.end_ns, 'through water, estimated'
    assert last.replayed is not None
    found = if_stopped(
        hull,
        last.ship,
        speed,
        now_ns,
        speed_sd_m_s=sd,
        gliding=gliding,
        speeds_m_s=last.replayed.parameters.forecast_speeds,
    )
    return IfStopped(last.bag, last.ship, hull.source, measured, gliding, found)


def _goes_on(coastdown: EndedCoastdown, speed_m_s: float) -> bool:
    """Say whether a coastdown goes on after its end, as nothing has driven her since."""
    assert coastdown.estimate is not None
    if coastdown.ended_by is EndedBy.RECORD_END:
        return True
    slack = _SLACK * coastdown.estimate.curve.speed_m_s[-1]
    slow = speed_m_s < coastdown.estimate.last_speed_m_s + slack
    return coastdown.ended_by is EndedBy.SPEED and slow


def _named(coastdown: EndedCoastdown) -> str:
    return f'the coastdown of {utc(coastdown.start_ns)}'


def _hull(coastdown: EndedCoastdown) -> HullNow:
    assert coastdown.estimate is not None
    curve = coastdown.estimate.valid_curve
    curve = curve if len(curve) > 1 else coastdown.estimate.curve
    return HullNow.of_run(
        curve.speed_m_s, curve.resistance_m_s2, curve.sigma_m_s2, _named(coastdown)
    )


def _recent(run: RunResult) -> tuple[Window, Series, str]:
    """Return the end of a run, the speed that it shows, and which it is."""
    assert run.replayed is not None
    block, _ = accepted_samples(run.replayed.run)
    if len(block):
        end_ns = int(block.stamp_ns.max())
        window = Window.from_block(block, end_ns - round(_RECENT_S * SECOND_NS), end_ns)
        for kind in ('through water', 'over ground'):
            for series in window.each(f'speed_{kind.replace(" ", "_")}'):
                if len(series) >= _FEWEST:
                    return window, series, kind
    raise EstimationError(
        f'{run.bag!r}: no speed was read in its last {_RECENT_S:.0f} s, so the present speed is '
        'not known; give a bag that ends with readings of speed_through_water or '
        'speed_over_ground'
    )
