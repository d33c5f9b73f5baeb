# SPDX-License-Identifier: Apache-2.0
"""
The formats of logs: every module in this folder is one, or the module `importer` of a package.

A new format is a new module with a `FORMAT`; it is found here. A package installed beside this
one adds a format by an entry point of the group `shipdrag.formats`, `NAME = PACKAGE:FORMAT`.
"""

from __future__ import annotations

from shipdrag_ros.imports import load, points
from shipdrag_ros.sources.format import Format

GROUP = 'shipdrag.formats'
_PLACES = ('sources/formats/[!_]*.py', 'sources/formats/*/importer.py')


def found() -> tuple[Format, ...]:
    """
    Return every format, by name; one of another package that fails is left out with a warning.
    """
    every = load(points(GROUP, 'FORMAT', *_PLACES), Format)
    return tuple(every[name][1] for name in sorted(every))
