# SPDX-License-Identifier: Apache-2.0
"""What was measured on one ship: runs that were read or simulated, their coastdowns and r(v)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.bags import Run, WindowSpan, open_runs
from shipdrag_ros.bags.mcap_file import is_bag
from shipdrag_ros.coastdown import events
from shipdrag_ros.display import Table, dated, duration, speed_unit, utc
from shipdrag_ros.errors import BagError, EstimationError
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, ForceCurve, ResistanceCurve
from shipdrag_ros.library import forecasts
from shipdrag_ros.library.replaying import Notes, refuse_two_ships, replay_run
from shipdrag_ros.library.shown import Shown, ShownResistance, drawing, says_it_in_python, writing
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.playback import StopTime
from shipdrag_ros.replay.run_result import ATTACHMENT, RunResult, TrueCurve, together
from shipdrag_ros.replay.tables import coastdown_document, document
from shipdrag_ros.samples import SECOND_NS, Block, Channel, concatenate
from shipdrag_ros.ship import SHIP_FILE, Ship

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ShipGiven = Ship | str | PathLike[str] | None
"""A ship, or the path of her file."""


_SPEEDS = (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)


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

    def _document(self) -> Mapping[str, Any]:
        return coastdown_document(self.bag, self.event)

    def _lines(self) -> Sequence[str]:
        return words.summary(self.event, self.ship)

    def table(self) -> Table:
        """
        Show about ten points of the curve, over the clean hull where it is known.
        """
        if self.event.estimate is None:
            return tables.facts(self.event)
        return estimate_words.force_table(self.curve, self.ship)

    def _drawing(self) -> Callable[[Axes], None]:
        from shipdrag_ros.estimation.pictures import draw_resistance

        assert len(self.curve) >= 0  # raises where there is none
        estimate, truth = self.event.estimate, self.run.truth
        assert estimate is not None
        shown = None if truth is None else (truth.speed_m_s, truth.resistance_m_s2)
        return lambda axis: draw_resistance(axis, estimate, self.ship, truth=shown)

    def _title(self) -> str:
        ended = self.event.why
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


class Record(Shown):
    """
    What was measured on one ship, in one run or several.

    `read` and `simulate` return it; it is not made directly.

    Parameters
    ----------
    runs
        In the order given.
    given
        The ship; None: the one attached to each run.
    notes
        What of the sources was not used, and why, a line each.

    Raises
    ------
    BagError
        If there is no run.

    Notes
    -----
    Source: docs/architecture.md, one sequence of samples in arrival order.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)
    >>> record
    <Record: Vitus Bering, 1 run, 5204 messages>
    >>> print(record.summary().splitlines()[1])
    simulated, seed 0: 1300 s (22 min) from 2026-06-01 08:00:00 UTC
    >>> [coastdown.ended_by for coastdown in record.coastdowns()]
    ['record_end']
    """

    def __init__(
        self, runs: Sequence[Run], *, given: Ship | None = None, notes: Sequence[str] = ()
    ) -> None:
        if not runs:
            raise BagError('no run was read; give a bag, a log or a table of measurements')
        self.runs = tuple(runs)
        self.given = given
        self.notes = tuple(notes)

    @property
    def ship(self) -> Ship | None:
        """The ship given, or the one attached to the first run; None: not known."""
        return self.given or self.runs[0].ship

    @property
    def truth(self) -> TrueCurve | None:
        """The true r(v) of a simulated record; None of a measured one."""
        text = self.runs[0].attachments.get(ATTACHMENT)
        return None if text is None else TrueCurve.from_yaml(text, subject=self.runs[0].name)

    def coastdowns(self) -> tuple[Coastdown, ...]:
        """
        Find the coastdowns and estimate r(v) from each, as the node would have.

        Raises
        ------
        BagError
            Without a ship, or without a usable input.
        """
        return estimate(self).coastdowns

    def samples(self) -> Block:
        """
        Return all that was measured, in order of arrival, plausible or not.
        """
        return concatenate([run.inputs().block() for run in self.runs])

    def save(self, path: str | PathLike[str]) -> Path:
        """
        Write a record of one run as a bag, which `read` and the command line take.

        A ship that was given for it is attached, or else the one whose file lies beside it.

        Raises
        ------
        BagError
            If the file exists or cannot be written, or the record has several runs or files.
        """
        out = Path(path)
        files = [part.path for run in self.runs for part in run.parts]
        if len(files) != 1:
            raise BagError(f'the record has {len(files)} files and is not one bag; copy those')
        if out.exists():
            raise BagError(f'{str(out)!r} exists; choose another name or remove it')
        ship = self.given if SHIP_FILE in self.runs[0].attachments else self.ship
        self.runs[0].save(out, {} if ship is None else {SHIP_FILE: ship.to_yaml()})
        return out

    def _document(self) -> Mapping[str, Any]:
        return {'bags': [run.about() for run in self.runs]}

    def _lines(self) -> Sequence[str]:
        ship = self.ship
        known = 'no ship is known: give one with ship=' if ship is None else ship.summary()
        runs = [f'{run.name}: {_when(run)}' for run in self.runs]
        return (known, *runs, *self.notes)

    def table(self) -> Table:
        """
        Show the messages of each input.
        """
        counts: Counter[str] = Counter()
        for run in self.runs:
            for topic in run.topics:
                counts[topic.input or f'{topic.topic} (not used)'] += topic.messages
        rows = tuple((name, f'{count}') for name, count in counts.items())
        return Table(('input', 'messages'), rows)

    def plot(self, ax: Axes | None = None) -> Axes:
        """
        Draw the measured speed against time.

        Parameters
        ----------
        ax
            To draw on; None: new axes.

        Returns
        -------
        matplotlib.axes.Axes
            Speed in knots, of a model ship in m/s.
        """
        block, ship = self.samples(), self.ship
        unit, unit_name = speed_unit(0.0 if ship is None else ship.mass_kg)
        with drawing(ax) as axis:
            for channel in (each for each in Channel if each.kind in _SPEEDS):
                part = block[block.channel == channel]
                if len(part):
                    minutes = (part.stamp_ns - block.stamp_ns[0]) / (60.0 * SECOND_NS)
                    label = channel.input.replace('_', ' ')
                    axis.plot(minutes, part.value[:, 0] / unit, '.', markersize=2, label=label)
            axis.set(xlabel='time [min]', ylabel=f'speed [{unit_name}]')
            if axis.lines:
                axis.legend()
        return axis

    def _title(self) -> str:
        ship = self.ship
        name = (ship.name if ship is not None else '') or 'a ship without a name'
        messages = sum(topic.messages for run in self.runs for topic in run.topics if topic.input)
        runs = 'run' if len(self.runs) == 1 else 'runs'
        return f'{name}, {len(self.runs)} {runs}, {messages} messages'

    def _columns(self) -> Mapping[str, Any]:
        block = self.samples()
        names = np.array([channel.name.lower() for channel in Channel])
        return {
            'time': block.stamp_ns.astype('datetime64[ns]'),
            'arrival': block.receive_ns.astype('datetime64[ns]'),
            'channel': names[block.channel],
            'value': block.value[:, 0],
            'value_2': block.value[:, 1],
        }


def _when(run: Run) -> str:
    if run.span_ns is None:
        return 'no message'
    start_ns, end_ns = run.span_ns
    return f'{duration((end_ns - start_ns) / SECOND_NS)} from {utc(start_ns)}'


def ship_of(ship: ShipGiven) -> Ship | None:
    """
    Return the ship that is given, or that a file holds.

    Raises
    ------
    BagError
        If it is neither.
    ShipFileError
        If the file holds none.
    """
    if not isinstance(ship, Ship | str | PathLike | None):
        raise BagError(f'ship={ship!r}: expected a Ship, or the path of a ship file')
    return ship if ship is None or isinstance(ship, Ship) else Ship.load(ship)


@says_it_in_python
def read(
    source: Any,
    *,
    ship: ShipGiven = None,
    columns: Mapping[str, str | Sequence[str]] | None = None,
    time: str | None = None,
    rate_hz: float | None = None,
    remap: Mapping[str, str] | None = None,
    options: Mapping[str, Any] | None = None,
) -> Record:
    """
    Read what was measured on one ship.

    Parameters
    ----------
    source
        Path of a bag (MCAP file or rosbag2 directory), of a log in any format that
        `shipdrag import` knows, or of a table (CSV); a frame of pandas or polars; or a
        list of these, all of one ship.
    ship
        The ship, or the path of her file; None: the one attached to the bag, else `ship.yaml`
        beside it.
    columns
        Which column of a table or frame is which input, with its unit behind a colon:
        `{'speed_through_water': 'log:kn', 'position': ('lat:deg', 'lon:deg')}`. Without
        a unit it is SI. Of several tables each takes the columns that it has. None:
        columns are known by their usual names and units.
    time
        Column of the time: dates, or a count with its unit (`s ms us ns`) behind a
        colon. Not needed where its name says it, and of a frame with a column or an
        index of dates.
    rate_hz
        Rows a second [Hz], where there is no column of the time.
    remap
        Recorded topic of a bag -> input.
    options
        Further options of `shipdrag import` for logs and tables: `{'speed_unit': 'kn'}`,
        `{'date': '2024-05-17'}`, `{'gear': 2.5}`.

    Returns
    -------
    Record
        Bags are a run each. Logs and frames whose dates follow or cover each other
        are joined to one run, those that count from the start of a test are not.

    Raises
    ------
    BagError, ImportDataError
        If something cannot be read, or is of two ships; the message says what to do.
    ShipFileError
        If the ship file cannot be used.

    Notes
    -----
    Source: inputs and units are those of `shipdrag import`. Dates without a zone are UTC.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> import shipdrag_ros as sd
    >>> seconds = np.arange(1200.0)
    >>> knots = 12.0 / (1.0 + np.maximum(seconds - 300.0, 0.0) / 400.0)
    >>> frame = pd.DataFrame({'t': seconds, 'log': knots})
    >>> ship = sd.Ship(length_m=80.0, displaced_volume_m3=4000.0)
    >>> sd.read(frame, ship=ship, columns={'speed_through_water': 'log:kn'}, time='t')
    <Record: a ship without a name, 1 run, 1200 messages>
    """
    from shipdrag_ros.library.logs import is_frame

    given = ship_of(ship)
    alone = isinstance(source, str | PathLike | Mapping) or is_frame(source)
    several = source if not alone and isinstance(source, Iterable) else [source]
    bags: list[Path] = []
    others: list[Any] = []
    for each in several:
        path = None if is_frame(each) else _path(each)
        if path is not None and is_bag(path):
            bags.append(path)
        else:
            others.append(path or each)
    runs = open_runs(bags, remap=remap) if bags else []
    if given is None:
        refuse_two_ships((run, None) for run in runs)
    if not others:
        given_for_logs = {'columns': columns, 'time': time, 'rate_hz': rate_hz, 'options': options}
        idle = [f'{name}=' for name, value in given_for_logs.items() if value is not None]
        notes = [f'{", ".join(idle)} not used: they are for logs and tables'] if idle else []
        return Record(runs, given=given, notes=notes)
    from shipdrag_ros.library.logs import ReadOptions, read_logs  # a bag needs no importer

    how = ReadOptions(columns, time, rate_hz, options)
    attachments = {} if given is None else {SHIP_FILE: given.to_yaml()}
    imported, notes = read_logs(others, how, attachments)
    return Record([*runs, *imported], given=given, notes=notes)


def _path(source: Any) -> Path:
    """Return the path that a source must be where it is no frame."""
    if not isinstance(source, str | PathLike):
        raise BagError(
            f'{type(source).__name__!r} is no source; give the path of a bag, a log or a table, '
            'a frame of pandas or polars, or a list of these'
        )
    return Path(source)


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

    def _document(self) -> Mapping[str, Any]:
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
        lines = []
        for run in self.runs:
            said = (line.replace(', see below', '') for line in run.summary())  # nothing follows
            lines += [*said, *(f'Warning: {warning}' for warning in run.warnings)]
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
            return estimate_words.force_table(self.curve, self.ship)
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
        many = len(self.coastdowns)
        counted = f'{many or "no"} coastdown{"" if many == 1 else "s"}'
        said = f'{self.ship.name or "a ship without a name"}, {counted}'
        with suppress(EstimationError):
            force = Force.of(self.curve, self.ship)
            if len(force.speed_m_s):
                place = force.near(tables.common_speed_m_s(self.runs))
                speed, newtons, _, over = force.cells(place)
                said += f'; {newtons} at {speed}{", " if over else ""}{over}'
        return said

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
