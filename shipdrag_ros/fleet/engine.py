# SPDX-License-Identifier: Apache-2.0
"""
Many workers, by Dask: a cluster of this machine, or one that exists.

A worker that dies takes nothing with it: what it was doing is done again by
another. What was on hand whenever workers died is tried once more at the end,
one at a time, so that only what kills its worker by itself is given up.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from shipdrag_ros import __version__
from shipdrag_ros.errors import FleetError, reason_of

if TYPE_CHECKING:  # takes most of a second to import
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
