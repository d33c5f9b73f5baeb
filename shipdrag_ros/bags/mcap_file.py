# SPDX-License-Identifier: Apache-2.0
"""
Which files make up the bags that a user names, and what is in each, in order of arrival.

Without a sound index the file is walked once from its beginning, and what is
whole in it is read; the damage is stated, not mended.

A bag is a single MCAP file or a directory of rosbag2; a directory that was
left without its `metadata.yaml` by a crash is taken for what its files say.
"""

from __future__ import annotations

import os
import re
import sys
from collections import deque
from collections.abc import Collection, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

import numpy as np
import zstandard
from mcap.records import ChunkIndex

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import records
from shipdrag_ros.bags.contents import contents_of, left_out, opened_segment
from shipdrag_ros.bags.message_index import CHANNELS, Messages, index_messages
from shipdrag_ros.bags.records import CHUNK_LIMIT_BYTES, MAGIC, Buffer, DamageKind, DamageList
from shipdrag_ros.errors import BagError, disk_errors
from shipdrag_ros.samples import UInt8

CONVERT = 'convert it with `rosbags-convert --src BAG --dst NEW --dst-storage mcap`'
IMPORT = 'make a bag of it with `shipdrag import SOURCE -o NEW.mcap`'
# smaller chunks are unpacked and decoded together
_WORTHWHILE_BYTES = 1 << 20
# messages held back because earlier ones may follow in the file
_WAITING_LIMIT_BYTES = 1 << 29
# of a packed file, by its size; logs of ships are packed to a tenth or so
_FILE_RATIO = 4096
_FOREIGN = {
    b'SQLite format 3\0': 'is a bag in sqlite3 storage',
    b'#ROSBAG V2.0': 'is a bag of ROS 1',
}
_PIECE_BYTES = 1 << 12  # of a packed file; little of it is lost at a damage


class McapFile:
    """
    An MCAP file.

    Parameters
    ----------
    path
        `.mcap`, or `.mcap.zstd` as rosbag2 compresses files.

    Attributes
    ----------
    contents
        What is in it; reading messages may add to its warnings.

    Raises
    ------
    BagError
        If it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        damages = DamageList()
        self._source = unpacked_file(path, damages)
        for damage in damages.listed:
            raise BagError(f'{str(path)!r} cannot be unpacked: {damage.detail}')
        with self._data() as data:
            head = data[:16]
            if not head.startswith(MAGIC):
                raise BagError(not_mcap(path, head))
            self.contents = contents_of(data)

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last log time [ns]; None without messages."""
        segments = self.contents.segments
        if not segments:
            return None
        return segments[0].message_start_time, max(each.message_end_time for each in segments)

    def messages(
        self, channels: Collection[int], *, start_ns: int = 0, end_ns: int = sys.maxsize
    ) -> Iterator[Messages]:
        """
        Yield messages in order of log time, then of place, some chunks at a time.

        Parameters
        ----------
        channels
            Numbers of those to read.
        start_ns, end_ns
            First and last log time to read [ns].
        """
        wanted = frozenset(channels)
        in_time = [
            each
            for each in self.contents.segments
            if each.message_end_time >= start_ns and each.message_start_time <= end_ns
        ]
        left = deque(
            each
            for each in in_time
            if not each.message_index_offsets or each.message_index_offsets.keys() & wanted
        )
        table = np.zeros(CHANNELS, np.uint8)
        table[list(wanted)] = 1
        read = 0
        waiting: Messages | None = None
        with self._data() as data:
            while left:
                # as much again as waits, so that what overlaps is not sorted over and over
                least_bytes = max(_WORTHWHILE_BYTES, len(waiting.data) if waiting else 0)
                loaded = self._load(data, left, table, least_bytes)
                read += len(loaded)
                outside = (loaded.log_ns < start_ns) | (loaded.log_ns > end_ns)
                loaded = loaded[~outside] if outside.any() else loaded
                loaded = (waiting.followed_by(loaded) if waiting else loaded).in_arrival_order()
                ready, waiting = len(loaded), None
                if left:  # the next may begin before this one ends
                    ready = int(np.searchsorted(loaded.log_ns, left[0].message_start_time))
                if ready < len(loaded):
                    waiting = loaded[ready:].packed()
                    if len(waiting.data) > _WAITING_LIMIT_BYTES:
                        raise BagError(
                            f'{str(self.path)!r}: more than {_WAITING_LIMIT_BYTES} bytes of '
                            'messages are out of order; write it again in order of arrival'
                        )
                if ready:
                    yield loaded[:ready]
        expected = sum(self.contents.counts[channel] for channel in wanted)
        if len(in_time) == len(self.contents.segments) and read != expected:
            self._warn(f'{read} messages are there where the index lists {expected}')

    def _load(
        self, data: Buffer, left: deque[ChunkIndex], wanted: UInt8, least_bytes: int
    ) -> Messages:
        """Take segments off the queue, as many as are worth it."""
        sound: dict[int, bytes] = {}  # by place
        size = 0
        while left and size < least_bytes:
            chunk = opened_segment(data, left.popleft())
            size += len(chunk.records)
            if chunk.damage is None:
                sound[chunk.place.offset] = chunk.records
            else:
                self._warn(left_out(records.Damage(chunk.place.offset, 'chunk', chunk.damage)))
        indexed = index_messages(list(sound.values()), list(sound), wanted)
        for text in indexed.damage:
            self._warn(text)
        return indexed.messages

    def _warn(self, text: str) -> None:
        if text not in self.contents.warnings:  # a file may be read twice
            self.contents.warnings.append(text)

    @contextmanager
    def _data(self) -> Iterator[Buffer]:
        with mapped(self.path, self._source) as data:
            if not data:
                raise BagError(f'{str(self.path)!r} is empty; nothing was recorded')
            yield data


def _at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # a named pipe is no file, and would wait


@contextmanager
def mapped(path: Path, unpacked: IO[bytes] | None) -> Iterator[Buffer]:
    """
    Open a file; of an empty one there are no bytes.

    Parameters
    ----------
    path
        Of the file.
    unpacked
        What is in it, where it is packed; None where not.

    Raises
    ------
    BagError
        If it cannot be read.
    """
    with disk_errors(path, 'read'), open(path, 'rb', opener=_at_once) as file:
        source = unpacked or file
        data = mmap(source.fileno(), 0, access=ACCESS_READ) if source.seek(0, 2) else None
    with data or nullcontext(b'') as held:
        yield held


def not_mcap(path: Path, head: bytes) -> str:
    """Say what a file is that does not begin as MCAP does."""
    for magic, what in _FOREIGN.items():
        if head.startswith(magic):
            return f'{str(path)!r} {what}; {IMPORT}'
    return (
        f'{str(path)!r} is no MCAP file, it begins with {head[:8]!r}; '
        'give a .mcap file or a rosbag2 directory'
    )


def unpacked_file(path: Path, damages: DamageList) -> IO[bytes] | None:
    """
    Unpack a file that rosbag2 has packed as a whole, as far as it goes.

    Parameters
    ----------
    path
        `.zstd`; of one that is not packed there is None.
    damages
        Where is noted what is wrong with it.

    Raises
    ------
    BagError
        If it cannot be read or there is no room.
    """
    if path.suffix != '.zstd':
        return None
    unpacked = NamedTemporaryFile(prefix='shipdrag_')  # noqa: SIM115 (kept while the bag is)
    decoder = zstandard.ZstdDecompressor(max_window_size=CHUNK_LIMIT_BYTES).decompressobj()
    try:
        with disk_errors(path, 'unpacked'), open(path, 'rb', opener=_at_once) as packed:
            limit = max(CHUNK_LIMIT_BYTES, packed.seek(0, 2) * _FILE_RATIO)
            packed.seek(0)
            while not decoder.eof:
                piece = packed.read(_PIECE_BYTES)
                if not piece:
                    damages.add(0, 'file', DamageKind.TRUNCATED, 'it is cut off')
                    break
                unpacked.write(decoder.decompress(piece))
                if unpacked.tell() > limit:
                    why = f'it unpacks to more than {limit} bytes'
                    damages.add(0, 'file', DamageKind.TOO_LARGE, why)
                    break
            unpacked.flush()
    except zstandard.ZstdError as error:
        unpacked.flush()
        damages.add(0, 'file', DamageKind.COMPRESSION, str(error))
    return unpacked


METADATA = 'metadata.yaml'
"""Of rosbag2, beside the files that make up a bag."""


def is_bag_folder(names: Collection[str]) -> bool:
    """Say whether the files of a folder are those of a bag of rosbag2, by their names."""
    return any(name == METADATA or name.endswith(('.db3', '.db3.zstd')) for name in names)


PART = re.compile(r'_\d{3,}(_\d+)?(?=\.mcap)')
"""In the name of a file of a recording of the node."""

_SUFFIXES = ('.mcap', '.mcap.zstd')


@dataclass(frozen=True)
class BagFiles:
    """
    Files that make up one bag, in their order.

    Attributes
    ----------
    name
        As the user gave it.
    message_compression
        Compression of each message by rosbag2; '' for none.
    warnings
        What is missing, a sentence each.
    """

    name: str
    files: tuple[Path, ...]
    message_compression: str = ''
    warnings: tuple[str, ...] = ()


def is_bag(path: Path) -> bool:
    """
    Say whether a path is to be opened as a bag, and not as a log that could be made one.

    What is not there is a bag too, so that the error is that of a bag.
    """
    if path.is_dir() or path.name == METADATA:
        folder = path if path.is_dir() else path.parent
        return not any(folder.glob('*.db3*')) or any(folder.glob('*.mcap*'))
    if not path.is_file() or path.name.endswith(_SUFFIXES):
        return True
    with path.open('rb') as file:
        return file.read(len(MAGIC)) == MAGIC


def locate(path: Path) -> list[BagFiles]:
    """
    Find the bags at a path.

    Raises
    ------
    BagError
        If there is none that can be read.
    """
    if not path.exists():
        raise BagError(f'{str(path)!r} does not exist; give the path of a bag or a log')
    if path.name == METADATA:
        path = path.parent
    if not path.is_dir():
        return [BagFiles(str(path), (path,))]
    if (path / METADATA).exists():
        return [_rosbag2(path)]
    return _without_metadata(path)


def _rosbag2(path: Path) -> BagFiles:
    about_path = path / METADATA
    where = repr(str(about_path))
    try:
        about = strict_yaml.load(about_path.read_text())['rosbag2_bagfile_information']
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BagError(
            f'{where} is no metadata of rosbag2 ({error}); remove it to read the .mcap '
            'files beside it'
        ) from error
    if not isinstance(about, dict):
        raise BagError(f'{where} holds {about!r}, expected the metadata of rosbag2')
    storage = about.get('storage_identifier')
    packed = str(about.get('compression_format') or '')
    listed = about.get('relative_file_paths') or []
    if storage != 'mcap':
        how = IMPORT if storage == 'sqlite3' else CONVERT
        raise BagError(f'{str(path)!r} is a bag in {storage!r} storage; {how}')
    if packed not in ('', 'zstd'):
        raise BagError(f'{str(path)!r} is compressed with {packed!r}; {CONVERT}')
    if not isinstance(listed, list):
        raise BagError(
            f'{where}: relative_file_paths is {listed!r}, expected a list '
            'of files; remove metadata.yaml to read the .mcap files beside it'
        )
    # older versions put the directory before the name, or leave the compression out
    names = [path / Path(str(name)).name for name in listed]
    there = [next(filter(Path.is_file, (it, Path(f'{it}.zstd'))), None) for it in names]
    missing = [
        f'{name.name} is listed in metadata.yaml and is not there'
        for name, file in zip(names, there, strict=True)
        if file is None
    ]
    files = tuple(filter(None, there))
    if not files:
        raise BagError(f'{where} lists no file that is there; restore them')
    each = packed if str(about.get('compression_mode') or '').lower() == 'message' else ''
    return BagFiles(str(path), files, message_compression=each, warnings=tuple(missing))


def _without_metadata(path: Path) -> list[BagFiles]:
    named = (file for file in path.iterdir() if file.name.endswith(_SUFFIXES))
    files = sorted(named, key=_natural_order)
    if not files:
        if any(path.glob('*.db3*')):
            raise BagError(f'{str(path)!r} is a bag in sqlite3 storage; {IMPORT}')
        raise BagError(f'{str(path)!r} holds no .mcap file; {_instead(path)}')
    stem = re.escape(path.name)
    if len(files) > 1 and all(re.fullmatch(rf'{stem}_\d+\.mcap.*', f.name) for f in files):
        # as rosbag2 names the files that it splits a recording into
        note = 'metadata.yaml is missing; the files are joined in the order of their numbers'
        return [BagFiles(str(path), tuple(files), warnings=(note,))]
    return [BagFiles(str(file), (file,)) for file in files]


def _instead(folder: Path) -> str:
    """Say what to give for a folder without a bag."""
    other = sorted(each.name for each in folder.iterdir() if each.is_file())
    if not other:
        return 'give a bag'
    more = f' and {len(other) - 3} more' if len(other) > 3 else ''
    return (
        f'it holds {", ".join(other[:3])}{more}. Logs are given by their own names: '
        f'{str(folder / other[0])!r}'
    )


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Put part_10 behind part_9."""
    pieces = re.split(r'(\d+)', path.name)
    return [(int(piece), '') if piece.isdigit() else (-1, piece) for piece in pieces]
