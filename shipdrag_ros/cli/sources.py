# SPDX-License-Identifier: Apache-2.0
"""Bags, and logs that are made bags, as a verb takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.bags.locate import is_bag
from shipdrag_ros.cli.output import Output


def open_sources(paths: Sequence[Path], output: Output, *, remap: Mapping[str, str]) -> list[Run]:
    """
    Open bags and logs; what was understood of a log is printed on stderr.

    Parameters
    ----------
    paths
    output
    remap
        Recorded topic -> input.

    Raises
    ------
    BagError
        If a bag cannot be read.
    ImportDataError
        If nothing in a log can be used.
    """
    if all(is_bag(path) for path in paths):
        return open_runs(paths, remap=remap)
    from shipdrag_ros.importing.reading import Understanding, read_any  # a bag needs no importer

    def tell(found: Understanding) -> None:
        for line in found.lines():
            output.log(line)

    return read_any(paths, remap=remap, tell=tell)
