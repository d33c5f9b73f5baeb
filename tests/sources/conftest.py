# SPDX-License-Identifier: Apache-2.0
"""A log made a bag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from shipdrag_ros.bags.writer import new_bag
from shipdrag_ros.sources.log import Log


def into_bag(read: Callable[..., Any], source: Path, out: Path, *args: Any, **options: Any) -> Any:
    """Read a log into a bag, as `shipdrag import` does."""
    with new_bag(out, {}) as bag:
        log = Log()
        result = read(source, log, *args, **options)
        log.copy_to(bag)
    return result
