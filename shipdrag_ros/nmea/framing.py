# SPDX-License-Identifier: Apache-2.0
"""
A line of text as a sentence of NMEA 0183, or why it is none.

Framing, checksum and the names of the fields are pynmeagps'. Its message
objects are not used: they refuse a whole sentence for a bad field that is not
needed here, and take `nan` and `1_0` for numbers.
"""

from __future__ import annotations

import re
from enum import Enum
from typing import NamedTuple

from pynmeagps.nmeahelpers import calc_checksum, get_parts

START = re.compile('[$!]')
"""Of a sentence; none has either inside."""

_ADDRESS = re.compile('[A-Z][A-Z0-9]{4}|P[A-Z0-9]{2,}')


class Checksum(Enum):
    """Whether a sentence must have a checksum; one it has must be right."""

    REQUIRED = 'required'
    OPTIONAL = 'optional'


class Sentence(NamedTuple):
    """
    A sentence whose checksum is right.

    Attributes
    ----------
    line
        Number of the line, from 1; 0 where lines have no number.
    text
        As it stands there, without the `$`.
    talker, kind
        Parts of its address, `GP` and `RMC` for instance; a proprietary
        sentence is all talker.
    fields
        What follows the address.
    receive_ns
        When it was received [ns since the epoch]; None if that is not known.
    """

    line: int
    text: str
    talker: str
    kind: str
    fields: list[str]
    receive_ns: int | None


def parse(
    text: str, checksum: Checksum, *, line: int = 0, receive_ns: int | None = None
) -> Sentence:
    """
    Take a sentence apart.

    Parameters
    ----------
    text
        What follows the `$`, without blanks around it.
    checksum
        Whether it must have one.
    line, receive_ns
        See `Sentence`.

    Raises
    ------
    ValueError
        Saying why it is no sentence.
    """
    complete = text
    if '*' not in text:
        if checksum is Checksum.REQUIRED:
            raise ValueError('without checksum')
        complete = f'{text}*{calc_checksum(text)}'
    content, talker, kind, fields, stated = get_parts(complete)
    if calc_checksum(content) != stated.upper():
        raise ValueError('wrong checksum')
    if not _ADDRESS.fullmatch(talker + kind):
        raise ValueError('no address')
    if talker == 'P':
        talker, kind = talker + kind, ''
    return Sentence(line, text, talker, kind, fields, receive_ns)
