# SPDX-License-Identifier: Apache-2.0
"""
The formats of logs: every module or package in this folder is one.

A new format is a new module with a `FORMAT`; it is found here. A package may
keep it in its module `importer`. One from another package is an entry point of
the group `shipdrag.formats`, as those of this folder are.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.sources.format import Format

GROUP = 'shipdrag.formats'


def points() -> tuple[EntryPoint, ...]:
    """
    Return the entry points of the formats of this folder, and of other packages.

    Those of this folder are known without an installation too.
    """
    own = []
    for module in iter_modules(__path__):
        place = f'{__name__}.{module.name}{".importer" if module.ispkg else ""}'
        own.append(EntryPoint(module.name, f'{place}:FORMAT', GROUP))
    taken = {point.name for point in own}
    return (*own, *(point for point in entry_points(group=GROUP) if point.name not in taken))


def found() -> tuple[Format, ...]:
    """
    Return every format, by name.

    Raises
    ------
    ImportDataError
        If one from another package cannot be loaded.
    """
    formats = []
    for point in points():
        try:
            declared = point.load()
        except Exception as error:  # whatever a stranger's module raises
            if point.value.startswith(__name__):
                raise
            raise ImportDataError(
                f'the format {point.name!r} of {point.value!r} cannot be loaded: {error!r}; '
                'mend or remove its package'
            ) from error
        if not isinstance(declared, Format):
            raise ImportDataError(f'{point.value!r} is no `sources.format.Format`')
        formats.append(declared)
    return tuple(sorted(formats, key=lambda each: each.name))
