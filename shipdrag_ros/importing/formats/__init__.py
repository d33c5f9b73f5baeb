# SPDX-License-Identifier: Apache-2.0
"""
The formats that `shipdrag import` reads: every package in this folder is one.

A new format is a new package whose module `face` has a `FORMAT`; the command
line finds it here.
"""

from __future__ import annotations

from pkgutil import iter_modules


def names() -> tuple[str, ...]:
    """
    Return the packages of the formats, without importing them.
    """
    return tuple(module.name for module in iter_modules(__path__))
