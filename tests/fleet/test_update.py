# SPDX-License-Identifier: Apache-2.0
"""Workers that die, a store that does not notice, and the verb over all of it."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path

import cloudpickle
import dask
import pytest
from dask.utils import parse_timedelta
from distributed import Client, get_worker

from shipdrag_ros.cli import main
from shipdrag_ros.errors import FleetError
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.store import (
    BAGS,
    COASTDOWNS,
    Store,
    read_bags,
    read_coastdowns,
    ship_texts,
)
from shipdrag_ros.fleet.update import Engine, Lost, update
from shipdrag_ros.library.replaying import Notes
from shipdrag_ros.library.trends import trends_of

from .conftest import SHIP

cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import tests


@pytest.fixture(scope='module')
def engine() -> Iterator[Engine]:
    with Engine(workers=2) as running:
        yield running


def deadly(item: str) -> str:
    """Kill the worker for some items."""
    if item == 'deadly':
        os.kill(os.getpid(), signal.SIGKILL)
    return item.upper()


def contents(store: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in store.rglob('*')
        if path.is_file()
    }


def silent(text: str, done: int, total: int) -> None:
    """Take progress and say nothing."""


def test_the_verb_from_bags_to_rows_and_again(fleet_folder, tmp_path, engine, capsys):
    store, result = tmp_path / 'store', tmp_path / 'result.json'
    line = ['fleet', str(fleet_folder), '-o', str(store)]
    assert main([*line, '--workers', '1', '--json', str(result)]) == 1  # some bags were skipped
    said, progress = capsys.readouterr()
    assert '6 bag(s) found; 1 other file(s) left alone' in progress
    assert "'bering/2026/the same.mcap' has the content of 'bering/2026/run 1.mcap'" in said
    assert '5 skipped' in said
    for name in ('empty.mcap', 'fore\\nign.mcap', 'pipe.mcap', 'endless.mcap', 'gone.mcap'):
        assert f"  'other/{name}': " in said
    found = json.loads(result.read_text())
    assert found['ships'] == [{'name': 'Vitus Bering', 'bags': 3, 'coastdowns': 3}]
    assert (found['new'], len(found['skipped']), found['notes']) == (3, 5, [])
    assert '3 coastdown(s) of 3 bag(s); 3 bag(s) replayed now, 0 done before, 5 skipped' in said
    rows = read_coastdowns(store).to_pylist()
    assert [row['bag'] for row in rows] == [f'bering/2026/run {n}.mcap' for n in (1, 2, 3)]
    assert [row['error'] for row in rows] == [None] * 3
    assert ship_texts(store)['Vitus Bering']['events.csv'].splitlines()[1:] == [
        '2026-02-10T00:00:00Z,cleaning,Lisbon'
    ]

    # what is done is not done again, and a cluster that exists is used
    before = {path: path.stat().st_mtime_ns for path in (store / COASTDOWNS).rglob('*.parquet')}
    bytes_before = contents(store)
    assert main([*line, '--scheduler', engine.address, '--json', str(result)]) == 1
    assert json.loads(result.read_text())['new'] == 0
    assert '0 bag(s) replayed now, 3 done before, 5 skipped' in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert contents(store) == bytes_before

    # workers that are killed amid the work change no byte
    killed: list[int] = []

    def kill(text: str, done: int, total: int) -> None:
        if text.startswith('replaying') and done < total and len(killed) < 2:
            killed.extend(list(engine.on_each(os.getpid).values())[:1])
            os.kill(killed[-1], signal.SIGKILL)

    again = Store(tmp_path / 'again')
    update(find([str(fleet_folder)]), again, engine, kill)
    assert killed
    assert contents(again.path) == bytes_before


def test_only_what_kills_its_worker_by_itself_is_given_up(engine: Engine) -> None:
    items = {name: name for name in ('a', 'b', 'deadly', 'c', 'd')}
    found = dict(engine.map(deadly, items))
    lost = found.pop('deadly')
    assert isinstance(lost, Lost)
    assert 'its worker died' in lost.reason
    assert found == {'a': 'A', 'b': 'B', 'c': 'C', 'd': 'D'}


def stacks_kept(wait_s: float) -> int:
    """Return how many samples of its stacks the worker that runs this holds."""
    time.sleep(wait_s)
    return len(get_worker().profile_history)


def test_a_worker_holds_nothing_of_the_bags_that_it_has_done(engine: Engine) -> None:
    assert dict(engine.map(stacks_kept, {'one': 1.5})) == {'one': 0}  # Dask keeps one a second


def test_a_worker_that_dies_again_while_it_starts_is_waited_for(engine: Engine) -> None:
    """Dask looks 15 s after a death, and gives up the worker that is not there just then."""
    assert engine.address
    assert parse_timedelta(dask.config.get('distributed.deploy.lost-worker-timeout')) > 600.0


def test_a_bag_that_has_changed_takes_the_place_of_its_former_rows(bags, tmp_path, engine):
    folder, store = tmp_path / 'fleet', Store(tmp_path / 'store')
    folder.mkdir()
    for number in (1, 2):
        (folder / f'{number}.mcap').write_bytes(bags[number].read_bytes())
    assert update(find([str(folder)]), store, engine, silent).new == 2
    first = read_coastdowns(store.path)['time_ns'].to_pylist()
    (folder / '1.mcap').write_bytes(bags[3].read_bytes())
    report = update(find([str(folder)]), store, engine, silent)
    assert (report.new, report.removed, report.skipped) == (1, 1, ())
    second = read_coastdowns(store.path)['time_ns'].to_pylist()
    assert len(set(first) & set(second)) == 1
    assert len(list((store.path / BAGS).iterdir())) == 2
    # what is no longer there stays, and that is said
    (folder / '1.mcap').unlink()
    report = update(find([str(folder)]), store, engine, silent)
    assert len(read_bags(store.path)) == 2
    assert report.notes == (
        '1 bag(s) of the store are not below these folders; their rows stay in it',
    )


def test_a_run_is_counted_once_however_often_it_was_copied(bags, tmp_path, engine):
    """A folder under another name, a copy without its run file, and half of a bag."""
    folder, store = tmp_path / 'fleet', Store(tmp_path / 'store')
    for name in ('a copy', 'ship'):
        (folder / name).mkdir(parents=True)
        (folder / name / 'ship.yaml').write_text(SHIP.read_text())
        shutil.copy(bags[1], folder / name / 'run.mcap')
    (folder / 'ship' / 'run.yaml').write_text('{draught_m: 8.5}')
    report = update(find([str(folder)]), store, engine, silent)
    assert report.twins == (('a copy/run.mcap', 'ship/run.mcap', True),)
    assert read_coastdowns(store.path)['draught_m'].to_pylist() == [8.5]
    assert report.notes == ()
    # half of it is another content, and the same run
    whole = (folder / 'ship' / 'run.mcap').read_bytes()
    (folder / 'a copy' / 'run.mcap').write_bytes(whole[: int(0.75 * len(whole))])
    report = update(find([str(folder)]), store, engine, silent)
    assert len(read_coastdowns(store.path)) == 2
    (note,) = report.notes
    assert note.startswith("1 coastdown(s) of 'Vitus Bering' were recorded at the same time as")
    assert "'a copy/run.mcap' and 'ship/run.mcap' for one" in note
    [trend], _ = trends_of(Notes(), store.path)
    [left] = [point for point in trend.points if not point.used]
    assert left.bag == 'a copy/run.mcap'


@pytest.mark.parametrize('place', ['tcp://127.0.0.1:9', 'nonsense', 'http://127.0.0.1:8786'])
def test_a_scheduler_that_cannot_be_reached_is_told(place: str, monkeypatch) -> None:
    monkeypatch.setattr('shipdrag_ros.fleet.update._REACHED_S', 0.5)
    start_s = time.monotonic()
    with pytest.raises(FleetError, match='cannot be reached'), Engine(scheduler=place):
        pass
    assert time.monotonic() - start_s < 20.0


def test_a_scheduler_is_reached_from_within_a_loop(engine: Engine) -> None:
    async def address() -> str:
        with Engine(scheduler=engine.address) as found:
            return found.address

    with ThreadPoolExecutor(1) as apart:  # a loop of another test may run in this thread
        assert apart.submit(asyncio.run, address()).result() == engine.address


@pytest.mark.parametrize('says', [b'', b'HTTP/1.1 400 Bad Request\r\n\r\n'])
def test_what_is_no_scheduler_is_told(says: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('shipdrag_ros.fleet.update._REACHED_S', 0.5)
    with socket.create_server(('127.0.0.1', 0)) as server:
        place = f'tcp://127.0.0.1:{server.getsockname()[1]}'

        def answer() -> None:
            line, _ = server.accept()
            with line:
                line.sendall(says)
                while line.recv(4096):  # until the other side goes
                    pass

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        with pytest.raises(FleetError, match='cannot be reached'), Engine(scheduler=place):
            pass
        thread.join(10.0)
        assert not thread.is_alive()


def test_a_folder_without_a_bag_is_told(tmp_path, capsys) -> None:
    (tmp_path / 'empty').mkdir()
    assert main(['fleet', str(tmp_path / 'empty'), '-o', str(tmp_path / 'store')]) == 1
    assert 'no bag lies below' in capsys.readouterr().err


def test_that_no_worker_is_left_is_an_error_and_no_wait_for_ever(monkeypatch) -> None:
    monkeypatch.setattr('shipdrag_ros.fleet.update._LOOK_S', 1.0)
    with Engine(workers=1) as lonely:
        assert lonely._client is not None
        lonely._client.cluster.scale(0)
        end_s = time.monotonic() + 60.0
        while lonely._client.scheduler_info()['workers']:
            assert time.monotonic() < end_s
            time.sleep(0.1)
        with pytest.raises(FleetError, match='no worker is left, and 1 bag'):
            list(lonely.map(deadly, {'a': 'a'}))


def slow(item: str) -> str:
    time.sleep(60.0)
    return item


def test_a_scheduler_that_dies_is_an_error_that_says_so(tmp_path: Path) -> None:
    file = tmp_path / 'scheduler.json'
    dask_line = [sys.executable, '-m', 'dask']
    here = ['--no-dashboard', '--host', '127.0.0.1', '--scheduler-file', str(file)]
    one = ['--nthreads', '1', '--no-nanny', '--death-timeout', '20']
    with ExitStack() as ended:

        def start(*arguments: str) -> subprocess.Popen[bytes]:
            process = ended.enter_context(subprocess.Popen([*dask_line, *arguments]))
            ended.callback(process.kill)
            return process

        scheduler = start('scheduler', '--port', '0', *here)
        start('worker', *here, *one)
        end_s = time.monotonic() + 60.0
        while not file.exists():
            assert time.monotonic() < end_s
            time.sleep(0.1)
        with Engine(scheduler=_with_worker(file, end_s)) as remote:
            threading.Timer(1.0, scheduler.kill).start()
            with pytest.raises(FleetError, match='the scheduler is gone'):
                list(remote.map(slow, {'a': 'a'}))


def _with_worker(file: Path, end_s: float) -> str:
    """Return the address of a scheduler once it has a worker."""
    while True:
        assert time.monotonic() < end_s
        with suppress(json.JSONDecodeError), Client(scheduler_file=str(file)) as client:
            client.wait_for_workers(1, timeout=30.0)
            return str(client.scheduler.address)
