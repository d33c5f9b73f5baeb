# SPDX-License-Identifier: Apache-2.0
"""
Compiled code made ready in a thread, while the node hears, records and answers.

A start that finds nothing kept takes a minute or two until the first estimate
could be made; nobody should have to take that for a node that hangs.
"""

from __future__ import annotations

import os
import sys
import threading
import traceback
from time import monotonic

from shipdrag_ros.coastdown.warming import warm
from shipdrag_ros.parameters import Parameters

NAME = 'compiling'


class Compiling:
    """
    Goes on from `begin` to its end.

    Parameters
    ----------
    parameters
        Whose estimator is needed.

    Attributes
    ----------
    estimator
        That is needed.
    failure
        What went wrong, '' if nothing did; what is missing is then compiled when it is called.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.failure = ''
        self.estimator = parameters.estimator
        self._parameters = parameters
        self._began_s: float | None = None
        self._ended_s: float | None = None

    def begin(self) -> None:
        """
        Begin, if that was not done.
        """
        if self._began_s is None:
            self._began_s = monotonic()
            # it cannot be interrupted, and must not be waited for
            threading.Thread(target=self._run, name=NAME, daemon=True).start()

    def done(self) -> bool:
        """
        Say whether everything is there.
        """
        return self._ended_s is not None

    @property
    def seconds(self) -> float:
        """How long it took, or has taken so far [s]."""
        if self._began_s is None:
            return 0.0
        return (monotonic() if self._ended_s is None else self._ended_s) - self._began_s

    def _run(self) -> None:
        try:
            warm(self._parameters)
        except Exception:
            self.failure = traceback.format_exc()
        self._ended_s = monotonic()


def leave_if_compiling(status: int) -> None:
    """
    End the process at once if a compiler still runs in it.

    Python would take its modules away under the compiler, which may then crash.

    Parameters
    ----------
    status
        Exit status of the process.
    """
    if any(thread.name == NAME for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
