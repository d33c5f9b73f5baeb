# SPDX-License-Identifier: Apache-2.0
"""
Unpacking what may be damaged: as far as it goes, and never without bound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

import lz4.frame
import zstandard
from isal.isal_zlib import crc32

from shipdrag_ros.bags.records import (
    CHUNK_LIMIT_BYTES,
    UNPACKING_ERRORS,
    Buffer,
    chunk_fields,
    decompress,
)
from shipdrag_ros.bags.salvage.damage import DamageKind, DamageList
from shipdrag_ros.errors import BagError

_FILE_RATIO = 4096
_PIECE_BYTES = 256  # packed; so that little is unpacked at once, and little lost at a damage
_FRAMES = {b'\x28\xb5\x2f\xfd': 'zstd', b'\x04\x22\x4d\x18': 'lz4'}
_FRAME_SEARCH_BYTES = 64


class Unpacked(NamedTuple):
    """
    What came out of a chunk.

    Attributes
    ----------
    records
        Unpacked, as far as it goes.
    damage
        What is wrong with the chunk; None where nothing is.
    verified
        Whether its checksum was tested and is right; then it is whole,
        whatever else is wrong.
    unread
        Packed bytes that gave nothing.
    """

    records: bytes
    damage: DamageKind | None
    verified: bool
    unread: int


def unpack_chunk_partly(data: Buffer, start: int, end: int) -> Unpacked:
    """
    Unpack the content of a chunk, as much of it as can be.
    """
    content = data[start:end]
    size, checksum = 0, 0
    damage = None
    try:
        size, checksum, compression, at, length = chunk_fields(content, 0, len(content))
    except ValueError:
        damage, compression, at, length = DamageKind.CONTENT, '', len(content), 0
    frame = _find_frame(content)
    if compression not in ('', 'zstd', 'lz4') or (damage and frame):
        damage = DamageKind.CONTENT
        compression, at = frame or ('', at)
        length = len(content) - at
    packed = content[at : at + length]
    if at + length > len(content):
        damage = damage or DamageKind.TRUNCATED
    whole, read, records = _unpack(compression, packed, size)
    if len(records) > CHUNK_LIMIT_BYTES:
        return Unpacked(
            records[:CHUNK_LIMIT_BYTES], DamageKind.TOO_LARGE, False, len(packed) - read
        )
    verified = checksum != 0 and crc32(records) == checksum
    if not damage:
        damage = _damage_of(whole, read == len(packed), len(records) == size, checksum, verified)
    return Unpacked(records, damage, verified, len(packed) - read)


def _damage_of(
    whole: bool, read: bool, fits: bool, checksum: int, verified: bool
) -> DamageKind | None:
    if not whole and not read:
        return DamageKind.COMPRESSION
    if not fits:
        return DamageKind.SIZE
    return DamageKind.CHECKSUM if checksum and not verified else None


def _unpack(compression: str, packed: bytes, size: int) -> tuple[bool, int, bytes]:
    """Return whether all is as stated, how many bytes were read, and what came out."""
    if compression == '':
        return True, len(packed), packed
    try:
        return True, len(packed), decompress(compression, packed, size)
    except UNPACKING_ERRORS:
        return False, *_unpack_pieces(compression, packed)


def _find_frame(content: bytes) -> tuple[str, int] | None:
    for magic, compression in _FRAMES.items():
        at = content.find(magic, 0, _FRAME_SEARCH_BYTES)
        if at >= 0:
            return compression, at
    return None


def _unpack_pieces(compression: str, packed: bytes) -> tuple[int, bytes]:
    """
    Return how many bytes were read, and what came out, up to a damage or the limit.
    """
    at, out = _feed(_decoder(compression), packed, 0, len(packed), _PIECE_BYTES)
    if at < len(packed) and sum(map(len, out)) <= CHUNK_LIMIT_BYTES:
        # a decoder that has failed is of no use: up to the bad piece again, then byte by byte
        decoder = _decoder(compression)
        _, out = _feed(decoder, packed, 0, at, _PIECE_BYTES)
        at, more = _feed(decoder, packed, at, min(at + _PIECE_BYTES, len(packed)), 1)
        out += more
    return at, b''.join(out)


def _decoder(compression: str) -> Any:
    if compression == 'zstd':
        return zstandard.ZstdDecompressor(max_window_size=CHUNK_LIMIT_BYTES).decompressobj()
    return lz4.frame.LZ4FrameDecompressor()


def _feed(
    decoder: Any, packed: bytes, start: int, end: int, piece: int
) -> tuple[int, list[bytes]]:
    out: list[bytes] = []
    total = 0
    for at in range(start, end, piece):
        if decoder.eof:
            return end, out
        try:
            out.append(decoder.decompress(packed[at : min(at + piece, end)]))
        except UNPACKING_ERRORS:
            return at, out
        total += len(out[-1])
        if total > CHUNK_LIMIT_BYTES:
            return at, out
    return end, out


@contextmanager
def opened(path: Path, damages: DamageList) -> Iterator[Buffer]:
    """
    Open a file that may be packed, damaged or empty.

    Parameters
    ----------
    path
        `.mcap`, or `.mcap.zstd` as rosbag2 compresses files.
    damages
        Where it is noted that it is empty, or its packing damaged.

    Raises
    ------
    BagError
        If it cannot be read.
    """
    try:
        with path.open('rb') as file, TemporaryFile(prefix='shipdrag_') as unpacked:
            source: IO[bytes] = file
            if path.suffix == '.zstd':
                _unpack_file(file, unpacked, path.stat().st_size, damages.add)
                source = unpacked
            if source.seek(0, 2) == 0:
                damages.add(0, 'file', DamageKind.TRUNCATED, 'it is empty')
                yield b''
                return
            data = mmap(source.fileno(), 0, access=ACCESS_READ)
    except OSError as error:
        raise BagError(f'{str(path)!r} cannot be read: {error.strerror}') from error
    with data:
        yield data


def _unpack_file(
    packed: IO[bytes], unpacked: IO[bytes], size: int, add: Callable[..., None]
) -> None:
    decoder = zstandard.ZstdDecompressor(max_window_size=CHUNK_LIMIT_BYTES).decompressobj()
    limit = max(CHUNK_LIMIT_BYTES, size * _FILE_RATIO)
    at = 0
    while not decoder.eof:
        piece = packed.read(_PIECE_BYTES)
        if not piece:
            add(at, 'file', DamageKind.TRUNCATED, 'the packed file is cut off')
            break
        try:
            unpacked.write(decoder.decompress(piece))
        except UNPACKING_ERRORS as error:
            add(at, 'file', DamageKind.COMPRESSION, str(error))
            break
        at += len(piece)
        if unpacked.tell() > limit:
            add(at, 'file', DamageKind.TOO_LARGE, f'more than {limit} bytes')
            break
    unpacked.flush()
