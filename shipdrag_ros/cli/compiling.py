# SPDX-License-Identifier: Apache-2.0
"""A word to who waits while functions are compiled."""

from __future__ import annotations

from collections.abc import Callable

from numba.core import event

_COMPILES = 'compiling, once after an installation or an update; this takes about a minute'


class CompilingNotice(event.Listener):  # type: ignore[misc]
    """
    Says that something is compiled, when the first function is.

    Parameters
    ----------
    log
        Where it is said.
    """

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._said = False

    def on_start(self, event: event.Event) -> None:
        """Say it once; what is kept from an earlier start is not compiled."""
        if not self._said:
            self._said = True
            self._log(_COMPILES)

    def on_end(self, event: event.Event) -> None:
        """Say no more."""
