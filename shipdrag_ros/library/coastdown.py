# SPDX-License-Identifier: Apache-2.0
"""One coastdown of a record and what it gave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shipdrag_ros.coastdown import events
from shipdrag_ros.display import Table, utc
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.force import Force, ForceCurve
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.library.shown import ShownResistance
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Coastdown(ShownResistance):
    """
    One coastdown and what it gave.

    Attributes
    ----------
    event
        As the monitor reports it.
    ship
        As she was in the run.
    bag
        Name of its run.
    run
        All that the run gave.

    Raises
    ------
    EstimationError
        By `curve` and `plot`, if nothing could be estimated.

    Notes
    -----
    Source: S1, tuple (8); `estimate` holds all of it.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)
    >>> coastdown, = record.coastdowns()
    >>> round(coastdown.duration_s, -1), coastdown.ended_by
    (900.0, 'record_end')
    >>> coastdown.curve.speed_m_s.shape == coastdown.curve.resistance_m_s2.shape
    True
    """

    event: events.EndedCoastdown
    ship: Ship
    bag: str
    run: RunResult

    @property
    def start_ns(self) -> int:
        """When the engine stopped [ns since the epoch]."""
        return self.event.start_ns

    @property
    def end_ns(self) -> int:
        """When it ended [ns since the epoch]."""
        return self.event.end_ns

    @property
    def duration_s(self) -> float:
        """Its length [s]."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def ended_by(self) -> str:
        """Why it ended: `speed turn engine brake astern data_stop record_end given ...`."""
        return self.event.ended_by.value

    @property
    def estimate(self) -> Estimate | None:
        """All that was estimated; None where nothing could be."""
        return self.event.estimate

    @property
    def curve(self) -> ResistanceCurve:
        """r(v) inside its valid range, ascending in speed."""
        if self.event.estimate is None:
            raise EstimationError(
                f'the coastdown of {utc(self.start_ns)} in {self.bag!r} gave no estimate: '
                f'{self.event.failure or "no reason given"}'
            )
        return self.event.estimate.valid_curve

    def _lines(self) -> Sequence[str]:
        return words.summary(self.event, self.ship)

    def table(self) -> Table:
        """
        Show about ten points of the curve, over the clean hull where it is known.
        """
        if self.event.estimate is None:
            return tables.facts(self.event)
        return self.event.estimate.table(self.ship)

    def _drawing(self) -> Callable[[Axes], None]:
        from shipdrag_ros.estimation.pictures import draw_resistance

        assert len(self.curve) >= 0  # raises where there is none
        estimate, truth = self.event.estimate, self.run.truth
        assert estimate is not None
        shown = None if truth is None else (truth.speed_m_s, truth.resistance_m_s2)
        return lambda axis: draw_resistance(axis, estimate, self.ship, truth=shown)

    def _title(self) -> str:
        ended = words.ENDED_BY[self.event.ended_by]
        return f'{utc(self.start_ns)}, {self.duration_s:.0f} s, until {ended}'

    def _columns(self) -> Mapping[str, Any]:
        return {'coastdown': utc(self.start_ns), **force_columns(self.curve, self.ship)}


def force_columns(curve: ForceCurve, ship: Ship) -> dict[str, Any]:
    """
    Return a curve in SI units, with the force, the clean hull and the share over it.
    """
    force = Force.of(curve, ship)
    return {
        'speed_m_s': curve.speed_m_s,
        'froude': ship.froude(curve.speed_m_s),
        'resistance_m_s2': curve.resistance_m_s2,
        'sigma_m_s2': curve.sigma_m_s2,
        'sigma_repeatable_m_s2': curve.sigma_repeatable_m_s2,
        'resistance_n': force.newtons,
        'sigma_n': force.sigma_n,
        'clean_hull_n': force.clean_n,
        'over_clean_hull': force.over,
        'over_clean_hull_sd': force.over_sd,
    }
