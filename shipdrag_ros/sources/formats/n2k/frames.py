# SPDX-License-Identifier: Apache-2.0
"""The lines of the loggers of NMEA 2000, taken apart."""

from __future__ import annotations

import re
from datetime import UTC
from typing import NamedTuple

from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.log import iso_ns

MINUTE_NS = 60 * SECOND_NS
DAY_NS = 1440 * MINUTE_NS
_SINCE = r'\((?P<seconds>\d{1,10})\.(?P<fraction>\d{1,9})\)\s+'
_CLOCK = r'(?P<hour>\d\d):?(?P<minute>\d\d):?(?P<second>\d\d)\.(?P<fraction>\d{1,6})\s+'
_ISO = r'\d{4}-\d\d-\d\d[-T ]\d\d:\d\d:\d\d(?:[.,]\d{1,12})?'
_FORMS = tuple(
    re.compile(form.replace('HEX', '[0-9A-Fa-f]'))
    for form in (
        # can-utils: `candump -L`, then `candump -ta`, `candump`, and a format of its old versions
        rf'{_SINCE}\S+\s+(?P<id>HEX{{8}})#(?P<data>HEX*)\s*[RT]?',
        rf'(?:{_SINCE})?\S+\s+(?P<id>HEX{{8}})\s+\[\d+\](?P<data>(?:\s+HEX{{2}})*)',
        rf'(?:{_SINCE})?<0x(?P<id>HEX{{8}})>\s+\[\d+\](?P<data>(?:\s+HEX{{2}})*)',
        # candump of can-utils-j1939: the NAME of the sender and the PGN
        rf'(?:{_SINCE})?\S+?:(?P<sender>HEX{{2,16}}),(?P<pgn>HEX{{5}})\s+-\s+!\d\s+'
        r'\[\d+\](?P<data>(?:\s+HEX+)*)',
        # Actisense N2K ASCII: sender, addressee and priority, PGN, the whole message
        rf'A{_CLOCK}(?P<hex_sender>HEX{{2}})HEX{{3}}\s+(?P<pgn>HEX{{5,6}})\s+(?P<data>HEX+)',
        # Yacht Devices RAW
        rf'{_CLOCK}[RT]\s+(?P<id>HEX{{8}})(?P<data>(?:\s+HEX{{2}})+)',
        # canboat: time, priority, PGN, sender, addressee, length, bytes
        rf'(?P<iso>{_ISO}Z?),\d,(?P<decimal_pgn>\d{{4,6}}),(?P<sender>\d{{1,3}}),'
        r'\d{1,3},\d{1,3}(?P<data>(?:,HEX{2})*)',
        # SLCAN: identifier, length, bytes, and with some adapters milliseconds of a minute
        r'T(?P<id>HEX{8})(?P<length>[0-8])(?P<data>HEX*)',
    )
)
# what loggers write before a line: the date and time
_LED = re.compile(rf'[\[(]?({_ISO}\s?(?:Z|[+-]\d\d:?\d\d)?)[\])]?[\s,;]+(.+)')


class N2kFrame(NamedTuple):
    """
    A frame, or a whole message.

    Attributes
    ----------
    time_ns
        Since 1970, or since its cycle began; None where the line states none.
    cycle_ns
        After which the time begins again, a day or a minute; 0 of a time since 1970.
    pgn, sender, data
    whole
        Whether `data` is a message that needs no further frames.
    """

    time_ns: int | None
    cycle_ns: int
    pgn: int
    sender: str
    data: bytes
    whole: bool


def parse(line: str) -> N2kFrame | None:
    """
    Take a line apart; None where it is no frame.
    """
    for form in _FORMS:
        found = form.fullmatch(line)
        frame = None if found is None else _frame(found.groupdict(''))
        if frame is not None:
            return frame
    led = _LED.fullmatch(line)
    if led is None:
        return None
    frame, time_ns = parse(led[2]), iso_ns(led[1], UTC)
    if frame is None or time_ns is None:
        return frame
    return frame._replace(time_ns=time_ns, cycle_ns=0)


def _frame(parts: dict[str, str]) -> N2kFrame | None:
    """Put the parts of a line together; None where they do not go together."""
    digits = re.sub(r'[\s,]+', '', parts['data'])
    time_ns, cycle_ns = None, 0
    if 'length' in parts:
        end = 2 * int(parts['length'])
        digits, clock = digits[:end], digits[end:]
        time_ns, cycle_ns = int(clock, 16) * 1_000_000 if clock else None, MINUTE_NS
        if len(digits) < end or len(clock) not in (0, 4) or (time_ns or 0) >= MINUTE_NS:
            return None
    elif 'hour' in parts:
        time_ns, cycle_ns = _of_day_ns(parts), DAY_NS
    elif 'iso' in parts:
        time_ns = iso_ns(f'{parts["iso"][:10]}T{parts["iso"][11:]}', UTC)
    elif parts['seconds']:
        time_ns = int(parts['seconds']) * SECOND_NS + _fraction_ns(parts)
    if len(digits) % 2:
        return None
    data = bytes.fromhex(digits)
    if 'id' in parts:  # of 29 bits; a PGN below 0xF000 is addressed
        number = int(parts['id'], 16) & 0x1FFFFFFF
        pgn = (number >> 8) & 0x3FFFF
        if (pgn >> 8) & 0xFF < 0xF0:
            pgn &= 0x3FF00
        if len(data) > 8:
            return None
        return N2kFrame(time_ns, cycle_ns, pgn, str(number & 0xFF), data, False)
    if 'decimal_pgn' in parts:
        pgn, sender, whole = int(parts['decimal_pgn']), parts['sender'], len(data) > 8
    elif 'hex_sender' in parts:
        pgn, sender, whole = int(parts['pgn'], 16), str(int(parts['hex_sender'], 16)), True
    else:
        pgn, sender, whole = int(parts['pgn'], 16), parts['sender'], False
    return N2kFrame(time_ns, cycle_ns, pgn, sender, data, whole)


def _of_day_ns(parts: dict[str, str]) -> int | None:
    hour, minute, second = (int(parts[name]) for name in ('hour', 'minute', 'second'))
    if hour > 23 or minute > 59 or second > 60:
        return None
    return (3600 * hour + 60 * minute + second) * SECOND_NS + _fraction_ns(parts)


def _fraction_ns(parts: dict[str, str]) -> int:
    return int(parts['fraction'][:9].ljust(9, '0'))
