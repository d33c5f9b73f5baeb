# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with a file, named: where, in what kind of record, and how."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

_LISTED = 10_000  # of a file that is damaged everywhere; the others are counted


class DamageKind(Enum):
    """
    Kinds of damage.
    """

    MISSING = 'missing'
    TRUNCATED = 'truncated'
    GARBAGE = 'garbage'
    """Bytes that are no record."""
    OPCODE = 'opcode'
    LENGTH = 'length'
    """A length that leads out of bounds, or not to the next record."""
    CONTENT = 'content'
    """Fields that do not fill their record."""
    CHECKSUM = 'checksum'
    COMPRESSION = 'compression'
    """Packed bytes that cannot be unpacked to their end."""
    SIZE = 'size'
    """Unpacked bytes that are more or fewer than stated."""
    TOO_LARGE = 'too_large'
    """More bytes than are unpacked."""
    REFERENCE = 'reference'
    """A channel or schema that is not there."""
    DUPLICATE = 'duplicate'
    MISPLACED = 'misplaced'
    """An index entry that points at something else."""
    DISAGREES = 'disagrees'
    """A statement that the data contradict."""


@dataclass(frozen=True)
class Damage:
    """
    One damage.

    Attributes
    ----------
    offset
        Place in the file [bytes]; of the chunk for what lies in one.
    record
        Kind of record, `chunk` for instance; also `magic`, `summary`, `file`, `unknown`.
    kind
        What is wrong with it.
    detail
        The values, or ''.
    file
        Name of the file where a source has several, or ''.
    """

    offset: int
    record: str
    kind: DamageKind
    detail: str = ''
    file: str = ''


@dataclass
class DamageList:
    """
    The damages of a file or several, of which the first are kept.

    Attributes
    ----------
    listed
        In order of discovery.
    count
        All of them.
    file
        Name of the file at hand, where there are several.
    """

    listed: list[Damage] = field(default_factory=list)
    count: int = 0
    file: str = ''

    def add(self, offset: int, record: str, kind: DamageKind, detail: str = '') -> None:
        """
        Take note of a damage.
        """
        self.count += 1
        if len(self.listed) < _LISTED:
            self.listed.append(Damage(offset, record, kind, detail, self.file))
