# SPDX-License-Identifier: Apache-2.0
"""Attacks on the NMEA input, over real sockets of the loopback."""

from __future__ import annotations

import os
import resource
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pynmeagps.nmeahelpers import calc_checksum

from shipdrag_ros.nmea.interpreter import Interpreter
from shipdrag_ros.nmea.live import WAITING_LINES, LiveNmea, parse_addresses
from tests.attacks.attack import Attack, check

GOOD = '$HEHDT,90.0,T*18'
WITHIN_S = 20.0
GROWTH_BYTES = 64 << 20


@contextmanager
def hearing(source: str) -> Iterator[LiveNmea]:
    """Hear one source."""
    live = LiveNmea(parse_addresses(source), clock_ns=time.time_ns, wake=lambda: None)
    live.start()
    try:
        yield live
    finally:
        live.close()


def until(condition: Callable[[], object]) -> None:
    """Wait for what must come."""
    end_s = time.monotonic() + WITHIN_S
    while not condition():
        check(time.monotonic() < end_s, 'it did not go on')
        time.sleep(0.01)


def memory_bytes() -> int:
    """Return the largest memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@contextmanager
def attacked() -> Iterator[tuple[LiveNmea, Callable[[bytes], object]]]:
    """Hear UDP, and afterwards hear whether it still works."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        port = probe.getsockname()[1]
    before = memory_bytes()
    with (
        hearing(f'udp://127.0.0.1:{port}') as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        (counts,) = live.counts().values()
        until(lambda: not counts.problem)
        sender.connect(('127.0.0.1', port))
        yield live, sender.send
        live.take(WAITING_LINES)
        lines = counts.lines

        def heard() -> bool:
            sender.send(GOOD.encode())
            return counts.lines > lines

        until(heard)
    check(memory_bytes() - before < GROWTH_BYTES, 'it took memory')


def endless_line(folder: Path) -> str:
    """Send a line that never ends, over TCP."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        before = memory_bytes()
        with hearing(f'tcp://127.0.0.1:{server.getsockname()[1]}') as live:
            (counts,) = live.counts().values()
            line, _ = server.accept()
            with line:
                for _ in range(300):
                    line.sendall(b'x' * 1000)
                line.sendall(b'\n' + GOOD.encode() + b'\n')
                until(lambda: live.waiting)
            check(live.take(9)[0].text == GOOD, 'the next line was lost')
        check(memory_bytes() - before < GROWTH_BYTES, 'it took memory')
        return f'300 kB dropped, {counts.too_long} line too long; the next line is heard'


def binary(folder: Path) -> str:
    """Send bytes that are no text."""
    with attacked() as (live, send):
        (counts,) = live.counts().values()
        for _ in range(50):
            send(os.urandom(400))
        until(lambda: counts.binary)
        return f'{counts.binary} lines counted as no text, {live.waiting} taken for lines'


def flood(folder: Path) -> str:
    """Send as fast as this machine can, for two seconds."""
    with attacked() as (live, send):
        (counts,) = live.counts().values()
        end_s, sent = time.monotonic() + 2.0, 0
        while time.monotonic() < end_s:
            send(GOOD.encode())
            sent += 1
        until(lambda: counts.flooded)
        check(live.waiting <= WAITING_LINES, 'more wait than there is room for')
        taken, dropped = counts.lines, counts.dropped
    return f'of {sent} lines {taken} taken, {dropped} dropped by the system so far; counted'


def closed_at_once(folder: Path) -> str:
    """Accept the connection and close it, again and again."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(0.2)
        with hearing(f'tcp://127.0.0.1:{server.getsockname()[1]}') as live:
            (counts,) = live.counts().values()
            end_s = time.monotonic() + 3.0
            while time.monotonic() < end_s:
                try:
                    server.accept()[0].close()
                except TimeoutError:
                    continue
            check(counts.opened < 20, 'it connects without pause')
            return f'{counts.opened} connections in 3 s'


def sentences(*contents: str) -> Callable[[Path], str]:
    """Return an attack by sentences whose checksum is right."""

    def run(folder: Path) -> str:
        interpreter = Interpreter()
        found = 0
        for step in range(5):
            for content in contents:
                text = f'${content}*{calc_checksum(content)}'
                found += len(interpreter.messages(text, 'udp', 10**18 + step * 2 * 10**9))
        check(not found, 'it became a reading')
        reasons = {**interpreter.no_value, **interpreter.unknown, **interpreter.rejected}
        return 'no reading: ' + '; '.join(list(reasons)[:3])

    return run


def invented(folder: Path) -> str:
    """Invent sentences, to fill the counters."""
    interpreter = Interpreter()
    for number in range(4096):
        content = f'GP{number:03X}'
        interpreter.messages(f'${content}*{calc_checksum(content)}', 'udp', 10**18)
    check(len(interpreter.unknown) < 100, 'each takes memory')
    return f'4096 kinds in {len(interpreter.unknown)} counters'


def wrong_checksum(folder: Path) -> str:
    """Damage each character of a sentence in turn."""
    interpreter = Interpreter()
    for place in range(1, len(GOOD)):
        for step in range(5):
            text = GOOD[:place] + chr((ord(GOOD[place]) + 1) % 127) + GOOD[place + 1 :]
            found = interpreter.messages(text, 'udp', 10**18 + step * 2 * 10**9)
            check(not found, f'a damaged {text!r} became a reading')
    return f'none used; {dict(interpreter.rejected)}'


def no_serial(folder: Path) -> str:
    """Name a pipe as a serial line."""
    os.mkfifo(folder / 'pipe')
    with hearing(f'serial:{folder / "pipe"}:4800') as live:
        (counts,) = live.counts().values()
        until(lambda: 'no serial' in counts.problem)
        return counts.problem.replace(str(folder), '...').split(';')[0]


ATTACKS = [
    Attack('NMEA', 'a line without end', endless_line),
    Attack('NMEA', 'bytes that are no text', binary),
    Attack('NMEA', 'a flood of datagrams', flood),
    Attack('NMEA', 'a peer that closes at once, always', closed_at_once),
    Attack('NMEA', 'a damaged character', wrong_checksum),
    Attack('NMEA', 'numbers that are none', sentences('IIVHW,,T,,M,nan,N,,K', 'HEHDT,1_0,T')),
    Attack('NMEA', 'positions off the Earth', sentences('GPGGA,1,9959.9,N,18159.9,E,1')),
    Attack('NMEA', 'four thousand invented kinds', invented),
    Attack('NMEA', 'a pipe for a serial line', no_serial),
]
