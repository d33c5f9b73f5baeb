# SPDX-License-Identifier: Apache-2.0
"""Folders of learnt effects."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.ship import LearntTerm
from shipdrag_ros.ship.term import NAME
from shipdrag_ros.simulation.effects import OWN

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


def check_name(name: str) -> str:
    """
    Return a name that a term may have.

    Raises
    ------
    EffectFileError
        If it may not.
    """
    problems = []
    if not NAME.fullmatch(name):
        problems.append(f'name: {name[:60]!r}, expected small letters, digits and _')
    if name in OWN:
        problems.append(f'name: {name!r} is an effect of the library; give it another')
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
