# SPDX-License-Identifier: Apache-2.0
"""The service manager hears that the node is ready, goes round, and ends: over its own socket."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip('rclpy')

WITHIN_S = 200.0


@pytest.fixture
def manager(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A socket as systemd offers it, in the abstract namespace."""
    name = f'shipdrag-notify-{os.getpid()}'
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(f'\0{name}')
        listening.settimeout(WITHIN_S)
        monkeypatch.setenv('NOTIFY_SOCKET', f'@{name}')
        yield listening


def heard_until(manager: socket.socket, wanted: str) -> list[str]:
    """Return all lines until one is there."""
    lines: list[str] = []
    end_s = time.monotonic() + WITHIN_S
    while wanted not in lines:
        assert time.monotonic() < end_s, lines
        lines += manager.recv(4096).decode().splitlines()
    return lines


def said(manager: socket.socket) -> bytes:
    """Return the next message, none where there is none in time."""
    try:
        return manager.recv(4096)
    except TimeoutError:
        return b''


def test_ready_once_active_then_alive_each_second_then_stopping(start_node, manager):
    node = start_node(up=None, record=False)
    before = heard_until(manager, 'READY=1')
    assert 'active; ' in node.log
    assert 'STOPPING=1' not in before
    for _ in range(3):
        heard_until(manager, 'WATCHDOG=1')
    status = next(line for line in heard_until(manager, 'WATCHDOG=1') if 'STATUS=' in line)
    assert status.startswith('STATUS=')
    assert len(status) > len('STATUS=')
    node.pause()  # one that stands still says nothing: the manager starts it again
    manager.settimeout(3.0)
    while said(manager):
        pass
    node.go_on()
    manager.settimeout(WITHIN_S)
    heard_until(manager, 'WATCHDOG=1')
    assert node.stop() == 0
    heard_until(manager, 'STOPPING=1')


def test_a_node_that_does_not_start_is_never_ready(start_node, manager):
    node = start_node(up=None, ship_file='/nowhere/ship.yaml')
    assert node.wait() == 1
    manager.settimeout(0.1)
    while message := said(manager):
        assert b'READY=1' not in message


def test_a_manager_that_is_gone_ends_no_node(start_node: Any, monkeypatch) -> None:
    monkeypatch.setenv('NOTIFY_SOCKET', '/nowhere/notify')
    node = start_node(record=False)
    assert node.stop() == 0
