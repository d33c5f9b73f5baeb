# SPDX-License-Identifier: Apache-2.0
"""
Deltas are taken by a real signalk-server, and read back from it.

It is found on PATH or by SHIPDRAG_SIGNALK (path of its `signalk-server`); without one this is
skipped. `npm install signalk-server` has it.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.live.app import UNITS

SHIP = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
WITHIN_S = 120.0
NAME = 'SHIPDRAG_SIGNALK'
# the server has no setting for the address that it listens on
ALONE = """
const { Server } = require('net');
const { listen } = Server.prototype;
Server.prototype.listen = function (port, ...rest) {
  const then = rest.filter(each => typeof each === 'function');
  return listen.call(this, { port: Number(port), host: '127.0.0.1' }, ...then);
};
"""


@pytest.fixture
def program() -> str:
    """The server's own start file."""
    found = os.environ.get(NAME) or shutil.which('signalk-server')
    if not found or not shutil.which('node'):
        pytest.skip(f'no signalk-server: none on PATH, and {NAME} names none (npm has it)')
    return found


@pytest.fixture
def played(program: str, tmp_path: Path, start: Any) -> tuple[str, int]:
    """A bag that is played: address of the page, and the port of its deltas."""
    bag = tmp_path / 'out.mcap'
    line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--speed', '8', '--seed', '1']
    assert main([*line, '--lead-in', '400', '--duration', '400']) == 0
    options = ('--port', '0', '--signal-k', '0', '--speed', '1000')
    watch = start('shipdrag_ros.cli', 'watch', str(bag), *options)
    url = watch.wait_for(r'the page: (\S+)')
    return url, int(watch.wait_for(r'Signal K deltas: tcp://127.0.0.1:(\d+)'))


@pytest.fixture
def server(program: str, tmp_path: Path, played: tuple[str, int]) -> Iterator[str]:
    """A signalk-server that reads the deltas: the address of its self vessel."""
    with socket.create_server(('127.0.0.1', 0)) as free:
        port = free.getsockname()[1]
    options = {'type': 'SignalK', 'subOptions': {'type': 'tcp', 'host': '127.0.0.1'}}
    options['subOptions']['port'] = str(played[1])  # type: ignore[index]
    pipe = [{'type': 'providers/simple', 'options': options}]
    off = ('nmea-tcp', 'tcp', 'appstore', 'applicationData', 'webapps', 'plugins')
    settings = {
        'port': port,
        'mdns': False,
        'interfaces': dict.fromkeys(off, False),
        'pipedProviders': [{'id': 'shipdrag', 'enabled': True, 'pipeElements': pipe}],
    }
    folder = tmp_path / 'signalk'
    folder.mkdir()
    (folder / 'settings.json').write_text(json.dumps(settings))
    (folder / 'alone.js').write_text(ALONE)
    environment = os.environ | {
        'SIGNALK_NODE_CONFIG_DIR': str(folder),
        'NODE_OPTIONS': f'--require {folder / "alone.js"}',
        'DISABLEPLUGINS': 'true',
        'SIGNALK_DISABLE_SERVER_UPDATES': 'true',
        'HOME': str(folder),
    }
    with (folder / 'log').open('w') as log:
        process = subprocess.Popen(
            ['node', program, '-c', str(folder)], stdout=log, stderr=log, env=environment
        )
    try:
        yield f'http://127.0.0.1:{port}/signalk/v1/api/vessels/self'
    finally:
        process.kill()
        process.wait()


def read(url: str) -> Any:
    """What a server answers; None while it does not."""
    try:
        answer = httpx.get(url, timeout=30.0)
    except httpx.TransportError:
        return None
    return answer.json() if answer.status_code == 200 else None


def _holds(found: Any, said: Any) -> bool:
    """Whether a server has a value; to a notification it adds what is its own."""
    if isinstance(said, dict) and isinstance(found, dict):
        return found.items() >= said.items()
    return bool(found == said)


def test_a_signalk_server_takes_the_figures_and_gives_them_back(server, played):
    end_s = time.monotonic() + WITHIN_S
    said: dict[str, Any] = {}
    while 'RECORD ENDS' not in str(said):
        assert time.monotonic() < end_s, said
        time.sleep(0.2)
        deltas = read(f'{played[0]}signalk/v1/deltas') or []
        said = {
            each['path']: each['value']
            for delta in deltas
            for update in delta['updates']
            for each in update.get('values', [])
        }
    assert len(said) == len(UNITS) + 1
    for path, value in said.items():
        url = f'{server}/{path.replace(".", "/")}'
        while not _holds((found := read(url) or {}).get('value'), value):
            assert time.monotonic() < end_s, (path, value, found)
            time.sleep(0.2)
        if not path.startswith('notifications'):  # of these the server's own API is the source
            assert found['$source'].startswith('shipdrag')
            assert found['meta']['units']
    assert read(f'{server}/performance/shipdrag/effectivePower/meta')['units'] == 'W'
