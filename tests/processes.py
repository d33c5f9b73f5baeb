# SPDX-License-Identifier: Apache-2.0
"""A program in a process of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

START_S = 240.0  # the first start of a machine compiles the kernels


class Process:
    """A program of Python, its log, and its end."""

    def __init__(self, log: Path, *line: str | Path, **environment: str) -> None:
        self._log = log
        with log.open('w') as file:
            self._process = subprocess.Popen(
                [sys.executable, *line],
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env=os.environ | environment,
            )

    def wait_for(self, pattern: str) -> str:
        """Return the first group of a pattern once it stands in the log."""
        end_s = time.monotonic() + START_S
        while (found := re.search(pattern, self._log.read_text())) is None:
            assert self._process.poll() is None, self._log.read_text()
            assert time.monotonic() < end_s, self._log.read_text()
            time.sleep(0.05)
        return found[1] if found.groups() else found[0]

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        self._process.send_signal(number)
        return self._process.wait(timeout=200.0)

    def kill(self) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
