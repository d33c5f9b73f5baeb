# SPDX-License-Identifier: Apache-2.0
"""
One bag to its rows: replayed, and each coastdown diagnosed by itself.

What a worker does. The rows depend on the bag and on what lies beside it alone,
so that it does not matter which worker makes them, or how often. Its files
are fetched to the disk of the worker.
"""

from __future__ import annotations

import hashlib
import posixpath
import traceback
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from shipdrag_ros import __version__
from shipdrag_ros.bags import Run
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.coastdown.events import NOT_ALL, EndedCoastdown
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.diagnose import with_whole_glides
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.diagnosis.words import sentence
from shipdrag_ros.errors import BagError, DiagnosisError, EstimationError, ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.fleet.find import BagToRead
from shipdrag_ros.fleet.store import BagResult, Row, bag_row, coastdown_row
from shipdrag_ros.replay import ReplayResult, clocks_apart, coast_windows, replay, why_no_coastdown
from shipdrag_ros.replay.coasts import DISMISSED, dismissed_glides, whole_window
from shipdrag_ros.replay.words import run_warnings
from shipdrag_ros.ship import SHIP_FILE, Fact, LearntTerm, RunSheet, Ship
from shipdrag_ros.simulation.effects import carrying
from shipdrag_ros.sources.beside import RUN_FILE
from shipdrag_ros.sources.reading import read_any

_AT_ONCE_BYTES = 1 << 20


@dataclass(frozen=True)
class Identity:
    """
    What separates one bag from another.

    Attributes
    ----------
    digest
        SHA-256 of the bytes of its files, in hexadecimal digits.
    recording
        Id of the recording that it is a part of; '' where its name is not that of a part.
    """

    digest: str
    recording: str = ''


@contextmanager
def fetched(source: BagToRead) -> Iterator[tuple[Path, ...]]:
    """
    Bring the files of a bag to the disk, where they are not there already.

    Yields
    ------
    tuple of Path
        The files; a fetched copy is gone afterwards.

    Raises
    ------
    BagError
        If one cannot be fetched.
    """
    if not any('://' in file for file in source.files):
        with _named_by_the_bag(Path(source.files[0]).parent):
            yield tuple(map(Path, source.files))
        return
    with TemporaryDirectory(prefix='shipdrag-fleet-') as made:
        folder = Path(made) / posixpath.basename(source.bag.rstrip('/'))
        folder.mkdir()
        copies = [_copy(url, folder) for url in source.files]
        with _named_by_the_bag(folder):
            yield tuple(copies)


def _copy(url: str, folder: Path) -> Path:
    from fsspec.core import url_to_fs

    copy = folder / posixpath.basename(url)
    try:
        fs, path = url_to_fs(url)
        fs.get_file(path, str(copy))
    except Exception as error:  # each file system has errors of its own
        raise BagError(f'{url!r} cannot be fetched: {error}') from error
    return copy


@contextmanager
def _named_by_the_bag(folder: Path) -> Iterator[None]:
    """Leave out of an error where the file stood: a fetched copy stands anywhere."""
    try:
        yield
    except (ShipdragError, OSError) as error:
        raise BagError(str(error).replace(f'{folder}/', '')) from error


def identify(source: BagToRead) -> Identity | str:
    """
    Read a bag once, for its digest.

    Returns
    -------
    Identity or str
        Or why it cannot be read.
    """
    try:
        with fetched(source) as files:
            return Identity(_digest(files), _recording(files) if source.may_be_part else '')
    except (ShipdragError, OSError) as error:
        return str(error)


def content_hash(
    digests: Sequence[str], source: BagToRead, learnt: Sequence[LearntTerm] = ()
) -> str:
    """
    Return what the rows of a bag depend on, as one digest.

    Parameters
    ----------
    digests
        Of the files of its parts, in their order.
    source
        The first part: the ship file, and `run.yaml` beside it.
    learnt
        Terms that count besides.
    """
    found = hashlib.sha256()
    beside = (source.beside.ship, source.beside.ship_name, source.run)
    for text in (*digests, *beside, *(term.to_yaml() for term in learnt)):
        piece = text.encode('utf-8', 'surrogatepass')
        found.update(len(piece).to_bytes(8, 'little') + piece)
    return found.hexdigest()


def _digest(files: Sequence[Path]) -> str:
    found = hashlib.sha256()
    for path in files:
        found.update(path.name.encode('utf-8', 'surrogateescape') if len(files) > 1 else b'')
        with path.open('rb') as file:
            while piece := file.read(_AT_ONCE_BYTES):
                found.update(piece)
    return found.hexdigest()


def _recording(files: Sequence[Path]) -> str:
    try:
        return McapFile(files[0]).contents.recording.get('recording_id', '')
    except BagError:
        return ''  # the job will say so


UNNAMED = 'unnamed'
_LONGEST_NAME = 80  # [bytes], and three times as long in the name of a folder


class BagJob(NamedTuple):
    """
    A bag to do.

    Attributes
    ----------
    sources
        The parts of one recording; of most bags, one.
    content_hash
        What the rows depend on, see `content_hash`.
    learnt
        Terms beside those of the ship file.
    """

    sources: tuple[BagToRead, ...]
    content_hash: str
    learnt: tuple[LearntTerm, ...] = ()


class _ShipInRun(NamedTuple):
    """The ship as she was in a run, the facts of her file alone, and what is known of the run."""

    ship: Ship
    facts: tuple[Fact, ...]
    sheet: RunSheet
    text: str
    warnings: tuple[str, ...]


def work(job: BagJob) -> BagResult:
    """
    Replay and diagnose a bag.

    Parameters
    ----------
    job
        From the search; read here, and nothing else.

    Returns
    -------
    BagResult
        With the reason in `error` where the bag could not be read.
    """
    try:
        with _runs(job.sources) as runs:
            return _result(job, runs)
    except (ShipdragError, OSError) as error:
        return failed(job, str(error))
    except Exception as error:  # one bag of thousands; the others go on
        place = traceback.extract_tb(error.__traceback__)[-1]
        return failed(
            job,
            f'a defect of this program, please report it: {type(error).__name__}: {error} '
            f'({Path(place.filename).name}:{place.lineno})',
        )


def _result(job: BagJob, runs: Sequence[Run]) -> BagResult:
    source = job.sources[0]
    rows: list[Row] = []
    warnings: list[str] = []
    messages = 0
    hull: _ShipInRun | None = None
    for run in runs:
        hull = _hull(job, run)
        result = replay(run, ship=hull.ship, compare=False)
        messages += sum(topic.messages for topic in run.topics)
        warnings += [*hull.warnings, *hull.ship.warnings, *run_warnings(result)]
        found, notes = _coastdowns(job, hull, result)
        rows += found
        warnings += notes
    assert hull is not None  # a bag without a run is an error
    return BagResult(
        _bag_row(job)
        | {
            'ship': _name(hull.ship, source),
            'coastdowns': sum('withdrawn' not in row['flags'] for row in rows),
            'messages': messages,
            'warnings': list(dict.fromkeys(warnings)),
        },
        tuple({**row, 'ship': _name(hull.ship, source)} for row in rows),
        hull.text,
    )


def _coastdowns(
    job: BagJob, hull: _ShipInRun, result: ReplayResult
) -> tuple[list[Row], list[str]]:
    """Return a row for each coastdown, those withdrawn too, and what is to be said."""
    context = {
        'bag': job.sources[0].bag,
        'content_hash': job.content_hash,
        'software_version': __version__,
        'water_temperature_c': hull.sheet.temperature_c,
        'facts': [str(fact) for fact in result.ship.facts],
    }
    shared = ['clocks_apart'] if clocks_apart(result) else []
    if result.run.warnings:
        shared.append('damaged')
    row = partial(coastdown_row, ship=hull.ship, context=context, flags=shared)
    rows, notes = [], []
    windows = coast_windows(result)
    for coastdown, window in windows:
        diagnosis, said = _diagnosis(result, hull, coastdown, window)
        notes += [f'the coastdown at {coastdown.start_ns} ns{each}' for each in said]
        rows.append(row(coastdown, diagnosis=diagnosis))
    ended = (event for event in result.events if isinstance(event, EndedCoastdown))
    rows += [row(each, diagnosis=None) for each in ended if each.withdrawn]
    if not windows:
        notes.append(f'no coastdown was found: {why_no_coastdown(result)}')
        notes += _dismissed(result, hull)
    return sorted(rows, key=lambda row: int(row['time_ns'])), notes


def _diagnosis(
    result: ReplayResult, hull: _ShipInRun, coastdown: EndedCoastdown, window: Window
) -> tuple[DiagnosisResult | None, list[str]]:
    """Diagnose one coastdown; with the ends of sentences that are to be said of it."""
    run = CoastRun(Path(result.run.name).name, window, hull.sheet.facts)
    try:
        if hull.ship.baseline is None:
            return _held(result, hull, run), []
        glide = whole_window(result, coastdown)
        if glide is None:
            return _held(result, hull, run), []
        whole = partial(_held, result, hull, replace(run, window=glide))
        alone = partial(_held, result, hull, run)
        note = coastdown.disturbed or NOT_ALL
        found = with_whole_glides(alone, whole, (note,), coastdowns=1)
        return found, [f': {note}' for note in found.notes]
    except (DiagnosisError, EstimationError) as error:
        return None, [f' is not diagnosed: {error}']


def _dismissed(result: ReplayResult, hull: _ShipInRun) -> list[str]:
    """Diagnose a glide that was taken for none; it has no row, as it gives no r(v)."""
    if hull.ship.baseline is None:
        return []
    notes = []
    for glide in dismissed_glides(result):
        run = CoastRun(Path(result.run.name).name, glide, hull.sheet.facts)
        try:
            said = sentence(_held(result, hull, run))
        except ShipdragError as error:  # a glide that is like none may not be followed
            said = f'it could not be: {error}'
        notes.append(f'{DISMISSED}. All of it compared with the model: {said}')
    return notes


def _held(result: ReplayResult, hull: _ShipInRun, run: CoastRun) -> DiagnosisResult:
    ship = replace(hull.ship, facts=hull.facts)
    return diagnose([run], ship, result.parameters, advise=False)


def _hull(job: BagJob, run: Run) -> _ShipInRun:
    """Return the ship as she was in a run: the file beside it or attached, and `run.yaml`."""
    source = job.sources[0]
    attached, beside = run.attachments.get(SHIP_FILE, ''), source.beside.ship
    own, above = (
        Ship.from_yaml(text, subject=f'{SHIP_FILE} {where}') if text else None
        for text, where in ((attached, 'attached'), (beside, 'above'))
    )
    ship, text = above or own, beside or attached
    warnings: tuple[str, ...] = ()
    if ship is None:
        raise BagError(
            f'no {SHIP_FILE} is attached, and none lies beside it or in a folder above, up to the '
            'one given; put one there, or give the folder that holds it'
        )
    if own and above and own.name and own.name != (above.name or source.beside.ship_name):
        # a recording knows best which ship it is of
        ship, text = own, attached
        warnings = (
            f'the {SHIP_FILE} above is of {above.name!r}, the one attached of {own.name!r}, '
            'which is used',
        )
    sheet = RunSheet.from_yaml(source.run, subject=RUN_FILE) if source.run else RunSheet()
    was = carrying(sheet.of(ship, subject=RUN_FILE), job.learnt)
    return _ShipInRun(was, ship.facts, sheet, text, warnings)


def _name(ship: Ship, source: BagToRead) -> str:
    """Return the name under which the store keeps a ship: that of a folder, too."""
    name = ship.name or source.beside.ship_name or UNNAMED
    if not name.isprintable() or len(name.encode()) > _LONGEST_NAME:
        raise BagError(
            f'the name of the ship, {name[:40]!r}, has characters that cannot be printed or more '
            f'than {_LONGEST_NAME} bytes; give a shorter one in {SHIP_FILE}'
        )
    return name


def _bag_row(job: BagJob, error: str | None = None) -> Row:
    return bag_row(job.sources[0].root, job.sources[0].bag, job.content_hash, error=error)


def failed(job: BagJob, why: str) -> BagResult:
    """Return the row of a bag of which nothing came."""
    return BagResult(_bag_row(job, why))


@contextmanager
def _runs(sources: Sequence[BagToRead]) -> Iterator[list[Run]]:
    """Open the runs of a bag, whatever it is written in."""
    with ExitStack() as stack:
        paths: list[Path] = []
        for source in sources:
            files = stack.enter_context(fetched(source))
            paths += [files[0].parent] if source.folder else files
        yield read_any(paths)
