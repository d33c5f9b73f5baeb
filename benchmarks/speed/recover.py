# SPDX-License-Identifier: Apache-2.0
"""
How much of what is whole in a damaged bag is saved, and what checking and saving cost.

Each damage hits a place drawn at random in a bag of 400 messages, of one of five writers.
A message is whole if no byte of the record it lies in was touched: the chunk, or without
chunks the message itself. It is saved if it comes out as it was written; of the whole ones
those count apart that are in the quarantine bag, because a damage beside them made their
topic, or their own bounds, uncertain. What is saved besides, of chunks that were hit, is
counted as `partly`. `false` are messages in the sound bag that nobody wrote: without a
checksum a flipped payload cannot be noticed. Seed 1.

Then bags of 50 000 to 400 000 messages: process CPU time, best of two, and the growth of
the memory in a process of its own; the same time, in that of reading, for files as a finished
recording leaves them, as a killed one does (three messages a chunk), and without chunks; and the
growth of the memory on bags of 10, 50 and 200 MB, sound and with a bit flipped in the middle.
"""

from __future__ import annotations

import multiprocessing
import random
import resource
import time
from collections import Counter
from collections.abc import Callable, Iterable, Set
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from io import BytesIO
from mmap import mmap
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from benchmarks._asked import asked
from shipdrag_ros.bags import BagWriter, open_runs
from shipdrag_ros.bags.check import check
from shipdrag_ros.bags.durable import LiveFile
from shipdrag_ros.bags.records import MAGIC, Place, unpack, walk
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage, encode, types
from shipdrag_ros.samples import Block, Channel, in_arrival_order

SEED = 1
MESSAGES = 400
SECTOR_BYTES = 512
PAYLOAD_BYTES = 4000
START_NS = 1_700_000_000 * 10**9
WRITERS: dict[str, dict[str, Any]] = {
    'zstd': {'compression': CompressionType.ZSTD, 'chunk_size': 4096},
    'lz4': {'compression': CompressionType.LZ4, 'chunk_size': 4096},
    'plain chunks': {'compression': CompressionType.NONE, 'chunk_size': 4096},
    'without checksums': {'chunk_size': 4096, 'enable_crcs': False},
    'no chunks': {'use_chunking': False},
}
Message = tuple[int, str, int, bytes]  # number, topic, log time, payload


def record(n: int) -> Block:
    """Return readings of three inputs at 10 Hz, in order of arrival."""
    rng = np.random.default_rng(SEED)
    stamps = START_NS + np.arange(-(-n // 3)) * 10**8
    blocks = []
    for channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.SHAFT):
        shape = (len(stamps), 2) if channel is Channel.POSITION else len(stamps)
        value = rng.normal(5.0, 0.05, shape)
        blocks.append(Block.of(channel, stamps, value, receive_ns=stamps + 10**6))
    return in_arrival_order(blocks)[:n]


class Sound(NamedTuple):
    """A bag as it was written, and where each of its messages lies."""

    content: bytes
    messages: frozenset[Message]
    spans: tuple[tuple[int, int, frozenset[int]], ...]


def reference(file: IO[bytes], messages: Iterable[EncodedMessage], **options: Any) -> None:
    """Write messages with the reference writer, numbered."""
    writer = Writer(file, **options)
    writer.start('ros2')
    writer.add_attachment(0, 0, 'ship.yaml', 'application/yaml', b'name: x\n' * 50)
    writer.add_metadata('notes', {'weather': 'calm'})
    channels: dict[str, int] = {}
    for number, each in enumerate(messages):
        if each.topic not in channels:
            text = types.definition(each.type).encode()
            schema = writer.register_schema(each.type, 'ros2msg', text)
            channels[each.topic] = writer.register_channel(each.topic, 'cdr', schema)
        writer.add_message(
            channels[each.topic], each.log_ns, each.payload, each.publish_ns, number
        )
    writer.finish()


def finished(path: Path, messages: Iterable[EncodedMessage]) -> None:
    """Write messages as a recording that has ended."""
    with BagWriter(path) as bag:
        for each in messages:
            times = {'log_ns': each.log_ns, 'publish_ns': each.publish_ns}
            bag.put(EncodedMessage(each.topic, each.type, each.payload, **times))


def write(options: dict[str, Any]) -> Sound:
    """Write a bag with the reference writer."""
    file = BytesIO()
    reference(file, encode(record(MESSAGES)), **options)
    content = file.getvalue()
    spans = []
    for place in walk(content, len(MAGIC), len(content) - len(MAGIC)):
        data, inside = content, [place]
        if place.opcode == Opcode.CHUNK:
            data = unpack(content, place).records
            inside = list(walk(data, 0, len(data)))
        numbers = frozenset(_number(data, e) for e in inside if e.opcode == Opcode.MESSAGE)
        spans.append((place.offset, place.end, numbers))
    return Sound(content, messages_of(content), tuple(spans))


def _number(data: bytes, place: Place) -> int:
    return int.from_bytes(data[place.start + 2 : place.start + 6], 'little')


def messages_of(content: bytes) -> frozenset[Message]:
    """Return the messages of a sound bag, as the reference reader finds them."""
    return frozenset(
        (message.sequence, channel.topic, message.log_time, message.data)
        for _, channel, message in make_reader(BytesIO(content)).iter_messages()
    )


class Damaged(NamedTuple):
    """A damaged bag, and the span that was hit, in bytes of the sound one."""

    content: bytes
    start: int
    end: int


def damaged(kind: str, content: bytes, at: int, rng: random.Random) -> Damaged:
    """Damage a bag at a place."""
    if kind.startswith('a sector'):
        at -= at % SECTOR_BYTES
    end = at + {'cut off': len(content), 'a bit flipped': 1}.get(kind, SECTOR_BYTES)
    if kind == 'up to 2000 bytes lost':
        end = at + rng.randrange(1, 2000)
    end = min(end, len(content))
    by = b''
    if kind == 'a bit flipped':
        by = bytes([content[at] ^ 1 << rng.randrange(8)])
    elif kind == 'a sector of zeros':
        by = bytes(end - at)
    elif kind == 'a sector of chance':
        by = rng.randbytes(end - at)
    elif kind == 'up to 200 bytes inserted':
        # between two bytes: the record around that place is hit
        end, by = at, rng.randbytes(rng.randrange(1, 200))
    return Damaged(content[:at] + by + content[end:], at, end)


DAMAGES = (
    'cut off', 'a bit flipped', 'a sector of zeros', 'a sector of chance', 'up to 2000 bytes lost',
    'up to 200 bytes inserted',
)  # fmt: skip


def tallied(sound: Sound, hurt: Damaged, folder: Path) -> Counter[str]:
    """Recover a bag, check what comes out and count it."""
    hit = {
        number
        for start, end, inside in sound.spans
        if start < hurt.end and hurt.start < end
        for number in inside
    }
    whole = {message for message in sound.messages if message[0] not in hit}
    source = folder / 'damaged.mcap'
    source.write_bytes(hurt.content)
    saved, quarantined = set[Message](), set[Message]()
    counts = Counter(damages=1, found=not check([source])[0].sound)
    with suppress(BagError):  # nothing is left of it
        result = recover(source, folder / 'saved.mcap')
        for path, found in (
            (result.output, saved),
            (folder / 'saved.quarantine.mcap', quarantined),
        ):
            if path.exists():
                found |= messages_of(path.read_bytes())
                counts['unsound'] += not check([path])[0].sound
                path.unlink()
        assert len(saved) <= result.messages_recovered
    counts['whole'], counts['bytes'] = len(whole), _bytes(whole)
    counts['in sound'] = len(whole & saved)
    counts['in quarantine'] = len(_known(whole, quarantined) - (whole & saved))
    counts['bytes saved'] = _bytes((whole & saved) | _known(whole, quarantined))
    counts['partly'] = len(_known(sound.messages - whole, saved | quarantined))
    counts['false'] = len(saved - sound.messages)
    return counts


def _bytes(messages: Set[Message]) -> int:
    return sum(len(message[3]) for message in messages)


def _known(wanted: Set[Message], found: Set[Message]) -> Set[Message]:
    """Return the messages that were found, be their topic known or not."""
    numbers = {(number, log_ns, payload) for number, _, log_ns, payload in found}
    return {m for m in wanted if (m[0], m[2], m[3]) in numbers}


def salvage(per_cell: int, folder: Path) -> None:
    """Print what is saved, by damage and writer."""
    rng = random.Random(SEED)
    bags = {name: write(options) for name, options in WRITERS.items()}
    rows: dict[str, Counter[str]] = {name: Counter() for name in (*DAMAGES, *WRITERS, 'all')}
    for damage in DAMAGES:
        for name, sound in bags.items():
            for _ in range(per_cell):
                at = rng.randrange(len(MAGIC), len(sound.content))
                hurt = damaged(damage, sound.content, at, rng)
                if hurt.content == sound.content:
                    continue
                counts = tallied(sound, hurt, folder)
                for key in (damage, name, 'all'):
                    rows[key] += counts
    columns = ('damages', 'found', 'whole', 'in sound', 'in quarantine', 'partly', 'false')
    print(f'{"":26}' + ''.join(f'{each:>14}' for each in (*columns, 'unsound', 'bytes saved')))
    for name, counts in rows.items():
        share = counts['bytes saved'] / max(counts['bytes'], 1)
        cells = ''.join(f'{counts[each]:14}' for each in (*columns, 'unsound'))
        print(f'{name:26}{cells}{share:14.3%}')


def cost(sizes: tuple[int, ...], folder: Path) -> None:
    """Print the time and memory of reading, checking and recovering, and their slopes."""
    seconds: dict[str, list[float]] = {}
    megabytes: dict[str, list[int]] = {}
    bytes_of = []
    for n in sizes:
        path = folder / f'{n}.mcap'
        finished(path, encode(record(n)))
        bytes_of.append(path.stat().st_size)
        uses: dict[str, Callable[[Path], Any]] = {'read': _read, 'check': _look, 'recover': _save}
        for name, use in uses.items():
            took, grown = zip(*(_measured(use, path) for _ in range(2)), strict=True)
            seconds.setdefault(name, []).append(min(took))
            megabytes.setdefault(name, []).append(max(grown))
    print(f'\n{"":10}' + ''.join(f'{n:>12}' for n in sizes) + '  messages')
    print(f'{"size":10}' + ''.join(f'{size / 1e6:12.2f}' for size in bytes_of) + '  MB')
    for name, took in seconds.items():
        slope = np.polyfit(np.log(sizes), np.log(took), 1)[0]
        rate = sizes[-1] / took[-1] / 1e3
        cells = ''.join(f'{each:12.2f}' for each in took)
        print(f'{name:10}{cells}  s, slope {slope:.2f}, {rate:.0f} thousand messages a second')
        print(f'{"":10}' + ''.join(f'{each:12}' for each in megabytes[name]) + '  MB more')


def kinds(n: int, folder: Path) -> None:
    """Print the time of checking and recovering in that of reading, by how a file was written."""
    ended, killed, loose = (folder / f'{kind}.mcap' for kind in ('finished', 'killed', 'loose'))
    messages = list(encode(record(n)))
    finished(ended, messages)
    with loose.open('wb') as file:
        reference(file, messages, use_chunking=False)
    growing = LiveFile(killed, recording_id='', part=0, attachments={})
    for at in range(0, n, 3):
        growing.append(messages[at : at + 3])
    growing.sync()
    print(f'\n{"of reading":12}{"read [s]":>12}{"check":>12}{"recover":>12}')
    for path in (ended, killed, loose):
        read, *others = (
            min(_measured(use, path)[0] for _ in range(3)) for use in (_read, _look, _save)
        )
        print(f'{path.stem:12}{read:12.3f}' + ''.join(f'{each / read:12.1f}' for each in others))


def memory(sizes_mb: tuple[int, ...], folder: Path) -> None:
    """Print by how much the memory grows, by the size of the bag."""
    rng = random.Random(SEED)
    print(f'\n{"MB more":20}' + ''.join(f'{size:>12}' for size in sizes_mb) + '  MB')
    rows: dict[str, list[int]] = {}
    for size_mb in sizes_mb:
        path = folder / f'{size_mb}_mb.mcap'
        with BagWriter(path) as bag:
            for number in range(size_mb * 10**6 // PAYLOAD_BYTES):
                payload, ns = rng.randbytes(PAYLOAD_BYTES), START_NS + number * 10**6
                bag.put(EncodedMessage('/cloud', 'std_msgs/msg/String', payload, ns, ns))
        for state in ('sound', 'damaged'):
            if state == 'damaged':
                with path.open('r+b') as file, mmap(file.fileno(), 0) as content:
                    content[size_mb * 10**6 // 2] ^= 1
            for name, use in (('check', _look), ('recover', _save)):
                rows.setdefault(f'{name}, {state}', []).append(_measured(use, path)[1])
        path.unlink()
    for name, grown in rows.items():
        print(f'{name:20}' + ''.join(f'{each:12}' for each in grown))


def _read(path: Path) -> None:
    for run in open_runs([path]):
        for _ in run.inputs():
            pass


def _look(path: Path) -> None:
    check([path])


def _save(path: Path) -> None:
    result = recover(path, path.with_suffix('.saved.mcap'))
    result.output.unlink()
    if result.quarantine is not None:
        result.quarantine.unlink()


def _measured(use: Callable[[Path], Any], path: Path) -> tuple[float, int]:
    """Return CPU time [s] and growth of memory [MB] of a use, in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context('fork')) as pool:
        return pool.submit(_used, use, path).result(600)


def _used(use: Callable[[Path], Any], path: Path) -> tuple[float, int]:
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    use(path)
    took = time.process_time() - begin
    after_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return took, (after_kib - before_kib) // 1000


def main() -> None:
    """Print the tables."""
    quick = asked(__doc__, quick=False).quick
    with TemporaryDirectory() as name:
        salvage(2 if quick else 15, Path(name))
        _read_once(Path(name))
        cost((5000, 10_000) if quick else (50_000, 100_000, 200_000, 400_000), Path(name))
        kinds(6000 if quick else 60_000, Path(name))
        memory((10, 50) if quick else (10, 50, 200), Path(name))


def _read_once(folder: Path) -> None:
    """Compile what reading needs, before it is timed."""
    path = folder / 'first.mcap'
    path.write_bytes(write({}).content)
    _read(path)


if __name__ == '__main__':
    main()
