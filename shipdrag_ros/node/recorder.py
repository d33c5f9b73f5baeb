# SPDX-License-Identifier: Apache-2.0
"""
Recording while the node runs: what came in, what went out, in that order.

A thread writes; here nothing waits for a disk, so that one that is slow, full
or gone stops no estimate. What was not written is counted. Another thread removes
old recordings. The latest messages are kept for a recording that starts later.
"""

from __future__ import annotations

import pickle
import threading
import time
import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from itertools import chain
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from shipdrag_ros.bags.durable import DurableRecording, PartLimits, RecordingProgress
from shipdrag_ros.bags.retention import Keep, Removed, Retention
from shipdrag_ros.display import printable
from shipdrag_ros.errors import reason_of
from shipdrag_ros.messages import EncodedMessage, OutputMessage
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

SEGMENT_BYTES = 64 * 1024  # packed at once: a millisecond or two
LIMIT_BYTES = 128 * 1024 * 1024


class _Segment(NamedTuple):
    newest_ns: int
    packed: bytes


class RawRing:
    """
    Messages in arrival order, bounded by time and by bytes when packed; the oldest go first.

    Parameters
    ----------
    keep_ns
        Age at which a message may be forgotten [ns].

    Attributes
    ----------
    cut
        Whether the limit of bytes, rather than age, took messages away.
    """

    def __init__(self, keep_ns: int) -> None:
        self._keep_ns = keep_ns
        self._segments: deque[_Segment] = deque()
        self._open: list[EncodedMessage] = []
        self._open_bytes = 0
        self.cut = False

    def add(self, message: EncodedMessage) -> None:
        """
        Take the newest message.
        """
        self._open.append(message)
        self._open_bytes += len(message.payload)
        if self._open_bytes < SEGMENT_BYTES:
            return
        plain = [tuple(each) for each in self._open]
        packed = zlib.compress(pickle.dumps(plain, protocol=5), level=1)
        self._segments.append(_Segment(message.log_ns, packed))
        self._open.clear()
        self._open_bytes = 0
        excess = sum(len(segment.packed) for segment in self._segments) - LIMIT_BYTES
        oldest_ns = message.log_ns - self._keep_ns
        while self._segments and (excess > 0 or self._segments[0].newest_ns < oldest_ns):
            self.cut = self.cut or excess > 0
            excess -= len(self._segments.popleft().packed)

    def clear(self) -> None:
        """
        Forget everything.
        """
        self._segments.clear()
        self._open.clear()
        self._open_bytes = 0
        self.cut = False

    def __iter__(self) -> Iterator[EncodedMessage]:
        """Give the messages of this moment, whatever is added while they are read."""
        packed = map(_unpack, tuple(self._segments))  # one after the other, as they are read
        return chain(chain.from_iterable(packed), tuple(self._open))


def _unpack(segment: _Segment) -> Iterator[EncodedMessage]:
    return map(EncodedMessage._make, pickle.loads(zlib.decompress(segment.packed)))


# the ring is cut by arrival, the monitor's memory by stamps
MARGIN_NS = 600_000_000_000
BEGIN_S = 0.5  # an answer to a start waits so long for the disk
CLOSE_S = 5.0
SLOW_S = 2.0
DEFAULT_LIMITS = PartLimits()
EVERYTHING = Keep(share=0.0)
EVERY_S = 60.0


class Housekeeping:
    """
    Tidies a directory now and then, from its making to `close`.

    Parameters
    ----------
    directory
        Of the recordings.
    keep
        The limits; without any no thread is started.
    """

    def __init__(self, directory: Path, keep: Keep) -> None:
        self._retention = Retention(directory, keep)
        self._directory = directory
        self._keep = keep
        self._failure = ''
        self._removed: deque[Removed] = deque(maxlen=1000)
        self._ending = threading.Event()
        # a disk that hangs must not keep the process
        self._thread = threading.Thread(target=self._run, name='housekeeping', daemon=True)
        if not keep.everything:
            self._thread.start()

    def removed(self) -> list[Removed]:
        """
        Return what was removed since the last time.
        """
        return [self._removed.popleft() for _ in range(len(self._removed))]

    @property
    def text(self) -> str:
        """What is removed, and whether what may not be is too much."""
        over = self._retention.over_bytes
        if not over:
            return self._keep.text
        return (
            f'{self._keep.text}; those that are kept take {over * 1e-9:.3g} GB more than that: '
            'move them ashore, or set keep_bytes'
        )

    def close(self) -> None:
        """
        End; returns at once.
        """
        self._ending.set()

    @property
    def problem(self) -> str:
        """Why old recordings cannot be removed as they should, and what to do; '' if they can."""
        return self._failure or self._retention.problem

    def _run(self) -> None:
        while True:
            try:
                self._removed += self._retention.tidy(now_s=time.time())
                self._failure = ''
            except Exception as error:  # a thread that ends unseen would let the disk fill
                where = printable(str(self._directory))
                self._failure = f'{where} ({reason_of(error)}); look at it, and at its disk'
            if self._ending.wait(EVERY_S):
                return


class RecordingState(Enum):
    """Whether what passes is written."""

    OFF = 'off'
    RECORDING = 'recording'
    FAILED = 'failed'


@dataclass(frozen=True)
class RecordingStatus:
    """
    How the recording stands.

    Attributes
    ----------
    progress
        Of this or of the last recording, None before the first.
    lost
        Messages that were not written, of all recordings of this recorder.
    ring_cut
        Whether memory was too small to keep all that a recording started now should
        begin with; its replay may then differ from the live figures at first.
    kept
        What is removed to keep room on the disk.
    untidy
        Why that cannot be done, and what to do; '' where it can.
    """

    state: RecordingState
    progress: RecordingProgress | None
    lost: int
    ring_cut: bool
    kept: str
    untidy: str

    @property
    def text(self) -> str:
        """One line for a log or for an operator."""
        progress = self.progress
        lost = f', {self.lost} message(s) lost'
        if progress is not None and progress.vanished:
            lost += f'; somebody removed {progress.vanished} file(s) that were being written'
        if progress is None:
            text = 'not recording'
        elif self.state is RecordingState.FAILED:
            kept = f'{progress.waiting} kept in memory: {progress.error}; check output_directory'
            text = f'recording failed{lost}, {kept}'
        else:
            none_yet = f'{progress.directory}, where the first input makes a file'
            text = f'recording to {progress.path or none_yet}'
            if self.state is RecordingState.OFF:
                text = 'not recording'
            elif self.slow:
                text = f'the disk is slow, {progress.oldest_s:.0f} s are in memory only'
            text += lost if self.lost else ''
        untidy = f'; old recordings cannot be removed: {self.untidy}' if self.untidy else ''
        return f'{text}{untidy}'

    @property
    def slow(self) -> bool:
        """Whether a loss of power would now cost more than it should."""
        return self.progress is not None and self.progress.oldest_s > SLOW_S


class Recorder:
    """
    Writes bags, one after the other; none before an input is heard.

    Parameters
    ----------
    directory
        Where bags are written; made if missing.
    namespace
        Of the node, '' or `/ship`; inputs are recorded below it by their own name,
        whatever topic they were remapped to, so that a replay finds them.
    history_ns
        Length of record that the monitor's words depend on [ns]; a bag begun later
        begins with it.
    limits
        When a recording goes on in a new file.
    keep
        When old files are removed.
    """

    def __init__(
        self,
        directory: Path,
        *,
        namespace: str,
        ship: Ship,
        parameters: Parameters,
        history_ns: int,
        limits: PartLimits = DEFAULT_LIMITS,
        keep: Keep = EVERYTHING,
    ) -> None:
        self._directory = directory.resolve()  # a link made later is not followed
        self._namespace = namespace
        self._attachments = {
            'ship.yaml': ship.to_yaml(),
            'parameters.yaml': parameters.to_yaml(),
        }
        self._limits = limits
        self._ring = RawRing(history_ns + MARGIN_NS)
        self._recording: DurableRecording | None = None
        self._ended: list[DurableRecording] = []
        self._lost = 0  # by recordings that are no longer kept
        self._housekeeping = Housekeeping(self._directory, keep)

    def start(self) -> None:
        """
        Begin a recording with the latest messages before now; no effect during one.
        """
        if self._recording is None:
            self._begin().wait_begun(BEGIN_S)

    def stop(self) -> None:
        """
        End the recording without waiting for it; no effect while there is none.
        """
        if self._recording is not None:
            self._recording.stop()
            for recording in [it for it in self._ended if it.wait_ended(0)]:
                self._lost += recording.progress().lost
                self._ended.remove(recording)
            self._ended.append(self._recording)
            self._recording = None

    def close(self) -> None:
        """
        End the recording and wait for the disk, a few seconds at most.
        """
        self.stop()
        self._housekeeping.close()
        end_s = monotonic() + CLOSE_S
        for recording in self._ended:
            recording.wait_ended(max(end_s - monotonic(), 0.0))

    def new_part(self) -> None:
        """
        Go on in a new bag, if recording.
        """
        if self._recording is not None:
            self.stop()
            self._begin()

    def forget(self) -> None:
        """
        Drop what a later recording would begin with.
        """
        self._ring.clear()

    def input(self, message: EncodedMessage) -> None:
        """
        Take a message as received, on a topic of the namespace.
        """
        self._keep(message._replace(topic=f'{self._namespace}/{message.topic}'))

    def request(self, message: OutputMessage, receive_ns: int) -> None:
        """
        Take a message of the node that a replay obeys, as it does an input; it makes a file too.
        """
        self._keep(_caused(message, receive_ns))

    def output(self, message: OutputMessage, receive_ns: int) -> None:
        """
        Take a message of the node, caused by what arrived at `receive_ns`.
        """
        if self._recording is not None:
            self._recording.put(_caused(message, receive_ns), begins=False)

    def _keep(self, message: EncodedMessage) -> None:
        self._ring.add(message)
        if self._recording is not None:
            self._recording.put(message)

    def removed(self) -> list[Removed]:
        """
        Return what was removed since the last time, for want of room or by age.
        """
        return self._housekeeping.removed()

    def status(self) -> RecordingStatus:
        """
        Return how the recording stands.
        """
        recordings = [*self._ended, *filter(None, [self._recording])]
        progresses = [it.progress() for it in recordings]
        progress = progresses[-1] if progresses else None
        lost = self._lost + sum(it.lost for it in progresses)
        if progress is not None and progress.error:
            state = RecordingState.FAILED
        else:
            state = RecordingState.OFF if self._recording is None else RecordingState.RECORDING
        kept = self._housekeeping
        return RecordingStatus(state, progress, lost, self._ring.cut, kept.text, kept.problem)

    def _begin(self) -> DurableRecording:
        stamp = datetime.now(UTC).strftime('%Y%m%dT%H%M%SZ')
        self._recording = DurableRecording(
            self._directory,
            stem=f'coastdown_{stamp}',
            attachments=self._attachments,
            limits=self._limits,
            earlier=iter(self._ring),
        )
        return self._recording


def _caused(message: OutputMessage, receive_ns: int) -> EncodedMessage:
    return EncodedMessage(
        message.topic, message.type, message.payload, receive_ns, message.stamp_ns
    )
