# SPDX-License-Identifier: Apache-2.0
"""How something long shows how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with a stage in words, how much of it is done, and of how much."""
PartDone = Callable[[int, int], None]
"""Called with how much is done, and of how much, where there is but one stage."""


def silent(stage: str, done: int, total: int) -> None:
    """Inform nobody."""
