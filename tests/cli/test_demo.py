# SPDX-License-Identifier: Apache-2.0
"""The demonstration, in processes of its own, on loopback."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

pytest.importorskip('rclpy')

SHIPDRAG = Path(sys.executable).with_name('shipdrag')
LIMIT_S = 240.0


def start(out: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [SHIPDRAG, 'demo', '--out', out, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def sailing(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], psutil.Process]]:
    """A demonstration whose node is active, and its node."""
    demo = start(tmp_path / 'demo')
    log = tmp_path / 'demo' / 'node.log'
    children: list[psutil.Process] = []
    try:
        end_s = time.monotonic() + LIMIT_S
        while not (log.exists() and 'hearing' in log.read_text()):
            assert demo.poll() is None
            assert time.monotonic() < end_s
            time.sleep(0.1)
        children = psutil.Process(demo.pid).children()
        (node,) = children
        yield demo, node
    finally:
        demo.kill()
        for child in children:
            if child.is_running():  # compares the time of its start too
                child.kill()
        demo.communicate()


def test_it_ends_at_once_and_takes_its_node_along(sailing):
    demo, node = sailing
    demo.send_signal(signal.SIGINT)
    _, errors = demo.communicate(timeout=LIMIT_S)
    assert demo.returncode == 130
    assert errors.splitlines()[1:] == []
    assert not node.is_running()


def test_the_whole_way(tmp_path: Path) -> None:
    out = tmp_path / 'demo'
    demo = start(out, '--speed-up', '150')
    try:
        said, errors = demo.communicate(timeout=LIMIT_S)
    finally:
        demo.kill()
    assert demo.returncode == 0, errors
    assert errors.splitlines()[1:] == []
    assert 's after the stop:' in said
    assert 'true r [m/s²]' in said
    result = json.loads((out / 'result.json').read_text())
    (coastdown,) = result['coastdowns']
    recorded = result['recorded']
    assert recorded['compared'] == recorded['identical'] > 100
    assert coastdown['estimator'] == 'one'
    (bag,) = (out / 'recordings').glob('*.mcap')
    for path in (bag, out / 'report.html', out / 'curves.csv', out / 'node.log'):
        assert str(path) in said
        assert path.stat().st_size > 0


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    out = tmp_path / 'demo'
    out.mkdir()
    (out / 'recordings').write_text('in the way')
    demo = start(out)
    _, errors = demo.communicate(timeout=LIMIT_S)
    assert demo.returncode == 1
    assert errors.startswith('ERROR: ')
    assert 'Traceback' not in errors
