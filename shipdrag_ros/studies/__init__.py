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
from typing import NamedTuple

from shipdrag_ros.imports import load, points

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
    warning.

    Parameters
    ----------
    taken
        Verbs that no study may have.
    """
    packages = points(GROUP, 'STUDY', 'studies/*/face/..')  # that has a verb
    studies = load(packages, Study, 'verb', taken).values()
    return tuple((point.module, study) for point, study in studies)
