# SPDX-License-Identifier: Apache-2.0
"""
A log as a run: what was read of a file is replayed as a bag of it would be.

Its samples are encoded and decoded again, some at a time, as those of a bag are,
so that both give the same to the last bit and a `--remap` means the same.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import accumulate, islice
from pathlib import Path

import numpy as np

from shipdrag_ros.bags import Run
from shipdrag_ros.bags.contents import Contents, FileChannel
from shipdrag_ros.bags.locate import BagFiles
from shipdrag_ros.bags.message_index import Messages
from shipdrag_ros.bags.run import BATCH
from shipdrag_ros.messages.encoding import encode_batch
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.sources.log import Log, key_of, new_bag


class LogPart:
    """
    A log where a run expects a file of a bag.

    Parameters
    ----------
    log
    path
        What it is called.

    Attributes
    ----------
    contents
        Its channels, how many messages each has, and attachments.
    span_ns
        First and last time of arrival [ns]; None without messages.
    indexed
        Whether its messages are known without reading it to its end.
    """

    indexed = True

    def __init__(self, log: Log, path: Path) -> None:
        self.path = path
        self.span_ns = log.span_ns
        self._log = log
        self.contents = Contents()
        self._number = {key: number for number, key in enumerate(log.counts)}
        for (topic, kind), number in self._number.items():
            self.contents.channels[number] = FileChannel(topic, kind, 'cdr')
            self.contents.counts[number] = log.counts[topic, kind]
        for name, text in log.attachments.items():
            self.contents.attachments[name] = text.encode()

    def messages(
        self, channels: Collection[int], *, start_ns: int = 0, end_ns: int = sys.maxsize
    ) -> Iterator[Messages]:
        """
        Yield messages in order of arrival, some at a time.

        Parameters
        ----------
        channels
            Numbers of those to read.
        start_ns, end_ns
            First and last time of arrival to read [ns].
        """
        for found in self._all():
            wanted = np.isin(found.channel, list(channels))
            wanted &= (found.log_ns >= start_ns) & (found.log_ns <= end_ns)
            if wanted.any():
                yield found if wanted.all() else found[wanted]

    def _all(self) -> Iterator[Messages]:
        for block in self._log.blocks:
            for first in range(0, len(block), BATCH):
                yield self._encoded(block[first : first + BATCH])
        stored = iter(()) if self._log.messages is None else self._log.messages()
        for some in iter(lambda: tuple(islice(stored, BATCH)), ()):
            ends = np.fromiter(accumulate((len(one.payload) for one in some), initial=0), np.int64)
            yield Messages(
                np.frombuffer(b''.join(one.payload for one in some), np.uint8),
                np.array([one.log_ns for one in some], np.int64),
                np.zeros(len(some), np.int64),
                np.array([self._number[one.topic, one.type] for one in some], np.uint16),
                ends[:-1],
                ends[1:],
            )

    def _encoded(self, block: Block) -> Messages:
        number = np.zeros(len(Channel), np.uint16)
        for code in np.unique(block.channel).tolist():
            number[code] = self._number[key_of(Channel(code))]
        batch = encode_batch(block)
        nowhere = np.zeros(len(block), np.int64)
        return Messages(
            batch.data, block.receive_ns, nowhere, number[block.channel], batch.start, batch.end
        )


class LogRun(Run):
    """A run whose samples stood in logs or tables; `paths` are these."""

    def __init__(
        self, log: Log, sources: Sequence[Path], remap: Mapping[str, str] | None = None
    ) -> None:
        name = ', '.join(map(str, sources))
        part = LogPart(log, Path(name))
        super().__init__(BagFiles(name, tuple(sources)), [part], remap=remap)  # type: ignore[list-item]
        self._sources = tuple(sources)
        self._log = log

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files that it was made of."""
        return self._sources

    def save(self, out: Path) -> None:
        """
        Write the run as a bag.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        own = self._log.attachments
        with new_bag(
            out, {k: text for k, text in self.attachments.items() if k not in own}
        ) as bag:
            self._log.copy_to(bag)


def run_of(log: Log, sources: Sequence[Path], remap: Mapping[str, str] | None = None) -> Run:
    """
    Return what was read of files as a run.

    Parameters
    ----------
    log
    sources
        The files.
    remap
        Topic -> input.

    Raises
    ------
    BagError
        If a remap names nothing.
    """
    return LogRun(log, sources, remap)
