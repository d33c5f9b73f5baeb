# SPDX-License-Identifier: Apache-2.0
"""
A store brought up to what lies below some folders, by many workers of Dask.

What is done already, by content and version of this program, is not done again. A worker that
dies takes nothing with it: what it was doing is done again by another. What was on hand whenever
workers died is tried once more at the end, one at a time, so that only what kills its worker by
itself is given up.
"""

from __future__ import annotations

import asyncio
import hashlib
import posixpath
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from shipdrag_ros import __version__
from shipdrag_ros.errors import FleetError, reason_of
from shipdrag_ros.fleet.find import EVENTS_FILE, BagToRead, FoundBags, Skipped
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
from shipdrag_ros.ship import SHIP_FILE
from shipdrag_ros.simulation.effects import terms

if TYPE_CHECKING:
    from distributed import Client, Future
Item = TypeVar('Item')
Result = TypeVar('Result')
DEATHS = 2
"""Of workers that a bag may be on hand at, before it is put off."""
DIED = 'its worker died'
"""What the reason begins with where nothing came back."""
_CONNECT_S = 30.0
_REACHED_S = 5.0  # a scheduler that is there answers at once
_GIVEN_UP = '1 hour'
_LOOK_S = 60.0  # between looks at whether a worker is left


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
    others = {digest: done for digest, done in before.items() if digest not in jobs}
    stale = [digest for digest, done in others.items() if (done.root, done.bag) in names]
    for digest in stale:
        store.remove(digest)
    to_do = {key: job for key, job in jobs.items() if not _is_done(before.get(key))}
    texts = _do(to_do, store, engine, progress)
    for each in unread:
        store.write(_unread(each))
    after = store.done()
    bags = {key: after[key] for key in jobs}
    notes = [*found.notes, *_keep_ships(store, jobs, bags, texts), *_at_once(store)]
    if gone := len(others) - len(stale):
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
        kept = parts[0]
        digest = content_hash(digests, kept, learnt)
        jobs[digest] = BagJob(parts, digest, learnt)
        for other in (each[0] for each in same if each is not parts):
            differs = (other.beside.ship, other.run) != (kept.beside.ship, kept.run)
            twins.append(Twin(other.bag, kept.bag, differs))
    return jobs, twins, unread


def _at_once(store: Store) -> Iterator[str]:
    """Say which runs are there twice by their time, of each ship."""
    rows = [row for row in read_coastdowns(store.path).to_pylist() if not row['error']]
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


class Lost(NamedTuple):
    """Nothing came back, and why."""

    reason: str


class Engine:
    """
    Workers of one thread each; a context manager.

    Parameters
    ----------
    workers
        How many, on this machine; one a core by default.
    scheduler
        Address of a cluster to use instead, `tcp://host:8786`.
    at_most
        More workers than this have nothing to do, and are not started.

    Raises
    ------
    FleetError
        If the cluster cannot be reached, or runs another version of this program.
    """

    def __init__(
        self,
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        at_most: int | None = None,
    ) -> None:
        self._workers = workers
        self._at_most = at_most
        self._scheduler = scheduler
        self._open = ExitStack()
        self._client: Client  # once it is entered

    def __enter__(self) -> Self:
        import dask
        import distributed  # noqa: F401  # its own defaults first, or they are lost again

        # only what this process starts is set here; a scheduler elsewhere has its own
        self._open.enter_context(
            dask.config.set(
                {
                    'distributed.scheduler.allowed-failures': DEATHS - 1,
                    'distributed.comm.timeouts.connect': f'{_CONNECT_S:g}s',
                    # so long after a death a worker that is not there just then is given up
                    'distributed.deploy.lost-worker-timeout': _GIVEN_UP,
                    # what it samples of a worker's stacks grows by half a megabyte a bag
                    'distributed.worker.profile.enabled': False,
                }
            )
        )
        try:
            self._client = self._connected()
            self._check_versions()
        except BaseException:
            self._open.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    @property
    def address(self) -> str:
        """Of the scheduler, for other programs."""
        return str(self._client.scheduler_info()['address'])

    def on_each(self, function: Callable[[], Result]) -> dict[str, Result]:
        """
        Call a function on each worker; return what it gives, by the worker's address.

        A worker that dies meanwhile is left out.
        """
        found: dict[str, Result] = self._client.run(function, on_error='ignore')
        return found

    def map(
        self, function: Callable[[Item], Result], items: Mapping[str, Item]
    ) -> Iterator[tuple[str, Result | Lost]]:
        """
        Apply a function to items; yield what comes as it comes.

        Parameters
        ----------
        function
            That can be done again without harm.
        items
            By a key of their own; they, and the results, travel.

        Yields
        ------
        key, result
            `Lost` where workers died of it again and again.

        Raises
        ------
        FleetError
            If no worker is left.
        """
        put_off = []
        futures = {self._submit(function, key, item): key for key, item in items.items()}
        for key, result in self._finished(futures):
            if isinstance(result, Lost):
                put_off.append(key)
            else:
                yield key, result
        for key in sorted(put_off):
            yield from self._finished({self._submit(function, key, items[key], again=True): key})

    def _finished(self, futures: dict[Future[Result], str]) -> Iterator[tuple[str, Result | Lost]]:
        """Yield results as they come; that no worker is left to give any is an error."""
        from distributed import as_completed

        without = 0
        while futures:
            try:
                for future in as_completed(list(futures), loop=self._client.loop, timeout=_LOOK_S):
                    without = 0
                    yield futures.pop(future), _result(future)
                    future.release()
            except TimeoutError:
                # a worker that has died is soon there again; once more, and none comes
                without = 0 if self._client.scheduler_info()['workers'] else without + 1
                if without > 1:
                    raise FleetError(
                        f'no worker is left, and {len(futures)} bag(s) are not done; what is '
                        'done is kept: run it again'
                    ) from None

    def _submit(
        self, function: Callable[[Item], Result], key: str, item: Item, *, again: bool = False
    ) -> Future[Result]:
        name = f'{function.__name__}{"-again" if again else ""}-{key}'
        return self._client.submit(function, item, key=name, pure=False)

    def _connected(self) -> Client:
        from dask.system import CPU_COUNT
        from distributed import Client, LocalCluster

        if self._scheduler is not None:
            try:
                # a client that fails to begin takes a minute to end, so look first
                with ThreadPoolExecutor(1) as pool:  # where called from, a loop may run already
                    pool.submit(asyncio.run, _reach(self._scheduler)).result()
                client = Client(self._scheduler, timeout=_CONNECT_S, set_as_default=False)
            except Exception as error:  # whatever a server says that is no scheduler
                raise FleetError(
                    f'--scheduler {self._scheduler!r} cannot be reached: {reason_of(error)}; '
                    'start one with `dask scheduler` and `dask worker --nthreads 1`, and give '
                    'its address, not that of its dashboard'
                ) from error
            return self._open.enter_context(client)
        folder = self._open.enter_context(TemporaryDirectory(prefix='shipdrag-dask-'))
        workers = self._workers or CPU_COUNT
        if self._at_most is not None:
            workers = max(1, min(workers, self._at_most))
        cluster = self._open.enter_context(
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host='127.0.0.1',
                dashboard_address='127.0.0.1:0',
                worker_dashboard_address='127.0.0.1:0',
                local_directory=folder,
                silence_logs=50,  # what becomes of each bag is said here
            )
        )
        return self._open.enter_context(Client(cluster, set_as_default=False))

    def _check_versions(self) -> None:
        if self._scheduler is None:
            return
        if not self._client.scheduler_info()['workers']:
            raise FleetError(
                f'--scheduler {self._scheduler!r} has no worker; start some with `dask worker '
                f'{self._scheduler} --nthreads 1`'
            )
        try:
            found: dict[str, str] = self._client.run(_version)
        except Exception as error:  # whatever a worker without this package says
            raise FleetError(
                f'the workers of {self._scheduler!r} cannot run this program: {error}; install '
                f'shipdrag_ros {__version__} on them'
            ) from error
        others = {address: version for address, version in found.items() if version != __version__}
        if others:
            raise FleetError(
                f'workers run another version than {__version__}: {others}; install the same'
            )


async def _reach(address: str) -> None:
    from distributed.comm import connect
    from distributed.security import Security

    security = Security().get_connection_args('client')
    try:
        async with asyncio.timeout(2.0 * _REACHED_S):  # connect waits for ever for a greeting
            comm = await connect(address, timeout=_REACHED_S, **security)
    except TimeoutError:
        raise OSError('what is there does not answer as a scheduler does') from None
    comm.abort()


def _version() -> str:
    return __version__


def _result(future: Future[Any]) -> Any:
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    try:
        return future.result()
    except FutureCancelledError as error:  # nobody here cancels; it was lost with the scheduler
        raise FleetError(
            f'the scheduler is gone: {error.reason}; what is done is kept: run it again'
        ) from error
    except KilledWorker:
        return Lost(
            f'{DIED} {DEATHS} times, and so it did when nothing else was being done: it '
            'needs more memory than a worker has, or crashes it'
        )
