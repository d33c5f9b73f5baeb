# SPDX-License-Identifier: Apache-2.0
"""
The systems of S2 to S5, which no coastdown needs: every package here is one.

A study that has a verb says so in a `STUDY`; its page and its verb stand in its
`face/`, where the command line finds them.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from shipdrag_ros.studies.study import Study

__all__ = ['Study', 'found']


def found() -> Iterator[tuple[str, Study]]:
    """
    Yield the package of each study that has a verb, and what it says of itself.
    """
    for module in iter_modules(__path__, f'{__name__}.'):
        if module.ispkg:
            study = getattr(import_module(module.name), 'STUDY', None)
            if study is not None:
                yield module.name, study
