# SPDX-License-Identifier: Apache-2.0
"""Folders of learnt effects."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.ship import LearntTerm
from shipdrag_ros.ship.term import EXPECTED_NAME, NAME
from shipdrag_ros.simulation.effects import taken

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
            term = read_term(path)
            if term.name in found:
                raise EffectFileError(str(path), [f'name: {term.name!r} is that of another file'])
            found[term.name] = term
    return tuple(found.values())


def read_term(path: Path) -> LearntTerm:
    """
    Return the term of a file.

    Raises
    ------
    EffectFileError
        If it cannot be used, or has the name of an effect of the library.
    """
    term = LearntTerm.load(path)
    if why := taken(term.name):
        raise EffectFileError(str(path), why)
    return term


def check_name(name: str) -> str:
    """
    Return a name that a term may have.

    Raises
    ------
    EffectFileError
        If it may not.
    """
    problems = taken(name)
    if not NAME.fullmatch(name):
        problems.append(f'name: {name[:60]!r}, expected {EXPECTED_NAME}')
    if problems:
        raise EffectFileError(name[:60], problems)
    return name


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
