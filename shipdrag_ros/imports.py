# SPDX-License-Identifier: Apache-2.0
"""Imports without the collector of garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """
    Keep the collector of garbage away from a block of imports.

    What is imported stays. The collector would walk all of it a dozen times meanwhile, which is a
    seventh of the start.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
