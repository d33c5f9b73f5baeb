# SPDX-License-Identifier: Apache-2.0
"""
Sources of NMEA 0183: as a user writes them, and received, each in a thread of its own.

A line that drops is opened again and again, and said. What comes in is bounded:
bytes of a line, lines a second, lines that wait. Nobody outside can fill the memory.
"""

from __future__ import annotations

import ipaddress
import os
import re
import socket
import stat
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import NamedTuple

from shipdrag_ros.errors import ShipdragError, reason_of

FORMS = 'udp://ADDRESS:PORT, tcp://HOST:PORT or serial:DEVICE:BAUD'
_NET = re.compile(r'(udp|tcp)://(\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+):(\d{1,5})(?:@([\d.]+))?')
_SERIAL = re.compile(r'serial:(/\S+):(\d{3,7})')


@dataclass(frozen=True)
class Address:
    """
    One source of NMEA 0183.

    Attributes
    ----------
    way
        How the bytes arrive: udp, tcp or serial.
    place
        Address to hear on (UDP), host to connect to (TCP), or path of a serial device.
    number
        Port, or rate of the serial line [baud].
    text
        As the user gave it.
    interface
        Address of the interface on which a multicast group is joined, '' for the one that the
        system chooses.
    """

    way: str
    place: str
    number: int
    text: str
    interface: str = ''

    @property
    def is_multicast(self) -> bool:
        """Whether datagrams come to a group, which is to be joined."""
        return self.way == 'udp' and _is_multicast(self.place)

    def __str__(self) -> str:
        return self.text

    @classmethod
    def parse(cls, text: str) -> Address:
        """
        Read an address such as `udp://0.0.0.0:10110` or `serial:/dev/ttyUSB0:4800`.

        Parameters
        ----------
        text
            In one of `FORMS`; an IPv6 address stands in square brackets. Behind a multicast
            group may follow the interface that joins it, `udp://239.192.0.1:60001@10.0.0.5`.

        Raises
        ------
        ShipdragError
            If it has none of the forms, the port is not 1 to 65535, or the interface is none.

        Examples
        --------
        >>> from shipdrag_ros.nmea.live import Address
        >>> Address.parse('udp://0.0.0.0:10110').number
        10110
        """
        if found := _NET.fullmatch(text):
            if not 0 < int(found[3]) < 65536:
                raise ShipdragError(f'NMEA source {text!r}: port {found[3]}, expected 1 to 65535')
            address = cls(found[1], found[2].strip('[]'), int(found[3]), text, found[4] or '')
            address._check_group()
            return address
        if found := _SERIAL.fullmatch(text):
            return cls('serial', found[1], int(found[2]), text)
        raise ShipdragError(f'NMEA source {text!r}: expected {FORMS}')

    def _check_group(self) -> None:
        if self.is_multicast and ':' in self.place:
            raise ShipdragError(
                f'NMEA source {self.text!r}: groups of IPv6 are not joined; give one of IPv4, '
                '224.0.0.0 to 239.255.255.255'
            )
        if not self.interface:
            return
        if not self.is_multicast:
            raise ShipdragError(
                f'NMEA source {self.text!r}: no interface is expected but for a multicast '
                'group, udp://224.0.0.0 to 239.255.255.255'
            )
        try:
            ipaddress.IPv4Address(self.interface)
        except ValueError as error:
            raise ShipdragError(
                f'NMEA source {self.text!r}: interface {self.interface!r}, expected the IPv4 '
                'address of one of this computer'
            ) from error


def _is_multicast(place: str) -> bool:
    try:
        return ipaddress.ip_address(place).is_multicast
    except ValueError:  # a name
        return False


def parse_addresses(text: str) -> tuple[Address, ...]:
    """
    Read addresses separated by blanks; one given twice counts once.

    Raises
    ------
    ShipdragError
        If one has none of the forms.
    """
    return tuple(Address.parse(each) for each in dict.fromkeys(text.split()))


LINES_A_SECOND = 1000.0  # a serial line of 38400 baud brings about 60
BURST_LINES = 2000.0
SILENT_S = 60.0  # a TCP peer that vanished without a word is found so
_WAKE_S = 0.25  # how often a wait looks whether it shall end
_CONNECT_S = 5.0
_RETRY_S = (0.5, 1.0, 2.0, 5.0)
_READ_BYTES = 4096
_IEC_61162_450 = b'UdPbC\0'  # stands before the sentences of a datagram
_SO_RXQ_OVFL = 40  # Linux: the kernel says how many datagrams it dropped

# lines that arrived together
Deliver = Callable[[Address, list[str]], None]
# raises TimeoutError where nothing came for a while
Read = Callable[[], bytes]
LINE_BYTES = 512
"""A sentence has 82 characters; one with a TAG block, or of a careless maker, has more."""

_ENDS = re.compile(rb'[\r\n]+')
_PLAIN = re.compile(rb'[\x20-\x7e]+')


class LineSplitter:
    """
    Cuts a stream of bytes into lines.

    Attributes
    ----------
    too_long
        Lines longer than `LINE_BYTES`; all of such a line is dropped.
    binary
        Lines with anything but printable ASCII.
    """

    def __init__(self) -> None:
        self.too_long = 0
        self.binary = 0
        self._open = b''
        self._skipping = False

    def feed(self, data: bytes) -> list[str]:
        """Return the lines that have ended, without their ends; blank ones are left out."""
        *ended, rest = _ENDS.split(data)
        lines = []
        for piece in ended:
            line, self._open = self._open + piece, b''
            skipping, self._skipping = self._skipping, False
            if not skipping:
                lines += self._line(line)
        if not self._skipping:
            self._open += rest
            if len(self._open) > LINE_BYTES:
                self.too_long += 1
                self._open, self._skipping = b'', True
        return lines

    def end(self) -> list[str]:
        """Take what is open as a line: the datagram, or the connection, has ended."""
        return self.feed(b'\n')

    def _line(self, line: bytes) -> list[str]:
        if len(line) > LINE_BYTES:
            self.too_long += 1
        elif line and not _PLAIN.fullmatch(line):
            self.binary += 1
        elif text := line.decode('ascii').strip():
            return [text]
        return []


@dataclass
class SourceCounts:
    """
    What became of one source so far.

    Attributes
    ----------
    problem
        Why nothing can be heard now; '' if the line is open.
    opened
        Times that it was opened.
    lines
        Handed on.
    too_long, binary
        See `LineSplitter`.
    flooded
        Waits because more came than `LINES_A_SECOND`.
    dropped
        Datagrams that the kernel dropped meanwhile.
    """

    problem: str = 'not opened yet'
    opened: int = 0
    lines: int = 0
    too_long: int = 0
    binary: int = 0
    flooded: int = 0
    dropped: int = 0
    last_s: float | None = None

    @property
    def age_s(self) -> float | None:
        """Time since the last line [s], None before the first."""
        return None if self.last_s is None else monotonic() - self.last_s


class LineListener:
    """
    Hears one source from `start` to `close`.

    Parameters
    ----------
    address
        Where.
    deliver
        Called in the thread with lines that arrived together.

    Attributes
    ----------
    counts
        What became of it.
    """

    def __init__(self, address: Address, deliver: Deliver) -> None:
        self.address = address
        self.counts = SourceCounts()
        self._deliver = deliver
        self._closing = threading.Event()
        self._splitter = LineSplitter()
        self._budget = BURST_LINES
        self._budget_s = monotonic()
        self._thread = threading.Thread(target=self._run, name=f'nmea {address}', daemon=True)

    def start(self) -> None:
        """Begin to hear; returns at once."""
        self._thread.start()

    def stop(self) -> None:
        """Ask for the end."""
        self._closing.set()

    def close(self) -> None:
        """End, and wait for it a second at most."""
        self.stop()
        self._thread.join(1.0)

    def _run(self) -> None:
        failures = 0
        while not self._closing.is_set():
            opened = self.counts.opened
            try:
                with _OPENERS[self.address.way](self.address, self.counts) as read:
                    self.counts.opened += 1
                    self.counts.problem = ''
                    self._hear(read)
                why = 'the other side closed the connection'
            except Exception as error:  # a thread that ends unseen would not be tried again
                why = reason_of(error)
            failures = 0 if self.counts.opened > opened else failures + 1
            self.counts.problem = f'{why}; opened again and again until it works'
            self._closing.wait(_RETRY_S[min(failures, len(_RETRY_S) - 1)])

    def _hear(self, read: Read) -> None:
        """Read until the other side ends it."""
        heard_s = monotonic()
        try:
            while not self._closing.is_set():
                try:
                    data = read()
                except TimeoutError:
                    if self.address.way == 'tcp' and monotonic() - heard_s > SILENT_S:
                        raise OSError(0, f'nothing came for {SILENT_S:.0f} s') from None
                    continue
                heard_s = monotonic()
                lines = self._splitter.feed(data)
                if self.address.way == 'udp':  # a datagram is whole
                    lines += self._splitter.end()
                self._take(lines)
                if not data and self.address.way != 'udp':
                    return
                self._slow_down(max(len(lines), len(data) / 80.0))
        finally:  # a line that the end cut is recorded, and counted as what it is
            self._take(self._splitter.end())

    def _take(self, lines: list[str]) -> None:
        self.counts.too_long = self._splitter.too_long
        self.counts.binary = self._splitter.binary
        if lines:
            self.counts.lines += len(lines)
            self.counts.last_s = monotonic()
            self._deliver(self.address, lines)

    def _slow_down(self, lines: float) -> None:
        """Read no faster than any ship's instruments talk, so that a flood takes no core."""
        now_s = monotonic()
        refilled = self._budget + (now_s - self._budget_s) * LINES_A_SECOND
        self._budget = min(refilled, BURST_LINES) - lines
        self._budget_s = now_s
        if self._budget < 0.0:
            self.counts.flooded += 1
            self._closing.wait(-self._budget / LINES_A_SECOND)


@contextmanager
def _udp(address: Address, counts: SourceCounts) -> Iterator[Read]:
    family, _, _, _, where = socket.getaddrinfo(
        address.place, address.number, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
    )[0]
    dropped_before = counts.dropped
    with socket.socket(family, socket.SOCK_DGRAM) as heard:
        heard.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        if address.is_multicast:
            heard.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # others may hear it too
        heard.bind(where)
        if address.is_multicast:
            _join(heard, address)
        heard.settimeout(_WAKE_S)

        def read() -> bytes:
            data, extra, _, _ = heard.recvmsg(65536, 64)
            for level, kind, value in extra:
                if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                    counts.dropped = dropped_before + struct.unpack('=I', value[:4])[0]
            return data.removeprefix(_IEC_61162_450)

        yield read


def _join(heard: socket.socket, address: Address) -> None:
    interface = address.interface or '0.0.0.0'
    group = socket.inet_aton(address.place) + socket.inet_aton(interface)
    try:
        heard.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    except OSError as error:
        raise OSError(
            error.errno,
            f'the group cannot be joined on interface {interface} ({error.strerror}); name one '
            f'by its address, {address.text.partition("@")[0]}@ADDRESS',
        ) from error


@contextmanager
def _tcp(address: Address, counts: SourceCounts) -> Iterator[Read]:
    where = (address.place, address.number)
    with socket.create_connection(where, timeout=_CONNECT_S) as line:
        line.settimeout(_WAKE_S)
        yield partial(line.recv, _READ_BYTES)


@contextmanager
def _serial(address: Address, counts: SourceCounts) -> Iterator[Read]:
    import serial  # which few ships need

    if not stat.S_ISCHR(os.stat(address.place).st_mode):
        raise OSError(0, f'{address.place!r} is no serial device')
    with serial.Serial(address.place, address.number, timeout=_WAKE_S, exclusive=True) as line:

        def read() -> bytes:
            if data := line.read(min(line.in_waiting or 1, _READ_BYTES)):
                return bytes(data)
            raise TimeoutError

        yield read


_OPENERS = {'udp': _udp, 'tcp': _tcp, 'serial': _serial}


WAITING_LINES = 8000
"""That wait to be taken; what finds no room is counted."""


class Line(NamedTuple):
    """A line, where it was heard and when it was read [ns since the epoch]."""

    address: Address
    text: str
    read_ns: int


class LiveNmea:
    """
    Hears sources in threads, from `start` to `close`.

    Parameters
    ----------
    addresses
        Where to hear.
    clock_ns
        The clock that lines are stamped by [ns since the epoch].
    wake
        Called in a thread when there is something to take.

    Attributes
    ----------
    lost
        Lines that found no room among those that wait.
    """

    def __init__(
        self,
        addresses: Sequence[Address],
        *,
        clock_ns: Callable[[], int],
        wake: Callable[[], None],
    ) -> None:
        self.lost = 0
        self._clock_ns = clock_ns
        self._wake = wake
        self._waiting: deque[Line] = deque()
        self._lock = threading.Lock()
        self._listeners = [LineListener(address, self._deliver) for address in addresses]

    def start(self) -> None:
        """Begin to hear; a source that cannot be opened is tried again and said."""
        for listener in self._listeners:
            listener.start()

    def close(self) -> None:
        """End all threads."""
        for listener in self._listeners:
            listener.stop()
        for listener in self._listeners:
            listener.close()

    def take(self, most: int) -> list[Line]:
        """Return the oldest lines that wait, at most so many."""
        with self._lock:
            return [self._waiting.popleft() for _ in range(min(most, len(self._waiting)))]

    @property
    def waiting(self) -> int:
        """Lines that can be taken."""
        return len(self._waiting)

    def counts(self) -> Mapping[Address, SourceCounts]:
        """Return what became of each source."""
        return {listener.address: listener.counts for listener in self._listeners}

    def _deliver(self, address: Address, lines: list[str]) -> None:
        with self._lock:
            # in the lock, so that lines stand in the order of their times
            read_ns = self._clock_ns()
            room = WAITING_LINES - len(self._waiting)
            self._waiting.extend(Line(address, text, read_ns) for text in lines[:room])
            self.lost += max(len(lines) - room, 0)
        self._wake()
