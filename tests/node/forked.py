# SPDX-License-Identifier: Apache-2.0
"""The node, forked from a process that has imported and loaded what each of them needs."""

from __future__ import annotations

import multiprocessing
import os
import sys

FRESH = multiprocessing.get_context('spawn')
SERVER = multiprocessing.get_context('forkserver')
SERVER.set_forkserver_preload(['tests.node.loaded'])


def run(log: str, environment: dict[str, str], arguments: list[str]) -> None:
    """Be `coastdown_node` with such arguments, which writes to a log."""
    from shipdrag_ros.node.main import main

    file = os.open(log, os.O_WRONLY | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(file, stream)
    os.environ.clear()
    os.environ.update(environment)
    sys.exit(main(['coastdown_node', *arguments]))
