# SPDX-License-Identifier: Apache-2.0
"""The lines of the loggers of NMEA 2000, taken apart."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC
from typing import NamedTuple

from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.log import iso_ns

MINUTE_NS = 60 * SECOND_NS
DAY_NS = 1440 * MINUTE_NS
_HEX = r'[0-9A-Fa-f]'
# can-utils: `candump -L`, `candump -ta`, `candump`, and a format of its old versions
_CANDUMP_LOG = re.compile(
    rf'\((\d{{1,10}})\.(\d{{1,9}})\)\s+\S+\s+({_HEX}{{8}})#({_HEX}*)\s*[RT]?'
)
_CANDUMP = re.compile(
    rf'(?:\((\d{{1,10}})\.(\d{{1,9}})\)\s+)?(?:\S+\s+({_HEX}{{8}})|<0x({_HEX}{{8}})>)\s+'
    rf'\[\d+\]((?:\s+{_HEX}{{2}})*)'
)
# candump of can-utils-j1939: the NAME of the sender and the PGN
_J1939 = re.compile(
    rf'(?:\((\d{{1,10}})\.(\d{{1,9}})\)\s+)?\S+?:({_HEX}{{2,16}}),({_HEX}{{5}})\s+-\s+!(\d)\s+'
    rf'\[\d+\]((?:\s+{_HEX}+)*)'
)
# Actisense N2K ASCII: sender, addressee and priority, PGN, the whole message
_ACTISENSE = re.compile(
    rf'A(\d\d)(\d\d)(\d\d)\.(\d{{1,6}})\s+({_HEX}{{2}})({_HEX}{{2}})({_HEX})\s+({_HEX}{{5,6}})\s+'
    rf'({_HEX}+)'
)
# Yacht Devices RAW
_YACHT_DEVICES = re.compile(
    rf'(\d\d):(\d\d):(\d\d)\.(\d{{1,6}})\s+[RT]\s+({_HEX}{{8}})((?:\s+{_HEX}{{2}})+)'
)
# SLCAN: identifier, length, bytes, and with some adapters milliseconds of a minute
_SLCAN = re.compile(rf'T({_HEX}{{8}})([0-8])({_HEX}*)')
# what loggers write before a line: the date and time
_LED = re.compile(
    r'[\[(]?(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d{1,12})?\s?(?:Z|[+-]\d\d:?\d\d)?)[\])]?'
    r'[\s,;]+(.+)'
)
# canboat: time, priority, PGN, sender, addressee, length, bytes
_CANBOAT = re.compile(
    r'(\d{4}-\d\d-\d\d[-T ]\d\d:\d\d:\d\d(?:[.,]\d+)?Z?),(\d),(\d{4,6}),(\d{1,3}),'
    rf'(\d{{1,3}}),(\d{{1,3}})((?:,{_HEX}{{2}})*)'
)


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
    frame = next((frame for read in _READERS if (frame := read(line)) is not None), None)
    if frame is None and (led := _LED.fullmatch(line)) is not None:
        frame = parse(led[2])
        time_ns = iso_ns(led[1], UTC)
        if frame is not None and time_ns is not None:
            return frame._replace(time_ns=time_ns, cycle_ns=0)
    return frame


def _candump_log(line: str) -> N2kFrame | None:
    found = _CANDUMP_LOG.fullmatch(line)
    if found is None or len(found[4]) % 2:
        return None
    return _of_can_id(_epoch_ns(found[1], found[2]), 0, found[3], bytes.fromhex(found[4]))


def _candump(line: str) -> N2kFrame | None:
    found = _CANDUMP.fullmatch(line)
    if found is None:
        return None
    time_ns = None if found[1] is None else _epoch_ns(found[1], found[2])
    return _of_can_id(time_ns, 0, found[3] or found[4], bytes.fromhex(found[5]))


def _j1939(line: str) -> N2kFrame | None:
    found = _J1939.fullmatch(line)
    if found is None or len(found[6].replace(' ', '')) % 2:
        return None
    time_ns = None if found[1] is None else _epoch_ns(found[1], found[2])
    data = bytes.fromhex(found[6].replace(' ', ''))
    return N2kFrame(time_ns, 0, int(found[4], 16), found[3], data, False)


def _actisense(line: str) -> N2kFrame | None:
    found = _ACTISENSE.fullmatch(line)
    if found is None or len(found[9]) % 2:
        return None
    time_ns = _of_day_ns(found[1], found[2], found[3], found[4])
    data = bytes.fromhex(found[9])
    return N2kFrame(time_ns, DAY_NS, int(found[8], 16), str(int(found[5], 16)), data, True)


def _yacht_devices(line: str) -> N2kFrame | None:
    found = _YACHT_DEVICES.fullmatch(line)
    if found is None:
        return None
    time_ns = _of_day_ns(found[1], found[2], found[3], found[4])
    return _of_can_id(time_ns, DAY_NS, found[5], bytes.fromhex(found[6]))


def _canboat(line: str) -> N2kFrame | None:
    found = _CANBOAT.fullmatch(line)
    if found is None:
        return None
    text = found[1]
    time_ns = iso_ns(f'{text[:10]}T{text[11:]}', UTC)
    data = bytes.fromhex(found[7].replace(',', ' '))
    return N2kFrame(time_ns, 0, int(found[3]), found[4], data, len(data) > 8)


def _slcan(line: str) -> N2kFrame | None:
    found = _SLCAN.fullmatch(line)
    if found is None:
        return None
    length = 2 * int(found[2])
    data, clock = found[3][:length], found[3][length:]
    if len(data) < length or len(clock) not in (0, 4):
        return None
    time_ns = int(clock, 16) * 1_000_000 if clock else None
    if time_ns is not None and time_ns >= MINUTE_NS:
        return None
    return _of_can_id(time_ns, MINUTE_NS, found[1], bytes.fromhex(data))


_READERS: tuple[Callable[[str], N2kFrame | None], ...] = (
    _candump_log,
    _candump,
    _j1939,
    _actisense,
    _yacht_devices,
    _canboat,
    _slcan,
)


def _of_can_id(time_ns: int | None, cycle_ns: int, text: str, data: bytes) -> N2kFrame | None:
    """Take a 29 bit identifier apart; a PGN below 0xF000 is addressed."""
    number = int(text, 16) & 0x1FFFFFFF
    pgn = (number >> 8) & 0x3FFFF
    if (pgn >> 8) & 0xFF < 0xF0:
        pgn &= 0x3FF00
    if len(data) > 8:
        return None
    return N2kFrame(time_ns, cycle_ns, pgn, str(number & 0xFF), data, False)


def _epoch_ns(seconds: str, fraction: str) -> int:
    return int(seconds) * SECOND_NS + int(fraction[:9].ljust(9, '0'))


def _of_day_ns(hour: str, minute: str, second: str, fraction: str) -> int | None:
    if int(hour) > 23 or int(minute) > 59 or int(second) > 60:
        return None
    seconds = 3600 * int(hour) + 60 * int(minute) + int(second)
    return seconds * SECOND_NS + int(fraction[:9].ljust(9, '0'))
