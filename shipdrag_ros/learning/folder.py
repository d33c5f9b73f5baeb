# SPDX-License-Identifier: Apache-2.0
"""Folders of learnt effects, and how they come into the library."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.learning.term import LearntTerm
from shipdrag_ros.simulation.effects import added

MOST_FILES = 200
"""In one folder."""


def read_folders(folders: Sequence[Path]) -> tuple[LearntTerm, ...]:
    """
    Return the terms of all `.yaml` files of some folders, by name of the file.

    Raises
    ------
    EffectFileError
        If a folder cannot be read or holds none, a file cannot be used, or two have one name.
    """
    found: dict[str, LearntTerm] = {}
    for folder in folders:
        for path in _files(folder):
            term = LearntTerm.load(path)
            if term.name in found:
                raise EffectFileError(str(path), [f'name: {term.name!r} is that of another file'])
            found[term.name] = term
    return tuple(found.values())


def using(terms: Sequence[LearntTerm]) -> AbstractContextManager[None]:
    """
    Have terms in the library of this process, for a while.

    Examples
    --------
    >>> from shipdrag_ros.learning.folder import using
    >>> with using([]):
    ...     pass
    """
    return added([term.effect() for term in terms])


def _files(folder: Path) -> list[Path]:
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix == '.yaml')
    except OSError as error:
        why = f'cannot be read: {error.strerror}; give a folder of learnt effects'
        raise EffectFileError(str(folder), [why]) from error
    if not 0 < len(files) <= MOST_FILES:
        raise EffectFileError(
            str(folder), [f'{len(files)} .yaml files, expected 1..{MOST_FILES} learnt effects']
        )
    return files
