# SPDX-License-Identifier: Apache-2.0
"""
The systems of S1 to S5, which no coastdown needs: every package here is one.

Estimators of a study stand in its folder `estimators`. A study that has a verb says so in a
`STUDY`; its page and its verb stand in its `face/`, where the command line finds them. A package
installed beside this one adds a study of its own by an entry point of the group
`shipdrag.papers`, `NAME = PACKAGE:STUDY`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import NamedTuple

from shipdrag_ros.imports import of_other_packages

GROUP = 'shipdrag.papers'


class Study(NamedTuple):
    """The verb of a study, what it does in one line, and command lines to try."""

    verb: str
    summary: str
    examples: tuple[str, ...]


@cache
def found(taken: frozenset[str] = frozenset()) -> tuple[tuple[str, Study], ...]:
    """
    Return the package of each study that has a verb, and what it says of itself.

    One of another package that cannot be loaded, or whose verb is taken, is left out with a
    warning. Its own are found without an entry point, as in a tree that was not installed.

    Parameters
    ----------
    taken
        Verbs that no study may have.
    """
    own = [each.name for each in iter_modules(__path__, f'{__name__}.') if each.ispkg]
    studies = {
        study.verb: (name, study)
        for name in own
        if (study := getattr(import_module(name), 'STUDY', None)) is not None
    }

    def accept(study: object) -> Study:
        if not isinstance(study, Study) or study.verb in (taken | {*studies}):
            raise TypeError(f'{study!r}, expected a Study with a verb that is not taken')
        return study

    for entry, study in of_other_packages(GROUP, accept, own=__name__):
        studies[study.verb] = (entry.module, study)
    return tuple(studies.values())
