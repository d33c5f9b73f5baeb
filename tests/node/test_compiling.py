# SPDX-License-Identifier: Apache-2.0
"""Compiling in a thread, while the node hears and answers."""

from __future__ import annotations

import threading

import pytest

from shipdrag_ros.node import background as compiling_module
from shipdrag_ros.node.background import COMPILER, Compiling, leave_if_compiling
from shipdrag_ros.parameters import Parameters


def test_compiling_is_never_waited_for_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()  # or it may be over before it is looked at
    monkeypatch.setattr(compiling_module, 'warm', lambda parameters: go_on.wait(240.0))
    compiling = Compiling(Parameters())
    assert not compiling.done()
    assert compiling.seconds == 0.0
    compiling.begin()
    compiling.begin()  # once only
    running = [thread for thread in threading.enumerate() if thread.name == COMPILER]
    assert [thread.daemon for thread in running] == [True]  # or the process could not end
    assert not compiling.done()
    go_on.set()
    running[0].join(240.0)
    assert compiling.done()
    assert compiling.failure == ''
    assert compiling.seconds > 0.0
    leave_if_compiling(1)  # and goes on, as nothing compiles
