# SPDX-License-Identifier: Apache-2.0
"""What is missing in the model of a ship, from the coastdowns of records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from shipdrag_ros.bags import WindowedRun, WindowSpan
from shipdrag_ros.diagnosis import with_effects, words
from shipdrag_ros.diagnosis.document import EarlierDiagnosis, document, read_earlier
from shipdrag_ros.diagnosis.result import Candidate, Compared, DiagnosisResult, EffectEstimate, Gap
from shipdrag_ros.display import Table, speed_unit
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.learning import words as learnt_words
from shipdrag_ros.learning.search import Learnt
from shipdrag_ros.learning.search import learn as learn_runs
from shipdrag_ros.library import replaying
from shipdrag_ros.library.diagnosing import coasts_of, diagnose_runs
from shipdrag_ros.library.record import Record, ShipGiven, records_of, ship_of
from shipdrag_ros.library.shown import Shown, drawing, in_python, says_it_in_python, writing
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.replay.playback import StopTime
from shipdrag_ros.ship import Fact, Ship, parse_fact
from shipdrag_ros.ship.term import check_name
from shipdrag_ros.simulation.effects import find

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """
    Which effect is missing in the model, how large it is, and the gap before and after.

    Attributes
    ----------
    found
        All that the diagnosis says.
    ship
        That the runs were compared with; None where none is known.
    notes
        What was found on the way, a line each.

    Raises
    ------
    DiagnosisError
        By `ship_with_effects` where nothing is named, by `plot` without a run.

    Notes
    -----
    Source: docs/architecture.md, the diagnosis.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> ship = sd.Ship.example()
    >>> record = sd.simulate(ship, {'log_scale': -0.15}, duration_s=900.0, lead_in_s=400.0)
    >>> found = sd.diagnose(record)
    >>> found.verdict in ('named', 'one_of')
    True
    >>> found.gap_after.chi2_per_sample < found.gap_before.chi2_per_sample
    True
    """

    found: DiagnosisResult
    ship: Ship | None
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """`none`, `named`, `one_of` or `unknown`."""
        return str(self.found.verdict)

    @property
    def effects(self) -> tuple[EffectEstimate, ...]:
        """What is missing, where it is named; otherwise empty."""
        return self.found.effects

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The smallest set that holds 99 %, most probable first, with sizes."""
        return self.found.candidates

    @property
    def gap_before(self) -> Gap:
        """How far the model as stated and the data are apart."""
        return self.found.before

    @property
    def gap_after(self) -> Gap | None:
        """The same with what explains the runs; None where nothing was added."""
        return self.found.after

    def ship_with_effects(self) -> Ship:
        """
        Return the ship with the effect added that was named.

        Raises
        ------
        DiagnosisError
            If nothing is named.
        """
        if self.ship is None or not self.found.effects:
            raise DiagnosisError(
                f'the verdict is {self.verdict!r}, and nothing is named that could be added; '
                'summary() says what would decide'
            )
        return with_effects(self.ship, self.found.effects)

    def _document(self) -> Mapping[str, Any]:
        return document(self.found, self.ship)

    def _lines(self) -> Sequence[str]:
        return (*words.summary(self.found), *words.advice(self.found), *self.notes)

    def table(self) -> Table:
        """
        Show how probable each answer is.
        """
        return words.probabilities_table(self.found)

    def gaps(self) -> Table:
        """
        Show how far model and data are apart, before and after.
        """
        return words.gaps_table(self.found)

    def plot(self, ax: Axes | None = None, *, run: int = 0, quantity: str | None = None) -> Axes:
        """
        Draw measured less model against time: as stated, and with what explains the run.

        Parameters
        ----------
        ax
            To draw on; None: new axes.
        run
            Which of the runs, from 0.
        quantity
            An input; None: the first of speeds and position that was measured.

        Returns
        -------
        matplotlib.axes.Axes
            A good model stays inside the band of the noise.
        """
        from shipdrag_ros.diagnosis.page import draw_difference

        compared = self._compared(run, quantity)
        scale = (1.0, 'm')
        if compared.quantity.startswith('speed'):
            scale = speed_unit(0.0 if self.ship is None else self.ship.mass_kg)
        added = words.added(self.found)
        with drawing(ax) as axis:
            draw_difference(axis, compared, scale, labels=('model as stated', added))
            axis.legend()
        return axis

    def report(self, path: str | PathLike[str]) -> None:
        """
        Write the page that `shipdrag diagnose --report` writes.

        Parameters
        ----------
        path
            HTML file; an existing one is replaced.
        """
        from shipdrag_ros.diagnosis.page import write_diagnosis

        with writing(path) as page:
            write_diagnosis(page, self.found, self.ship)

    def _compared(self, run: int, quantity: str | None) -> Compared:
        from shipdrag_ros.diagnosis.page import ALONG

        traces = self.found.traces
        if not 0 <= run < len(traces):
            raise DiagnosisError(f'run {run} is not there; the diagnosis has {len(traces)} run(s)')
        known = {each.quantity: each for each in traces[run].compared}
        wanted = (quantity,) if quantity is not None else ALONG
        for name in wanted:
            if name in known:
                return known[name]
        raise DiagnosisError(f'{quantity!r} was not compared in this run, but {", ".join(known)}')

    def _title(self) -> str:
        name = '' if self.ship is None else self.ship.name
        return f'{name or "a ship without a name"}, {self.verdict}: {_first(self.found)}'

    def _columns(self) -> Mapping[str, Any]:
        """Return a line for each size of each candidate; one without a size has one line."""
        rows: list[tuple[Any, ...]] = []
        for each in self.found.candidates:
            names = ' and '.join(each.names) or 'none'
            sized = [
                (names, each.probability, effect.name, size.name, value.value, value.sd, size.unit)
                for effect in each.effects
                for size in find(effect.name).parameters
                for value in (effect.parameters[size.name],)
            ]
            rows += sized or [(names, each.probability, '', '', None, None, '')]
        heads = ('candidate', 'probability', 'effect', 'parameter', 'value', 'sd', 'unit')
        return {head: [row[place] for row in rows] for place, head in enumerate(heads)}


def _first(found: DiagnosisResult) -> str:
    """Name the most probable answer, or ask."""
    if found.question:
        return in_python(found.question)
    if found.effects:
        names = words.names_text([each.name for each in found.effects])
        return f'{names} ({words.least_probable(found)})'
    answer = max(words.answers(found), key=lambda each: each.probability)
    return f'{answer.words} ({words.probability(answer.probability)})'


def _earlier(given: str | PathLike[str] | Diagnosis, place: int) -> EarlierDiagnosis:
    """Take a diagnosis of before, or read one."""
    if isinstance(given, Diagnosis):
        return EarlierDiagnosis.of(given.found, given.ship, name=f'earlier diagnosis {place}')
    return read_earlier(given)


@says_it_in_python
def diagnose(
    records: Record | Sequence[Record],
    *,
    ship: ShipGiven = None,
    facts: Sequence[str] = (),
    earlier: Sequence[str | PathLike[str] | Diagnosis] | str | PathLike[str] | Diagnosis = (),
    window: WindowSpan | None = None,
    stop: StopTime | None = None,
) -> Diagnosis:
    """
    Name the effect that is missing in the model of a ship, as `shipdrag diagnose` does.

    Parameters
    ----------
    records
        Of one ship, from `read` or `simulate`; all their coastdowns are taken together,
        and effects of the earth are stated along the first.
    ship
        To compare them with, or the path of its file; None: that of the records.
    facts
        What a log book knows of all runs: `no_towed_cable`, `shaft=locked`.
    earlier
        Diagnoses of earlier runs of the ship: what this function returned, or JSON files
        that `shipdrag diagnose` wrote. What they found of hull and instruments counts,
        less the longer ago it was; water and weather do not.
    window
        Begin and end of the coastdown [s from the start of each run], instead of
        looking for one.
    stop
        When the engine was stopped, as of `estimate`.

    Returns
    -------
    Diagnosis
        A name only where the data decide; a set and what would decide otherwise.

    Raises
    ------
    BagError
        If the same part of a recording is given twice, or the runs are of two ships.
    DiagnosisError
        If neither a coastdown nor the log and the track can be examined, or an earlier
        diagnosis is of another ship, of later runs or of one of these.
    ShipFileError
        If a fact or an attached ship file cannot be used.

    Notes
    -----
    Source: docs/architecture.md, the diagnosis. The figures are those of the command
    line, to the last bit.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)
    >>> found = sd.diagnose(record, facts=['no_towed_cable', 'deep_water'])
    >>> found.verdict
    'none'
    """
    parts = records_of(records)
    runs = [WindowedRun(run, window) for record in parts for run in record.runs]
    if ship is None:
        replaying.refuse_two_ships((run, record.given) for record in parts for run in record.runs)
    listener = replaying.Notes()
    given: Sequence[Fact] = [
        parse_fact(text) for text in ([facts] if isinstance(facts, str) else facts)
    ]
    before = [earlier] if isinstance(earlier, str | PathLike | Diagnosis) else earlier
    known = [_earlier(each, place) for place, each in enumerate(before, start=1)]
    found, used = diagnose_runs(
        listener, runs, ship_of(ship) or parts[0].given, given, earlier=known, stop=stop
    )
    return Diagnosis(found, used, tuple(listener.lines))


class LearntEffect(Shown, Learnt):
    """
    What was learnt of some runs, `Learnt`, as it shows itself.
    """

    def _document(self) -> Mapping[str, Any]:
        return learnt_words.document(self)

    def _lines(self) -> Sequence[str]:
        return (learnt_words.sentence(self), *learnt_words.lines(self))

    def table(self) -> Table:
        """
        Show how probable each explanation of the runs is.
        """
        return learnt_words.table(self)

    def _title(self) -> str:
        return 'nothing is learnt' if self.term is None else f'{self.term.name} is learnt'

    def _columns(self) -> Mapping[str, Any]:
        return {'explanation': [*self.probability], 'probability': [*self.probability.values()]}


@says_it_in_python
def learn(
    records: Record | Sequence[Record], *, ship: ShipGiven = None, name: str = 'learnt'
) -> LearntEffect:
    """
    Learn the effect that several runs of a ship share and the library has no name for.

    Parameters
    ----------
    records
        Of one ship; with one run nothing is written.
    ship
        With a baseline, or the path of its file; None: the one attached to the first record.
    name
        Of the effect: small letters, digits and _.

    Returns
    -------
    LearntEffect
        Its `term` is None where nothing may be written, and `reason` says why;
        `term.to_yaml()` is the text of a file.

    Raises
    ------
    BagError
        If the same part of a recording is given twice, or the runs are of two ships.
    DiagnosisError
        If no coastdown is found, or the ship has no baseline.
    EffectFileError
        If the name cannot be one.

    Notes
    -----
    Source: docs/learn.md.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=600.0, lead_in_s=400.0)
    >>> print(sd.learn(record).term)
    None
    """
    parts = records_of(records)
    runs = [WindowedRun(run, None) for record in parts for run in record.runs]
    return learn_from(replaying.Notes(), runs, ship_of(ship) or parts[0].given, name)


def learn_from(
    listener: replaying.Listener,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    name: str,
    progress: Progress = silent,
) -> LearntEffect:
    """
    Learn from runs that are open; what the verb and a script share.

    Parameters
    ----------
    listener
        Called with what is found on the way.
    runs
        Of one ship.
    given
        The ship; None: the one attached to the first run.
    name
        Of the effect.
    progress
        Called with each stage, how much of it is done, and of how much.
    """
    check_name(name)
    coasts, ship, parameters = coasts_of(listener, runs, given, progress, whole=True)
    coasts = sorted(coasts, key=lambda coast: coast.window.start_ns)
    return LearntEffect(**vars(learn_runs(coasts, ship, parameters, name=name, progress=progress)))
