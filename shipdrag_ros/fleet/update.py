# SPDX-License-Identifier: Apache-2.0
"""
A store brought up to what lies below some folders.

What is done already, by content and version of this program, is not done again.
"""

from __future__ import annotations

import hashlib
import posixpath
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from shipdrag_ros import __version__
from shipdrag_ros.fleet.engine import DIED, Engine, Lost
from shipdrag_ros.fleet.find import EVENTS_FILE, SHIP_FILE, BagToRead, FoundBags, Skipped
from shipdrag_ros.fleet.job import BagJob, Identity, content_hash, failed, identify, work
from shipdrag_ros.fleet.store import (
    BagResult,
    Done,
    HullEvent,
    Store,
    bag_row,
    read_coastdowns,
    read_events,
    same_time,
    write_events,
)
from shipdrag_ros.progress import Progress
from shipdrag_ros.simulation.effects import terms


class Twin(NamedTuple):
    """A bag with the content of another, which stands for both."""

    bag: str
    same_as: str
    differs: bool = False
    """Whether another ship file or run file lies beside it, which is not used."""


@dataclass(frozen=True)
class Report:
    """
    What became of the bags.

    Attributes
    ----------
    bags
        All that are below the folders and in the store now, by content hash.
    new
        Number of bags that were replayed now; those that could not be are in `skipped`.
    removed
        Number of bags whose content has changed; their former rows are gone.
    twins
        Bags that are not in the store since another has their content.
    skipped
        Bags that could not be read, and why.
    notes
        What else is to be said, a sentence each.
    """

    bags: Mapping[str, Done]
    new: int
    removed: int
    twins: tuple[Twin, ...]
    skipped: tuple[Skipped, ...]
    notes: tuple[str, ...]


def update(found: FoundBags, store: Store, engine: Engine, progress: Progress) -> Report:
    """
    Replay and diagnose what the store does not have.

    Parameters
    ----------
    found
        What lies below the folders.
    store
        To bring up to date.
    engine
        Running.
    progress
        Called with how far it is.

    Raises
    ------
    FleetError
        If the store cannot be read or written.
    """
    jobs, twins, unread = _jobs(found.sources, engine, progress)
    unread = [*found.skipped, *unread]
    before = store.done()
    names = {(part.root, part.bag) for job in jobs.values() for part in job.sources}
    names |= {(each.root, each.bag) for each in unread}
    stale = [
        digest
        for digest, done in before.items()
        if digest not in jobs and (done.root, done.bag) in names
    ]
    for digest in stale:
        store.remove(digest)
    to_do = {key: job for key, job in jobs.items() if not _is_done(before.get(key))}
    texts = _do(to_do, store, engine, progress)
    for each in unread:
        store.write(_unread(each))
    after = store.done()
    bags = {key: after[key] for key in jobs}
    notes = [*found.notes, *_keep_ships(store, jobs, bags, texts), *_at_once(store)]
    gone = sum(
        (done.root, done.bag) not in names for key, done in before.items() if key not in jobs
    )
    if gone:
        notes.append(
            f'{gone} bag(s) of the store are not below these folders; their rows stay in it'
        )
    skipped = [Skipped(done.root, done.bag, done.error) for done in bags.values() if done.error]
    changed = sum(before[digest].error is None for digest in stale)
    return Report(
        bags,
        sum(bags[key].error is None for key in to_do),
        changed,
        tuple(twins),
        tuple(sorted([*skipped, *unread], key=lambda each: (each.root, each.bag))),
        tuple(notes),
    )


def _jobs(
    sources: Sequence[BagToRead], engine: Engine, progress: Progress
) -> tuple[dict[str, BagJob], list[Twin], list[Skipped]]:
    """Return what is to be done by content hash, in the order of the search."""
    known: dict[int, Identity] = {}
    unread: list[Skipped] = []
    items = {f'{number}': source for number, source in enumerate(sources)}
    for key, found in engine.map(identify, items):
        if isinstance(found, Identity):
            known[int(key)] = found
        else:
            reason = found.reason if isinstance(found, Lost) else found
            unread.append(Skipped(items[key].root, items[key].bag, reason))
        progress('reading the bags', len(known) + len(unread), len(items))
    copies: dict[tuple[str, ...], list[tuple[BagToRead, ...]]] = defaultdict(list)
    for numbers in _recordings(sources, known):
        digests = tuple(known[number].digest for number in numbers)
        copies[digests].append(tuple(sources[number] for number in numbers))
    learnt = terms()
    jobs: dict[str, BagJob] = {}
    twins: list[Twin] = []
    for digests, same in copies.items():
        parts = max(same, key=lambda each: bool(each[0].run))  # the first that says most
        digest = content_hash(digests, parts[0], learnt)
        jobs[digest] = BagJob(parts, digest, learnt)
        for other in same:
            if other is not parts:
                differs = (other[0].beside.ship, other[0].run) != (
                    parts[0].beside.ship,
                    parts[0].run,
                )
                twins.append(Twin(other[0].bag, parts[0].bag, differs))
    return jobs, twins, unread


def _at_once(store: Store) -> Iterator[str]:
    """Say which runs are there twice by their time, of each ship."""
    table = read_coastdowns(store.path).to_pylist()
    rows = [row for row in table if not row['error']]
    for name, group in groupby(rows, key=itemgetter('ship')):
        own = list(group)
        twice = same_time(own)
        for number, other in list(twice.items())[:1]:
            yield (
                f'{len(twice)} coastdown(s) of {name!r} were recorded at the same time as '
                f'another, {own[number]["bag"]!r} and {own[other]["bag"]!r} for one; the trend '
                'counts a run once: remove what is a copy'
            )


def _recordings(sources: Sequence[BagToRead], known: Mapping[int, Identity]) -> list[list[int]]:
    """Put the parts of one recording together; a part that is there twice counts once."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for number in sorted(known):
        source, identity = sources[number], known[number]
        folder = posixpath.dirname(source.files[0])
        key = (folder, identity.recording) if identity.recording else (str(number),)
        group = groups.setdefault(key, [])
        if all(known[other].digest != identity.digest for other in group):
            group.append(number)
    return list(groups.values())


def _is_done(done: Done | None) -> bool:
    return (
        done is not None
        and done.software_version == __version__
        and not (done.error or '').startswith(DIED)
    )


def _do(
    jobs: Mapping[str, BagJob], store: Store, engine: Engine, progress: Progress
) -> dict[str, str]:
    """Do what is to be done, and return the ship file of each, by content hash."""
    texts: dict[str, str] = {}
    for key, found in engine.map(work, jobs):
        result = failed(jobs[key], found.reason) if isinstance(found, Lost) else found
        store.write(result)
        texts[key] = result.ship_file
        progress('replaying and diagnosing', len(texts), len(jobs))
    return texts


def _unread(skipped: Skipped) -> BagResult:
    """Return the row of a bag that could not be read."""
    root, bag, reason = skipped.root, skipped.bag, skipped.reason
    digest = hashlib.sha256(f'unread\0{root}\0{bag}'.encode('utf-8', 'replace')).hexdigest()
    return BagResult(bag_row(root, bag, digest, error=reason))


def _keep_ships(
    store: Store, jobs: Mapping[str, BagJob], bags: Mapping[str, Done], texts: Mapping[str, str]
) -> list[str]:
    """Keep the ship file and the known events of each ship; return what is odd about them."""
    ship_files: dict[str, dict[str, None]] = defaultdict(dict)  # sets that keep the order
    event_files: dict[str, dict[str, None]] = defaultdict(dict)
    for key, job in sorted(jobs.items(), key=lambda item: item[1].sources[0].bag):
        name, beside = bags[key].ship, job.sources[0].beside
        if name is None:
            continue
        ship_file = texts.get(key) or beside.ship
        if ship_file:
            ship_files[name].pop(ship_file, None)  # the last bag says what she is
            ship_files[name][ship_file] = None
        if beside.events:
            event_files[name][beside.events] = None
        event_files.setdefault(name, {})
    notes = []
    for name in event_files:
        files = list(ship_files[name])
        if len(files) > 1:
            notes.append(
                f'{len(files)} different ship files are of {name!r}; each bag is replayed with '
                f'its own, and {SHIP_FILE} of the last one is kept in the store'
            )
        events: set[HullEvent] = set()
        for text in event_files[name]:
            read, problems = read_events(text)
            events.update(read)
            notes += [f'{name}: {problem}' for problem in problems]
        kept = {EVENTS_FILE: write_events(sorted(events)) if events else ''}
        if files:
            kept[SHIP_FILE] = files[-1]
        store.keep_ship(name, kept)
    return notes
