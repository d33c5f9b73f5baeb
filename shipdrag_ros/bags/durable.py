# SPDX-License-Identifier: Apache-2.0
"""
Recording beside the work: a thread that writes, and a queue that never blocks.

What was handed over is held in memory until the disk has it, so that a disk
that fails for a while loses nothing that memory can hold.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, count, islice
from pathlib import Path
from time import monotonic
from typing import Any
from uuid import uuid4

from mcap.records import DataEnd, Footer

from shipdrag_ros.bags.contents import DECLARED
from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.bags.recover import compact
from shipdrag_ros.bags.writer import (
    BagWriter,
    Compression,
    NameTakenError,
    as_bytes,
    sync_directory,
)
from shipdrag_ros.errors import BagError, disk_errors, reason_of
from shipdrag_ros.messages import EncodedMessage

DECLARE_BYTES = 1 << 20  # topics are declared anew behind so much


class LiveFile(BagWriter):
    """
    An MCAP file that is safe up to its last `sync`, and locked until its `release`.

    Parameters
    ----------
    path
        File to make; one that exists is never overwritten.
    recording_id, part
        Files of one recording carry the same id and are numbered from 0.
    attachments
        Text by name.

    Attributes
    ----------
    size_bytes
        Written so far.
    synced_bytes, synced_messages
        Of these, safe when the power goes.

    Raises
    ------
    NameTakenError
        If the file exists.
    BagError
        If it cannot be made.
    """

    indexed = False

    def __init__(
        self, path: Path, *, recording_id: str, part: int, attachments: Mapping[str, str]
    ) -> None:
        self.synced_bytes = self.synced_messages = self._messages = self._declared_at = 0
        self.first_log_ns: int | None = None
        about: dict[str, Any] = {'recording_id': recording_id, 'part': part}
        about |= {'attachments': attachments, 'compression': Compression.NONE}
        try:
            super().__init__(path, chunk_bytes=sys.maxsize, **about)  # `append` ends a chunk
            self.sync()
            with disk_errors(self.path, 'written'):
                sync_directory(path.parent)
        except BagError:
            if hasattr(self, '_file'):
                self.abandon()
            raise

    def append(self, messages: Sequence[EncodedMessage]) -> None:
        """
        Write messages as one chunk.

        Raises
        ------
        BagError
            If a type is not known or the disk does not take it.
        """
        for message in messages:
            self.put(message)
        if self.size_bytes - self._declared_at > DECLARE_BYTES:
            self._write(as_bytes(*self._summary.of(*DECLARED)))
            self._declared_at = self.size_bytes
        self._end_chunk()
        self._messages += len(messages)
        if self.first_log_ns is None:
            self.first_log_ns = messages[0].log_ns

    def sync(self) -> None:
        """
        Bring what is written to the disk.

        Raises
        ------
        BagError
            If the disk does not take it, or the file is no longer in its place.
        """
        with disk_errors(self.path, 'written'):
            os.fsync(self._file.fileno())
            if not self.in_place():
                raise BagError(f'{str(self.path)!r} was removed or replaced by somebody else')
        self.synced_bytes, self.synced_messages = self.size_bytes, self._messages

    def in_place(self) -> bool:
        """Say whether the name is still that of this file."""
        with suppress(FileNotFoundError):
            return os.path.samestat(os.fstat(self._file.fileno()), self.path.stat())
        return False

    def vanished(self) -> bool:
        """Say whether nothing can open the file any more: it was removed, and not moved."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    def close(self) -> None:
        """
        Write the end, without an index, and bring everything to the disk.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        self._write(as_bytes(DataEnd(0), Footer(0, 0, 0)) + MAGIC)
        self.sync()

    def abandon(self) -> None:
        """Leave the file as the last `sync` did; without messages, remove it."""
        with suppress(OSError):
            self._file.truncate(self.synced_bytes)
        if not self.synced_messages:
            with suppress(OSError):
                if self.in_place():
                    self.path.unlink()
            self.release()

    def release(self) -> None:
        """Let others have the file."""
        with suppress(OSError):
            self._file.close()


WRITE_S = 0.1  # to the system: survives the end of the process
SYNC_S = 0.5  # to the disk: survives the end of the power
RETRY_S = 1.0
CHUNK_BYTES = 1 << 20
EARLIER_AT_ONCE = 4096
KEPT_BEFORE = 100  # messages that wait for a first that makes a file
QUEUE_BYTES = 64 * 1024 * 1024
_MESSAGE_BYTES = 400  # of Python, around the content
_Held = tuple[float, EncodedMessage]


@dataclass(frozen=True)
class PartLimits:
    """
    When a recording goes on in a new file.

    Attributes
    ----------
    size_bytes
        Of the file while it grows; it shrinks when it is finished.
    duration_s
        From the arrival of its first message to that of its last.
    """

    size_bytes: int = 64 * 1024 * 1024
    duration_s: float = 21_600.0


@dataclass
class RecordingProgress:
    """
    How a recording stands.

    Attributes
    ----------
    directory
        Where the parts are written.
    path
        File of the part being written, or of the last; None before the first.
    part
        Its number, from 0.
    messages, size_bytes
        On the disk; of the whole recording, and of this part.
    waiting
        Messages in memory only.
    lost
        Messages that found no room in memory, or no disk until the end, or whose file
        somebody removed.
    oldest_s
        How long the oldest of those in memory has been waiting [s].
    error
        Why nothing is written now, '' if it is.
    uncompacted
        Finished parts that could not be made compact; they are whole.
    why_uncompacted
        Why the last of them could not; '' without any.
    vanished
        Files that somebody removed while they were written.
    """

    directory: Path
    path: Path | None = None
    part: int = 0
    messages: int = 0
    size_bytes: int = 0
    waiting: int = 0
    lost: int = 0
    oldest_s: float = 0.0
    error: str = ''
    uncompacted: int = 0
    why_uncompacted: str = ''
    vanished: int = 0


class DurableRecording:
    """
    A recording in one part or several, safe at every moment but the last.

    Parameters
    ----------
    directory
        Where the parts are written; made if missing, also when it has vanished.
    stem
        Parts are named `STEM_000.mcap` and so on; no file is ever overwritten.
    attachments
        Text by name, at the beginning of each part.
    limits
        When a new part is begun.
    earlier
        Messages to begin with; read in the thread that writes.
    queue_bytes
        Memory for what waits for the disk; what finds no room is counted.
    """

    def __init__(
        self,
        directory: Path,
        *,
        stem: str,
        attachments: Mapping[str, str],
        limits: PartLimits,
        earlier: Iterable[EncodedMessage] = (),
        queue_bytes: int = QUEUE_BYTES,
    ) -> None:
        self._directory, self._stem, self._limits = directory, stem, limits
        self._about: dict[str, Any] = {'recording_id': uuid4().hex, 'attachments': attachments}
        self._earlier: Iterator[EncodedMessage] | None = iter(earlier)
        self._queue_bytes = queue_bytes
        self._file: LiveFile | None = None
        self._told = RecordingProgress(directory)
        self._lock = threading.Lock()
        # what is not safe yet, each with the moment it came: handed over, and taken from there or
        # from the earlier, in order, of which the first are in the file
        self._queue: list[_Held] = []
        self._taken: list[_Held] = []
        self._held_bytes = self._written = 0
        self._begun_s: float | None = None  # since when there is something worth a file
        self._synced_s = monotonic()
        self._retry_s = 0.0
        self._uncompacted: list[LiveFile] = []
        self._compacting = threading.Lock()
        self._ending = threading.Event()
        self._tried = threading.Event()
        self._thread = _beside(self._run)

    def put(self, message: EncodedMessage, *, begins: bool = True) -> None:
        """
        Hand a message over; returns at once, whatever the disk does.

        Parameters
        ----------
        message
            What to write.
        begins
            Whether it is worth a file; of those that are not, the latest
            `KEPT_BEFORE` wait for one that is.
        """
        with self._lock:
            if begins and self._begun_s is None:
                self._begun_s = monotonic()
            elif self._begun_s is None and len(self._queue) >= KEPT_BEFORE:
                self._let_go(self._queue, 1)
            if self._held_bytes + _bytes_of(message) > self._queue_bytes:
                self._told.lost += 1
            else:
                self._hold(self._queue, [message])

    def stop(self) -> None:
        """Ask for the end; returns at once."""
        self._ending.set()

    def wait_begun(self, timeout_s: float) -> None:
        """Wait until the first file is there, or has been refused."""
        self._tried.wait(timeout_s)

    def wait_ended(self, timeout_s: float) -> bool:
        """Wait after `stop`; return whether all that can be written is."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def progress(self) -> RecordingProgress:
        """Return how the recording stands; asks no disk."""
        with self._lock:
            begun_s, now_s = self._begun_s, monotonic()
            first = (self._taken or self._queue)[:1] if begun_s is not None else []
            return replace(
                self._told,
                waiting=len(self._taken) + len(self._queue) if first else 0,
                oldest_s=now_s - max(begun_s or 0.0, first[0][0]) if first else 0.0,
                uncompacted=len(self._uncompacted),
                why_uncompacted=self._told.why_uncompacted if self._uncompacted else '',
            )

    def _hold(self, where: list[_Held], messages: Sequence[EncodedMessage]) -> None:
        now_s = monotonic()
        where += ((now_s, message) for message in messages)
        self._held_bytes += sum(map(_bytes_of, messages))

    def _let_go(self, where: list[_Held], count: int) -> None:
        self._held_bytes -= sum(_bytes_of(message) for _, message in where[:count])
        del where[:count]

    def _run(self) -> None:
        while True:
            hurry = self._earlier is not None and not self._told.error
            ending = self._ending.wait(0.0 if hurry else WRITE_S)
            try:
                self._take()
                if ending or monotonic() >= self._retry_s:
                    self._write()
                    if ending or hurry or monotonic() - self._synced_s >= SYNC_S:
                        self._sync()
            except Exception as error:  # a thread that ends unseen would lose all
                self._fail(error)
            if ending and (self._told.error or self._earlier is None):
                break
        self._finish()

    def _take(self) -> None:
        """Take some of the earlier messages, or behind them all that was handed over."""
        some: list[EncodedMessage] = []
        if self._earlier is not None:
            if self._written < len(self._taken):
                return
            some = list(islice(self._earlier, EARLIER_AT_ONCE))
            self._earlier = self._earlier if some else None
        with self._lock:
            if some:
                self._begun_s = self._begun_s or monotonic()
                self._hold(self._taken, some)
            elif self._begun_s is not None:
                self._taken += self._queue
                self._queue.clear()

    def _write(self) -> None:
        if self._begun_s is None:
            self._make_directory()
            self._tried.set()
            return
        file = self._file or self._open()
        due = [message for _, message in self._taken[self._written :]]
        while due:
            fitting = self._fitting(file, due)
            if fitting:
                file.append(due[:fitting])
                self._written += fitting
                del due[:fitting]
            else:  # go on in the next part
                self._sync()
                file.close()
                self._leave(file)
                _beside(partial(self._compact, wait=False))
                file = self._open()

    def _fitting(self, file: LiveFile, due: Sequence[EncodedMessage]) -> int:
        """Return how many messages the part takes as one chunk."""
        room = min(CHUNK_BYTES, self._limits.size_bytes - file.size_bytes)
        begin_ns = due[0].log_ns if file.first_log_ns is None else file.first_log_ns
        end_ns = begin_ns + round(self._limits.duration_s * 1e9)
        fitting = 0
        for message in due:
            empty = file.first_log_ns is None and not fitting  # takes one, whatever its size
            if not empty and (room <= 0 or message.log_ns > end_ns):
                break
            room -= len(message.payload)
            fitting += 1
        return fitting

    def _sync(self) -> None:
        if self._file is not None and self._written:
            self._file.sync()
            with self._lock:
                self._told.messages += self._written
                self._told.size_bytes = self._file.synced_bytes
                self._let_go(self._taken, self._written)
            self._written = 0
        self._synced_s = monotonic()
        self._told.error = ''

    def _open(self) -> LiveFile:
        """Make the next file, under a name that no other recording has taken."""
        self._make_directory()
        part = self._told.part
        for again in chain([''], map('_{}'.format, count(2))):
            path = self._directory / f'{self._stem}_{part:03d}{again}.mcap'
            with suppress(NameTakenError):
                file = LiveFile(path, part=part, **self._about)
                break
        with self._lock:
            self._told.path, self._told.size_bytes = path, file.synced_bytes
        self._tried.set()
        self._file = file
        return file

    def _make_directory(self) -> None:
        try:
            self._directory.mkdir(mode=0o750, parents=True, exist_ok=True)
            real = self._directory.resolve()
        except OSError as error:
            raise BagError(f'{str(error.filename)!r}: {error.strerror}') from error
        if self._directory.is_absolute() and real != self._directory:
            raise BagError(f'{str(self._directory)!r} has become a link to {str(real)!r}')
        if not os.access(self._directory, os.W_OK | os.X_OK):
            raise BagError(f'{str(self._directory)!r}: Permission denied')

    def _leave(self, file: LiveFile) -> None:
        """Go on with the next part, and let a compaction have this one."""
        self._uncompacted.append(file)
        self._file = None
        self._told.part += 1

    def _fail(self, error: Exception) -> None:
        """Let the file be as it was when last safe; what came behind goes to the next."""
        file, self._file = self._file, None
        if file is not None:
            file.abandon()
            if file.synced_messages and not self._gone(file):
                self._leave(file)
        self._written = 0
        self._told.error = reason_of(error)
        self._retry_s = monotonic() + RETRY_S
        self._tried.set()

    def _finish(self) -> None:
        if self._file is not None:
            try:
                self._file.close()
                self._leave(self._file)
            except Exception as error:  # what is safe already is counted below
                self._fail(error)
        with self._lock:
            left = self._taken + self._queue
            self._told.lost += 0 if self._begun_s is None else len(left)
            self._taken, self._queue, self._held_bytes = [], [], 0
        self._compact(wait=True)
        for file in self._uncompacted:
            file.release()

    def _compact(self, *, wait: bool) -> None:
        if not self._compacting.acquire(blocking=wait):
            return  # another is at it; what it does not see is left to the next part, or the end
        try:
            for file in tuple(self._uncompacted):
                try:
                    if not self._gone(file):
                        compact(file.path, messages=file.synced_messages)
                        file.release()
                    self._uncompacted.remove(file)
                except Exception as error:  # it is tried again with the next part, and counted
                    self._told.why_uncompacted = reason_of(error)
        finally:
            self._compacting.release()

    def _gone(self, file: LiveFile) -> bool:
        """Say whether somebody removed a file; what was in it is lost, and counted."""
        if not file.vanished():
            return False
        file.release()
        with self._lock:
            self._told.vanished += 1
            self._told.lost += file.synced_messages
            self._told.messages -= file.synced_messages
        return True


def _bytes_of(message: EncodedMessage) -> int:
    return len(message.payload) + _MESSAGE_BYTES


def _beside(work: Callable[[], None]) -> threading.Thread:
    """Begin some work; a disk that hangs for ever must not keep the process."""
    thread = threading.Thread(target=work, name='recording', daemon=True)
    thread.start()
    return thread
