# SPDX-License-Identifier: Apache-2.0
"""
The layouts of MCAP records, so that a record is known by its own lengths.

Where an opcode or a length may be damaged, the only witness is the content:
each of its fields must fit, and together they must fill the record.

Notes
-----
MCAP specification 0, section Records.
"""

from __future__ import annotations

import struct

from mcap.opcode import Opcode

from shipdrag_ros.bags.records import MESSAGE_HEAD, TIME_LIMIT_NS, Buffer

# a figure: so many bytes; s: a name; b: bytes with a length of 4, B: of 8; m: pairs of
# texts, t; i: entries of a message index, c: entries of two and eight bytes
_FIELDS: dict[int, str] = {
    Opcode.HEADER: 'ss',
    Opcode.FOOTER: '884',
    Opcode.SCHEMA: '2ssb',
    Opcode.CHANNEL: '22ssm',
    Opcode.CHUNK: '8884sB',
    Opcode.MESSAGE_INDEX: '2i',
    Opcode.CHUNK_INDEX: '8888c8s88',
    Opcode.ATTACHMENT: '88ssB4',
    Opcode.ATTACHMENT_INDEX: '88888ss',
    Opcode.STATISTICS: '82444488c',
    Opcode.METADATA: 'sm',
    Opcode.METADATA_INDEX: '88s',
    Opcode.SUMMARY_OFFSET: '188',
    Opcode.DATA_END: '4',
}
KNOWN = frozenset((Opcode.MESSAGE, *_FIELDS))
_NAMES: dict[int, str] = {int(opcode): opcode.name.lower() for opcode in Opcode}
_NAME_BYTES = 1 << 16  # no name is longer
_ENTRY_BYTES = {'i': 16, 'c': 10}
_UINT32 = struct.Struct('<I')
_UINT64 = struct.Struct('<Q')


def name(opcode: int) -> str:
    """
    Return the name of a kind of record, `chunk_index` for instance.
    """
    return _NAMES.get(opcode, 'unknown')


def fits(data: Buffer, opcode: int, start: int, end: int) -> bool:
    """
    Say whether a span holds the content of a kind of record.

    What a later version of the format may put behind the last field is
    allowed for.
    """
    stop = fields_end(data, opcode, start, end)
    return stop is not None and stop <= end


def fills(data: Buffer, opcode: int, start: int, end: int) -> bool:
    """
    Say whether a span is filled exactly by a kind of record.
    """
    if opcode == Opcode.MESSAGE:
        return fits(data, opcode, start, end)
    return fields_end(data, opcode, start, end) == end


def fields_end(data: Buffer, opcode: int, start: int, end: int) -> int | None:
    """
    Return where the fields of a record end; None where they do not fit.

    Only the bytes of a chunk or an attachment may end behind `end`: they are
    those of a record that is cut off.
    """
    if opcode == Opcode.MESSAGE:
        if end - start < MESSAGE_HEAD.size:
            return None
        _, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, start)
        return start + MESSAGE_HEAD.size if log_ns < TIME_LIMIT_NS else None
    at = start
    try:
        for field in _FIELDS[opcode]:
            at = _field_end(data, field, at, end)
    except (struct.error, UnicodeDecodeError, _DoesNotFit, KeyError):
        return None
    return at


class _DoesNotFit(Exception):
    pass


def _field_end(data: Buffer, field: str, at: int, end: int) -> int:
    if field.isdigit():
        return _inside(at + int(field), end, cut=field == '4')
    if field == 'B':
        return at + _UINT64.size + int(_UINT64.unpack_from(data, at)[0])
    (length,) = _UINT32.unpack_from(data, at)
    start = at + _UINT32.size
    stop = _inside(start + length, end)
    if field == 's' and length > _NAME_BYTES:
        raise _DoesNotFit
    if field in 'st':
        data[start:stop].decode()
    elif field == 'm':
        while start < stop:
            # a key, and its value
            start = _field_end(data, 't', _field_end(data, 't', start, stop), stop)
    elif field in _ENTRY_BYTES and length % _ENTRY_BYTES[field]:
        raise _DoesNotFit
    return stop


def _inside(stop: int, end: int, *, cut: bool = False) -> int:
    if stop > end and not cut:
        raise _DoesNotFit
    return stop
