# SPDX-License-Identifier: Apache-2.0
"""Bags in an object store, which is moto's server on this machine."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import boto3
import pytest
import s3fs
from moto.moto_server.threaded_moto_server import ThreadedMotoServer

from shipdrag_ros.errors import FleetError
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.job import work

from .conftest import SHIP, job_of, only_source


@pytest.fixture
def bucket(bags: list[Path], monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    server = ThreadedMotoServer(ip_address='127.0.0.1', port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in (
        ('AWS_ENDPOINT_URL', f'http://{host}:{port}'),
        ('AWS_ACCESS_KEY_ID', 'a'),
        ('AWS_SECRET_ACCESS_KEY', 'b'),
        ('AWS_DEFAULT_REGION', 'us-east-1'),
    ):
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    client = boto3.client('s3')
    client.create_bucket(Bucket='fleet')
    client.upload_file(str(SHIP), 'fleet', 'all/bering/ship.yaml')
    for number in (1, 2):
        client.upload_file(str(bags[number]), 'fleet', f'all/bering/2026/{number} +%.mcap')
    client.put_object(
        Bucket='fleet', Key='all/bering/2026/2 +%.mcap.run.yaml', Body=b'draught_m: 8'
    )
    client.put_object(Bucket='fleet', Key='all/empty.mcap', Body=b'')
    yield 's3://fleet/all'
    server.stop()
    s3fs.S3FileSystem.clear_instance_cache()


def test_bags_are_found_and_give_the_rows_of_local_ones(bucket, bags, tmp_path):
    sources = find([bucket]).sources
    assert [source.bag for source in sources] == [
        'empty.mcap',
        'bering/2026/1 +%.mcap',
        'bering/2026/2 +%.mcap',
    ]
    assert sources[1].files == ('s3://fleet/all/bering/2026/1 +%.mcap',)
    assert (sources[1].run, sources[2].run) == ('', 'draught_m: 8')
    assert 'Vitus Bering' in sources[1].beside.ship
    (tmp_path / 'ship.yaml').write_text(SHIP.read_text())
    shutil.copy(bags[1], tmp_path / '1 +%.mcap')
    remote, local = job_of(sources[1]), job_of(only_source(tmp_path / '1 +%.mcap'))
    (row,) = work(remote).coastdowns
    (own,) = work(local).coastdowns
    assert row['resistance_m_s2'].tobytes() == own['resistance_m_s2'].tobytes()
    assert work(job_of(sources[2])).coastdowns[0]['draught_m'] == 8.0
    empty = work(job_of(sources[0]))
    assert empty.bag['error'] == "'empty.mcap' is empty; nothing was recorded"


def test_a_bag_that_is_gone_when_it_is_read_is_told(bucket: str) -> None:
    source = find([bucket]).sources[1]
    job = job_of(source)
    boto3.client('s3').delete_object(Bucket='fleet', Key='all/bering/2026/1 +%.mcap')
    error = work(job).bag['error']
    assert "'s3://fleet/all/bering/2026/1 +%.mcap' cannot be fetched" in error


def test_no_bucket_and_no_server_are_told(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(FleetError, match='does not exist; give a folder of bags'):
        find(['s3://nowhere/at all'])
    with socket.socket() as nobody:
        nobody.bind(('127.0.0.1', 0))  # bound and not listening: refused
        monkeypatch.setenv('AWS_ENDPOINT_URL', f'http://127.0.0.1:{nobody.getsockname()[1]}')
        monkeypatch.setenv('AWS_MAX_ATTEMPTS', '1')
        s3fs.S3FileSystem.clear_instance_cache()
        with pytest.raises(FleetError, match=r'cannot be reached.*AWS_ENDPOINT_URL'):
            find([bucket])


def test_an_address_of_no_known_kind_is_told() -> None:
    with pytest.raises(FleetError, match="'gopher://x' cannot be reached"):
        find(['gopher://x'])
