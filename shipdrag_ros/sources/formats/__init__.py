# SPDX-License-Identifier: Apache-2.0
"""
The formats that `shipdrag import` reads: every module or package in this folder is one.

A new format is a new module with a `FORMAT`; it is found here. A package may
keep it in its module `declaration`.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from shipdrag_ros.sources.format import Format


def names() -> tuple[str, ...]:
    """
    Return the modules of the formats, without importing them.
    """
    return tuple(module.name for module in iter_modules(__path__))


def found() -> tuple[Format, ...]:
    """
    Return every format, by name.
    """
    formats = []
    for module in iter_modules(__path__):
        place = f'{__name__}.{module.name}{".declaration" if module.ispkg else ""}'
        formats.append(import_module(place).FORMAT)
    return tuple(sorted(formats, key=lambda each: each.name))
