# SPDX-License-Identifier: Apache-2.0
"""r(v) of a record: each coastdown, and all of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from shipdrag_ros.bags import WindowSpan
from shipdrag_ros.display import Table, dated
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import tables as estimate_tables
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import ForceCurve
from shipdrag_ros.library import forecasts
from shipdrag_ros.library.record import Coastdown, Record, ShipGiven, force_columns, ship_of
from shipdrag_ros.library.replaying import Notes, replay_run
from shipdrag_ros.library.shown import ShownResistance, says_it_in_python, writing
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.document import document
from shipdrag_ros.replay.playback import StopTime
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import together
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Resistance(ShownResistance):
    """
    r(v) of a ship, from all coastdowns of a record.

    Attributes
    ----------
    runs
        What each run gave, as `shipdrag replay` shows it.

    Raises
    ------
    EstimationError
        By `curve` and `plot`, if no coastdown gave an estimate.

    Notes
    -----
    Source: S1; several coastdowns are combined as `estimation.reciprocal` does.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)
    >>> found = sd.estimate(record)
    >>> len(found.coastdowns), found.combined is None
    (1, True)
    >>> found.to_frame().columns.tolist()[:4]
    ['speed_m_s', 'froude', 'resistance_m_s2', 'sigma_m_s2']
    """

    runs: tuple[RunResult, ...]

    @property
    def ship(self) -> Ship:
        """The ship of the first run."""
        return self.runs[0].ship

    @property
    def coastdowns(self) -> tuple[Coastdown, ...]:
        """In the order of the runs."""
        return tuple(
            Coastdown(event, run.ship, run.bag, run)
            for run in self.runs
            for event in run.coastdowns
        )

    @property
    def combined(self) -> Combined | None:
        """One r(v) of several coastdowns; None of one, and where they are not one ship's state."""
        return together(self.runs).combined

    @property
    def curve(self) -> ForceCurve:
        """The one r(v): of the only coastdown, or of all together."""
        usable = [each for each in self.coastdowns if each.estimate is not None]
        if len(usable) == 1:
            return usable[0].curve
        whole = together(self.runs)
        if whole.combined is not None:
            return whole.combined
        if usable:
            raise EstimationError(
                f'{len(usable)} coastdowns have no r(v) together: {whole.why_not}; take the curve '
                'of each of `coastdowns`'
            )
        raise EstimationError(' '.join(self.summary().splitlines()))

    def to_dict(self) -> dict[str, Any]:
        """
        Return the JSON document of `shipdrag replay`; arrays are numpy's.
        """
        return document(self.runs)

    def forecast(self, after: float | Sequence[float] = forecasts.AFTER_S) -> forecasts.Forecasts:
        """
        Foretell the rest of each glide, from what was known at some times after its stop.

        Parameters
        ----------
        after
            When, from the stop on [s].

        Returns
        -------
        Forecasts
            Beside what followed; `plot()` draws them.

        Raises
        ------
        EstimationError
            If a time is not above 0, or there is none.
        """
        return forecasts.forecast(self.runs, after)

    def if_stopped_now(self) -> forecasts.IfStopped:
        """
        Foretell the glide if the engine were stopped at the end of the record.

        Returns
        -------
        IfStopped
            From the hull as last known: the last coastdown, or else the ship file.

        Raises
        ------
        EstimationError
            If no speed was read at its end, or nothing is known of the hull.
        """
        return forecasts.if_stopped_now(self.runs)

    def _lines(self) -> Sequence[str]:
        lines = [line for run in self.runs for line in (*run.summary(), *_warnings(run))]
        whole = together(self.runs)
        if whole.why_not:
            lines.append(f'Not combined: {whole.why_not}.')
        if whole.combined is not None:
            force = Force.of(whole.combined, self.ship)
            place = force.near(tables.common_speed_m_s(self.runs))
            lines.append(f'{whole.combined.runs} coastdowns together. {force.at(place)}')
            lines += words.combined_notes(whole.combined)
        return lines

    def table(self) -> Table:
        """
        Show points of the one r(v); of several coastdowns that have none, a line each.
        """
        try:
            return estimate_tables.force_table(self.curve, self.ship)
        except EstimationError:
            return tables.coastdowns_table(self.runs)

    def _drawing(self) -> Callable[[Axes], None]:
        from shipdrag_ros.estimation.pictures import draw_curves

        usable = [each for each in self.coastdowns if each.estimate is not None]
        if not usable:
            raise EstimationError(' '.join(self.summary().splitlines()))
        if len(usable) == 1:
            return usable[0]._drawing()
        shown = dated((each.start_ns, each.curve) for each in usable)
        return lambda axis: draw_curves(axis, shown, self.ship, combined=self.combined)

    def report(self, path: str | PathLike[str]) -> None:
        """
        Write the page that `shipdrag replay --report` writes.

        Parameters
        ----------
        path
            HTML file; an existing one is replaced.
        """
        from shipdrag_ros.replay.page import write_report

        with writing(path) as page:
            write_report(page, self.runs)

    def _title(self) -> str:
        name = self.ship.name or 'a ship without a name'
        many = len(self.coastdowns)
        counted = f'{many or "no"} coastdown{"" if many == 1 else "s"}'
        try:
            force = Force.of(self.curve, self.ship)
        except EstimationError:
            return f'{name}, {counted}'
        if not len(force.speed_m_s):
            return f'{name}, {counted}'
        speed, newtons, _, over = force.cells(force.near(tables.common_speed_m_s(self.runs)))
        return f'{name}, {counted}; {newtons} at {speed}{", " if over else ""}{over}'

    def _columns(self) -> Mapping[str, Any]:
        return force_columns(self.curve, self.ship)


@says_it_in_python
def estimate(
    records: Record | Sequence[Record],
    *,
    ship: ShipGiven = None,
    window: WindowSpan | None = None,
    stop: StopTime | None = None,
    parameters: Parameters | None = None,
) -> Resistance:
    """
    Find the coastdowns and estimate r(v), as `shipdrag replay` does.

    Parameters
    ----------
    records
        Of one ship, from `read` or `simulate`.
    ship
        To estimate with, or the path of its file; None: that of the records.
    window
        Begin and end of the coastdown [s from the start of each run], instead of
        looking for one; what in it is no coastdown is cut.
    stop
        When the engine was stopped [s from the start of each run], or a date with its zone:
        evidence that is weighed with the rest.
    parameters
        Of the monitor and the estimator; None: those attached to each run.

    Returns
    -------
    Resistance
        With no coastdown in it where none was found: `summary()` then says why.

    Raises
    ------
    BagError
        Without a ship or a usable input, or if a stop is outside of a run.
    EstimationError
        If a window was given and nothing can be estimated from it.

    Notes
    -----
    Source: S1 (1) to (13), docs/figures.md. The figures are those of the command line
    and of the node, to the last bit.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0, seed=1)
    >>> found = sd.estimate(record)
    >>> true = record.truth.at(found.curve.speed_m_s)
    >>> bool(abs(found.curve.resistance_m_s2 / true - 1.0).min() < 0.05)
    True
    """
    listener, given = Notes(), ship_of(ship)
    return Resistance(
        tuple(
            replay_run(
                run,
                listener,
                ship=given or record.given,
                parameters=parameters,
                window=window,
                stop=stop,
            )
            for record in records_of(records)
            for run in record.runs
        )
    )


def records_of(records: Record | Sequence[Record]) -> tuple[Record, ...]:
    """
    Return one record or several as several.

    Raises
    ------
    EstimationError
        If there is none, or one is no record.
    """
    found = tuple(records) if isinstance(records, Iterable) else (records,)
    if not found or not all(isinstance(each, Record) for each in found):
        raise EstimationError(
            'expected a record or a list of records; make one with shipdrag_ros.read(...)'
        )
    return found


def _warnings(run: RunResult) -> list[str]:
    return [f'Warning: {warning}' for warning in run.warnings]
