# SPDX-License-Identifier: Apache-2.0
"""
Recording while the node runs: what came in, what went out, in that order.

A disk that fills up must not stop the estimates: it is reported, and what was
not written is counted.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from itertools import chain, count
from pathlib import Path

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import OutputMessage
from shipdrag_ros.node.ring import RawMessage, RawRing
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

# the ring is cut by arrival, the monitor's memory by stamps
MARGIN_NS = 600_000_000_000


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
    path
        File of this or of the last recording, None before the first.
    messages, size_bytes
        Written to it; bytes as on the disk now.
    lost
        Messages not written since it failed.
    error
        Why it failed, '' if it did not.
    ring_cut
        Whether memory was too small to keep all that a recording started now should
        begin with; its replay may then differ from the live figures at first.
    """

    state: RecordingState
    path: Path | None
    messages: int
    size_bytes: int
    lost: int
    error: str
    ring_cut: bool

    @property
    def text(self) -> str:
        """One line for a log or for an operator."""
        match self.state:
            case RecordingState.OFF:
                return 'not recording'
            case RecordingState.RECORDING:
                return f'recording to {self.path}'
            case RecordingState.FAILED:
                return f'recording failed, {self.lost} message(s) not written: {self.error}'


class Recorder:
    """
    Writes bags, one after the other.

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
    """

    def __init__(
        self,
        directory: Path,
        *,
        namespace: str,
        ship: Ship,
        parameters: Parameters,
        history_ns: int,
    ) -> None:
        self._directory = directory
        self._namespace = namespace
        self._ship = ship
        self._parameters = parameters
        self._ring = RawRing(history_ns + MARGIN_NS)
        self._writer: BagWriter | None = None
        self._path: Path | None = None
        self._messages = 0
        self._lost = 0
        self._error = ''

    def start(self) -> None:
        """
        Begin a bag with the latest messages before now; no effect while recording.
        """
        if self._writer is not None:
            return
        self._messages = self._lost = 0
        self._error = ''
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            self._path = self._free_path()
            self._writer = BagWriter(self._path)
            self._writer.attach('ship.yaml', self._ship.to_yaml())
            self._writer.attach('parameters.yaml', self._parameters.to_yaml())
        except (OSError, BagError) as error:
            self._fail(error)
        for message in self._ring:
            self._write_input(message)

    def stop(self) -> None:
        """
        Close the bag; no effect while there is none.
        """
        writer, self._writer = self._writer, None
        self._error = ''
        if writer is not None:
            try:
                writer.close()
            except (OSError, BagError) as error:
                self._fail(error)

    def new_part(self) -> None:
        """
        Go on in a new bag, if recording.
        """
        if self._writer is not None:
            self.stop()
            self.start()

    def forget(self) -> None:
        """
        Drop what a later recording would begin with.
        """
        self._ring.clear()

    def input(self, message: RawMessage) -> None:
        """
        Take a message as received.
        """
        self._ring.add(message)
        self._write_input(message)

    def output(self, message: OutputMessage, receive_ns: int) -> None:
        """
        Take a message of the node, caused by what arrived at `receive_ns`.
        """
        self._write(message.topic, message.type, message.payload, receive_ns, message.stamp_ns)

    def status(self) -> RecordingStatus:
        """
        Return how the recording stands.
        """
        if self._error:
            state = RecordingState.FAILED
        else:
            state = RecordingState.OFF if self._writer is None else RecordingState.RECORDING
        size = 0
        if self._path is not None and self._path.exists():
            size = self._path.stat().st_size
        return RecordingStatus(
            state, self._path, self._messages, size, self._lost, self._error, self._ring.cut
        )

    def _write_input(self, message: RawMessage) -> None:
        topic = f'{self._namespace}/{message.input}'
        self._write(topic, message.type, message.data, message.receive_ns, message.stamp_ns)

    def _write(self, topic: str, type_name: str, data: bytes, log_ns: int, stamp_ns: int) -> None:
        if self._error:
            self._lost += 1
        if self._writer is None:
            return
        try:
            self._writer.write(topic, type_name, data, log_ns=log_ns, publish_ns=stamp_ns)
        except (OSError, BagError) as error:
            self._fail(error)
            self._lost += 1
        else:
            self._messages += 1

    def _fail(self, error: Exception) -> None:
        writer, self._writer = self._writer, None
        self._error = str(error)
        if isinstance(error, OSError) and error.filename is not None:
            self._error = f'{str(error.filename)!r}: {error.strerror}; check output_directory'
        if writer is not None:
            with suppress(OSError, BagError):  # what has been written may still be read
                writer.close()

    def _free_path(self) -> Path:
        stamp = datetime.now(UTC).strftime('%Y%m%dT%H%M%SZ')
        names = chain([f'coastdown_{stamp}'], (f'coastdown_{stamp}_{i}' for i in count(2)))
        return next(
            path
            for path in (self._directory / f'{name}.mcap' for name in names)
            if not path.exists()
        )
