# SPDX-License-Identifier: Apache-2.0
"""Runs diagnosed together, by what they hold: coastdowns with a baseline or without, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from shipdrag_ros.bags import WindowedRun, WindowSpan
from shipdrag_ros.coastdown.events import NOT_ALL, EndedBy, EndedCoastdown
from shipdrag_ros.diagnosis import CoastRun, SailingRecord, diagnose, diagnose_sailing
from shipdrag_ros.diagnosis.diagnose import with_log_track, with_whole_glides
from shipdrag_ros.diagnosis.document import EarlierDiagnosis
from shipdrag_ros.diagnosis.result import DiagnosisResult, SeenRun, WeighedEarlier, WeighedFact
from shipdrag_ros.errors import DiagnosisError, EstimationError, ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.library.replaying import Listener, refuse_mixed, ship_in
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.replay import (
    ReplayResult,
    accepted_samples,
    clocks_apart,
    coast_windows,
    replay,
    why_no_coastdown,
)
from shipdrag_ros.replay.coasts import DISMISSED, dismissed_glides, whole_window
from shipdrag_ros.replay.playback import (
    StopTime,
    refuse_without_input,
    ship_of,
    told_beside,
)
from shipdrag_ros.replay.words import cut_lines, run_warnings
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.ship.facts import UNITS_CHECKED, overriding
from shipdrag_ros.sources.beside import sheet_of


def diagnose_runs(
    listener: Listener,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    facts: Sequence[Fact],
    *,
    earlier: Sequence[EarlierDiagnosis] = (),
    stop: StopTime | None = None,
    progress: Progress = silent,
) -> tuple[DiagnosisResult, Ship | None]:
    """
    Diagnose by what the records hold: coastdowns, or sailing alone.

    Parameters
    ----------
    listener
        Called with what is found on the way.
    runs
        Together; effects of the earth are stated along the first.
    given
        The ship; None: the one attached to the first run that has one.
    facts
        Of all runs.
    earlier
        Diagnoses of earlier runs of the ship.
    stop
        When the engine was stopped in each run, as of `replay`.
    progress
        Called with each stage, how much of it is done, and of how much.

    Returns
    -------
    found, ship
        None where no ship is known.

    Raises
    ------
    BagError
        If no ship is given, and the runs are of several.
    DiagnosisError
        If neither a coastdown nor the log and the track can be examined, or an earlier
        diagnosis is of another ship, of later runs or of one of these.
    """
    refuse_mixed(runs, given)
    alone = stop is None and given is None and all(window is None for _, window in runs)
    asked = _Together(runs, facts, earlier, progress)
    if alone and not any(run.ship for run, _ in runs):
        why = 'without a ship file none is looked for; give one with --ship FILE'
        sailing = asked.sailing(None, f'No coastdown was found: {why}.', facts)
        return asked.unused(sailing, facts), None
    seen = _found(listener, runs, given, progress, stop, facts)
    of_whole = partial(
        diagnose,
        seen.whole,
        seen.ship,
        seen.parameters,
        facts=facts,
        earlier=earlier,
        progress=progress,
    )
    try:
        found = with_whole_glides(
            partial(asked.of_coastdowns, seen),
            of_whole if seen.whole else None,
            seen.notes,
            coastdowns=len(seen.coasts),
        )
    except ShipdragError:
        listener.log(*seen.warnings)  # no notes hold them
        raise
    unused = tuple(f'no coastdown was found {each}' for each in seen.without if seen.coasts)
    found = replace(found, notes=(*found.notes, *seen.warnings, *unused))
    if seen.whole:
        found = replace(seen.known(found), no_coastdown=seen.no_coastdown)
    return found, seen.ship


@dataclass(frozen=True)
class _Together:
    """Runs that are diagnosed together, and what is known beside them."""

    runs: Sequence[WindowedRun]
    facts: Sequence[Fact]
    earlier: Sequence[EarlierDiagnosis]
    progress: Progress

    def of_coastdowns(self, seen: _Coastdowns) -> DiagnosisResult:
        """Diagnose the coastdowns, or log and track alone where there is none."""
        if not seen.coasts:
            stated = (*seen.ship.facts, *self.facts)
            return self.unused(self.sailing(seen.ship, seen.no_coastdown, stated), stated)
        return seen.known(self._of_force(seen))

    def _of_force(self, seen: _Coastdowns) -> DiagnosisResult:
        """Diagnose coastdowns; without a baseline the logs and the ways over ground as well."""
        known = (seen.coasts, seen.ship, seen.parameters)
        diagnosed = partial(diagnose, *known, facts=self.facts, progress=self.progress)
        if seen.ship.baseline is not None:
            return diagnosed(earlier=self.earlier)
        stated = (*seen.ship.facts, *self.facts)
        try:
            found = diagnosed()
        except (DiagnosisError, EstimationError) as error:
            why = f'No coastdown could be diagnosed: {error}.'
            return self.unused(self.sailing(seen.ship, why, stated), stated)
        unused = self.unused(found, ()).earlier
        try:
            found = with_log_track(found, self.sailing(seen.ship, '', stated))
        except DiagnosisError as error:
            why = f'the log was not compared with the way over ground: {str(error).strip()}'
            found = replace(found, notes=(*found.notes, why))
        return replace(found, earlier=unused)

    def unused(self, found: DiagnosisResult, facts: Sequence[Fact]) -> DiagnosisResult:
        """Say of facts and of earlier diagnoses that they were given and not used."""
        return replace(
            found,
            facts=tuple(
                WeighedFact(fact, '', None)
                for fact in overriding(facts)
                if fact.name != UNITS_CHECKED  # which counts here too
            ),
            earlier=tuple(
                WeighedEarlier(each.name, each.runs, used=False) for each in self.earlier
            ),
        )

    def sailing(
        self, ship: Ship | None, no_coastdown: str, facts: Sequence[Fact]
    ) -> DiagnosisResult:
        """Compare the logs with the ways over ground."""
        records, parameters = [], None
        for done, (run, _) in enumerate(self.runs):
            self.progress(f'reading {run.name}', done, len(self.runs))
            sheet, _ = sheet_of(run, lambda text: None)  # said where coastdowns are looked for
            checked = any(fact.name == UNITS_CHECKED for fact in (*facts, *sheet.facts))
            block, used = accepted_samples(run, ship, zeros=True)
            parameters = parameters or used
            records.append(SailingRecord(run.name, block, checked))
        self.progress('holding the log against the way over ground', 0, 0)
        at = tuple(SeenRun(run.name, run.span_ns[0]) for run, _ in self.runs if run.span_ns)
        assert parameters is not None
        try:
            found = diagnose_sailing(records, parameters, no_coastdown=no_coastdown)
            return replace(found, runs=at)
        except DiagnosisError as error:
            said = f'{no_coastdown} Log and track: {error}' if no_coastdown else str(error)
            raise DiagnosisError(said) from error


def coasts_of(
    listener: Listener,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    progress: Progress = silent,
    *,
    whole: bool = False,
) -> tuple[list[CoastRun], Ship, Parameters]:
    """
    Find the coastdowns of all bags.

    Parameters
    ----------
    listener
        Called with what is found on the way.
    runs
        Where to look.
    given
        The ship; None: the one attached to the first run that has one.
    progress
        Called with each stage, how much of it is done, and of how much.
    whole
        Whether parts of a glide count that are no coastdown, though no instrument shows why.

    Returns
    -------
    coasts, ship, parameters
        The ship given, or that of the first bag; the parameters of the first.

    Raises
    ------
    DiagnosisError
        If there is none.
    """
    refuse_mixed(runs, given)
    seen = _found(listener, runs, given, progress)
    listener.log(*seen.warnings)  # a diagnosis has them among its notes
    if not (seen.coasts or (whole and seen.whole)):
        raise DiagnosisError(
            f'no coastdown was found {"; ".join(seen.without)}. Give a record in which the engine '
            'was stopped after steady sailing'
        )
    listener.log(*(f'no coastdown was found {each}' for each in seen.without))
    return (seen.whole if whole and seen.whole else seen.coasts), seen.ship, seen.parameters


@dataclass(frozen=True)
class _Coastdowns:
    """
    The coastdowns of all bags, their estimates, and of each bag without one why.

    `whole` are all glides with the parts of them that are no coastdown, though no instrument
    shows why; empty where no such part can be followed. `notes` says what these are, `warnings`
    what is wrong with the runs, and what was cut, `in_runs` how she was in all of them, if that is
    not as in her file.
    """

    coasts: list[CoastRun]
    whole: list[CoastRun]
    notes: tuple[str, ...]
    ship: Ship
    parameters: Parameters
    without: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    in_runs: Ship | None
    warnings: tuple[str, ...]

    def known(self, found: DiagnosisResult) -> DiagnosisResult:
        """Return a diagnosis with what was estimated of the coastdowns."""
        return replace(found, estimates=self.estimates, in_runs=self.in_runs)

    @property
    def no_coastdown(self) -> str:
        """That none was found and why, a sentence; '' where there is one."""
        return '' if self.coasts else f'No coastdown was found {"; ".join(self.without)}.'


def _found(
    listener: Listener,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    progress: Progress,
    stop: StopTime | None = None,
    facts: Sequence[Fact] = (),
) -> _Coastdowns:
    """Find the coastdowns, if there are any; ship and parameters as in `coasts_of`."""
    seen: list[_OfRun] = []
    without: list[str] = []
    estimates: list[Estimate] = []
    own: list[Ship | None] = []
    warnings: list[str] = []
    for run, _ in runs:
        refuse_without_input(run)
    known = filter(None, (run.ship for run, _ in runs))
    ship, parameters = given or next(known, None) or ship_of(runs[0][0], None), None
    for each, window in runs:
        stage = partial(progress, f'replaying {each.name}')
        stage(0, 0)
        told, sheet = ship_in(each, ship, facts, listener.log)
        was = replace(told, facts=ship.facts)
        of_run = None if was == ship else was
        own.append(of_run)
        # recorded outputs are not looked at, nor what is estimated while a coastdown runs
        result = replay(each, ship=told, window=window, stop=stop, compare=False, progress=stage)
        parameters = parameters or result.parameters
        lines = [*_cuts(result, window), *run_warnings(result)]
        lines += [
            f'the clock of {name} is too slow or too fast, and on board it is rejected; it is '
            'diagnosed all the same'
            for name in clocks_apart(result)
        ]
        if stop is not None:
            lines.append(told_beside(each, stop, result.coastdowns))
        warnings += [f'{each.name}: {line}' for line in lines]
        windows = coast_windows(result)
        warnings += _ends(each.name, windows)
        estimates += [part.estimate for part, _ in windows if part.estimate is not None]
        if not windows:
            without.append(f'in {each.name!r}: {why_no_coastdown(result)}')
        seen.append(_of_run(result, windows, partial(CoastRun, facts=sheet.facts, ship=of_run)))
    assert parameters is not None
    return _Coastdowns(
        [coast for one in seen for coast in one.coasts],
        [glide for one in seen for glide in one.whole] if any(one.notes for one in seen) else [],
        tuple(note for one in seen for note in one.notes),
        ship,
        parameters,
        tuple(without),
        tuple(estimates),
        own[0] if all(each == own[0] for each in own) else None,
        tuple(warnings),
    )


class _OfRun(NamedTuple):
    """Coastdowns of a bag; its glides, and what these are where they are more than those."""

    coasts: list[CoastRun]
    whole: Sequence[CoastRun] = ()
    notes: tuple[str, ...] = ()


def _of_run(
    result: ReplayResult,
    windows: Sequence[tuple[EndedCoastdown, Window]],
    run: Callable[[str, Window], CoastRun],
) -> _OfRun:
    """Look for glides that are more than the coastdowns of a bag; by a baseline alone."""
    bag = result.run.name
    coasts = [run(*one) for one in _named(bag, windows)]
    if result.ship.baseline is None:
        return _OfRun(coasts)
    if not windows:
        missed = [run(bag, each) for each in dismissed_glides(result)]
        return _OfRun([], missed, (f'{bag}: {DISMISSED}',) if missed else ())
    whole: list[CoastRun] = []
    notes: list[str] = []
    glide_end_ns = 0
    for coast, (coastdown, window) in zip(coasts, windows, strict=True):
        if window.start_ns < glide_end_ns:  # a part of the glide before, which counts once
            continue
        glide = whole_window(result, coastdown)
        whole.append(coast if glide is None else replace(coast, window=glide))
        if glide is not None:
            notes.append(f'{coast.name}: {coastdown.disturbed or NOT_ALL}')
            glide_end_ns = glide.end_ns
    return _OfRun(coasts, whole, tuple(notes))


def _named(
    bag: str, windows: Sequence[tuple[EndedCoastdown, Window]]
) -> Iterator[tuple[str, Window]]:
    """Yield the coastdowns of a bag with a name each."""
    for place, (_, window) in enumerate(windows, start=1):
        yield (bag if len(windows) == 1 else f'{bag}, coastdown {place}'), window


def _ends(bag: str, windows: Sequence[tuple[EndedCoastdown, Window]]) -> Iterator[str]:
    """Yield why coastdowns ended, where it was neither the record nor the least speed."""
    known = (EndedBy.RECORD_END, EndedBy.SPEED, EndedBy.GIVEN)
    named = _named(bag, windows)
    for (name, _), (coastdown, _) in zip(named, windows, strict=True):
        if coastdown.ended_by not in known:
            also = f'; {coastdown.disturbed}' if coastdown.disturbed else ''
            yield f'{name}: the coastdown ends where {coastdown.why}{also}'


def _cuts(result: ReplayResult, window: WindowSpan | None) -> Iterator[str]:
    """Yield what of the coastdowns was cut; a window of which nothing is left is an error."""
    for coastdown in result.coastdowns:
        if window is not None and coastdown.withdrawn:
            raise DiagnosisError(
                f'{result.run.name!r}: no coastdown from {window[0]:g} to {window[1]:g} s: '
                f'{coastdown.failure}'
            )
        yield from cut_lines(coastdown, result.run.span_ns)
