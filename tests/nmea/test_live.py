# SPDX-License-Identifier: Apache-2.0
"""Real sockets on loopback, and a pseudo-terminal as a serial line."""

from __future__ import annotations

import os
import pty
import socket
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.nmea import live
from shipdrag_ros.nmea.live import (
    LINE_BYTES,
    Address,
    LineSplitter,
    LiveNmea,
    SourceCounts,
    parse_addresses,
)

WITHIN_S = 120.0
TEXT = '$HEHDT,90.0,T*18'


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < end, 'not within the time'
        time.sleep(0.01)


@contextmanager
def hearing(*sources: str) -> Iterator[LiveNmea]:
    heard = LiveNmea(parse_addresses(' '.join(sources)), clock_ns=time.time_ns, wake=lambda: None)
    heard.start()
    try:
        yield heard
    finally:
        heard.close()


def counts(heard: LiveNmea) -> SourceCounts:
    (found,) = heard.counts().values()
    return found


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


@contextmanager
def to_udp(heard: LiveNmea, port: int) -> Iterator[Callable[[bytes], object]]:
    until(lambda: not counts(heard).problem)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(('127.0.0.1', port))
        yield sender.send


def test_udp_lines_in_their_order() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with hearing(f'udp://127.0.0.1:{port}') as heard, to_udp(heard, port) as send:
        for number in range(50):
            send(f'$A,{number}\r\n$B,{number}'.encode())  # the last end may be left out
        send(b'')
        until(lambda: heard.waiting == 100)
        taken = heard.take(60) + heard.take(60)
    assert [line.text for line in taken] == [f'${k},{n}' for n in range(50) for k in 'AB']
    assert all(a.read_ns <= b.read_ns for a, b in pairwise(taken))
    assert 0 <= time.time_ns() - taken[-1].read_ns < WITHIN_S * 1e9


def test_a_multicast_group_is_joined() -> None:
    group, port = '239.192.0.1', free_port(socket.SOCK_DGRAM)
    with (
        hearing(f'udp://{group}:{port}@127.0.0.1') as heard,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        until(lambda: not counts(heard).problem)
        interface = socket.inet_aton('127.0.0.1')
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        # as IEC 61162-450 has it
        sender.sendto(b'UdPbC\0\\s:HE0001*1C\\$HEHDT,90.0,T*18\r\n', (group, port))
        until(lambda: heard.waiting)
        assert heard.take(2)[0].text.endswith(TEXT)
        assert counts(heard).binary == 0


def test_a_group_that_cannot_be_joined_says_where() -> None:
    with hearing('udp://239.192.0.1:60001@192.0.2.1') as heard:  # no interface of this computer
        until(lambda: 'cannot be joined on interface 192.0.2.1' in counts(heard).problem)
        assert 'udp://239.192.0.1:60001@ADDRESS' in counts(heard).problem


def test_a_flood_is_slowed_and_what_finds_no_room_is_counted(monkeypatch) -> None:
    monkeypatch.setattr(live, 'WAITING_LINES', 40)
    monkeypatch.setattr(live, 'BURST_LINES', 50.0)
    port = free_port(socket.SOCK_DGRAM)
    with hearing(f'udp://127.0.0.1:{port}') as heard, to_udp(heard, port) as send:
        sent = 0
        end = time.monotonic() + WITHIN_S
        while not (counts(heard).flooded and heard.lost and counts(heard).dropped):
            assert time.monotonic() < end, counts(heard)
            send(TEXT.encode())
            sent += 1
        assert heard.waiting == 40
        # each that arrived waits, found no room, or was dropped by the system
        assert 40 < counts(heard).lines + counts(heard).dropped <= sent


def test_tcp_is_opened_again_when_it_drops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, '_RETRY_S', (0.05,))
    port = free_port(socket.SOCK_STREAM)
    with hearing(f'tcp://127.0.0.1:{port}') as heard:
        until(lambda: 'refused' in counts(heard).problem)
        with socket.create_server(('127.0.0.1', port)) as server:
            for times in (1, 2):
                line, _ = server.accept()
                with line:
                    line.sendall(TEXT.encode()[:5])
                    until(lambda times=times: counts(heard).opened == times)
                    assert counts(heard).problem == ''
                    line.sendall(TEXT.encode()[5:] + b'\n$HALF')
                    until(lambda: heard.waiting)
                    assert [it.text for it in heard.take(10)] == [TEXT]
                until(lambda: counts(heard).problem)
                assert 'closed the connection' in counts(heard).problem
                # what the end cut off is handed on, to be recorded and counted
                assert [it.text for it in heard.take(10)] == ['$HALF']
        assert counts(heard).lines == 4


def test_a_tcp_peer_that_vanished_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, 'SILENT_S', 0.3)
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = server.getsockname()[1]
        with hearing(f'tcp://127.0.0.1:{port}') as heard:
            until(lambda: counts(heard).opened >= 2)


def test_serial_line_and_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, '_RETRY_S', (0.05,))
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    device = os.ttyname(theirs)
    with hearing(f'serial:{device}:4800') as heard:
        until(lambda: not counts(heard).problem)
        os.write(ours, TEXT.encode() + b'\r\n\xff\xfe\r\n')
        until(lambda: heard.waiting and counts(heard).binary)
        assert [it.text for it in heard.take(10)] == [TEXT]
        os.close(theirs)
        os.close(ours)
        until(lambda: counts(heard).problem)


@pytest.mark.parametrize('host', ['a..b', 'a' * 70 + '.example'])
def test_a_name_that_is_none_is_said_and_tried_again(host: str) -> None:
    with hearing(f'tcp://{host}:10110') as heard:
        until(lambda: 'again' in counts(heard).problem)
        assert 'label' in counts(heard).problem


def test_what_is_no_serial_device_is_said(tmp_path: Path) -> None:
    path = tmp_path / 'fifo'
    os.mkfifo(path)
    with hearing(f'serial:{path}:4800') as heard:
        until(lambda: 'no serial device' in counts(heard).problem)


def test_each_form() -> None:
    found = parse_addresses(
        'udp://0.0.0.0:10110 tcp://mux.local:2000 tcp://[::1]:2000 serial:/dev/ttyUSB0:4800 '
        'udp://0.0.0.0:10110'
    )
    assert [(each.way, each.place, each.number) for each in found] == [
        ('udp', '0.0.0.0', 10110),
        ('tcp', 'mux.local', 2000),
        ('tcp', '::1', 2000),
        ('serial', '/dev/ttyUSB0', 4800),
    ]
    assert str(found[0]) == 'udp://0.0.0.0:10110'
    assert parse_addresses('') == ()


@pytest.mark.parametrize(
    'text',
    [
        'udp://127.0.0.1:1@127.0.0.1',
        'udp://239.192.0.1:1@999.0.0.1',
        'udp://:1',
        'udp://a',
        'udp://a:0',
        'tcp://a:65536',
        'serial:ttyUSB0:4800',
        'http://a:1',
    ],
)
def test_what_is_no_address_says_what_is(text: str) -> None:
    with pytest.raises(ShipdragError, match='expected'):
        Address.parse(text)


def test_a_group_may_name_its_interface() -> None:
    group, one, other = parse_addresses(
        'udp://239.192.0.1:60001@127.0.0.1 udp://224.0.0.1:1 udp://10.0.0.1:1'
    )
    assert group.is_multicast
    assert (group.place, group.number, group.interface) == ('239.192.0.1', 60001, '127.0.0.1')
    assert str(group) == 'udp://239.192.0.1:60001@127.0.0.1'
    assert one.is_multicast
    assert not other.is_multicast
    with pytest.raises(ShipdragError, match='groups of IPv6 are not joined'):
        Address.parse('udp://[ff02::1]:60001')


def test_lines_by_any_end() -> None:
    splitter = LineSplitter()
    assert splitter.feed(b'$A\r\n$B\n$C\r\r\n  \n$D') == ['$A', '$B', '$C']
    assert splitter.feed(b'1\n') == ['$D1']
    assert splitter.feed(b'$E') == []
    assert splitter.end() == ['$E']
    assert splitter.end() == []
    assert splitter.feed(b'$F\n') == ['$F']  # the next datagram, or connection


def test_a_line_that_is_skipped_ends_with_its_datagram() -> None:
    splitter = LineSplitter()
    assert splitter.feed(b'x' * (LINE_BYTES + 1)) == []
    assert splitter.end() == []
    assert splitter.feed(b'$A\n') == ['$A']


def test_what_is_no_text_is_counted() -> None:
    splitter = LineSplitter()
    assert splitter.feed(b'\x00\xff\n$A\n\xe9t\xe9\n') == ['$A']
    assert splitter.binary == 2


def test_an_endless_line_takes_no_memory() -> None:
    splitter = LineSplitter()
    for _ in range(1000):
        assert splitter.feed(b'x' * 4096) == []
        assert len(splitter._open) <= LINE_BYTES
    assert splitter.too_long == 1
    assert splitter.feed(b'tail\n$A\n') == ['$A']
    assert splitter.feed(b'y' * (LINE_BYTES + 1) + b'\n$B\n') == ['$B']
    assert splitter.too_long == 2


@given(st.binary(max_size=3000), st.lists(st.integers(1, 700), max_size=20))
def test_the_cut_does_not_matter(data: bytes, sizes: list[int]) -> None:
    whole, pieces = LineSplitter(), LineSplitter()
    expected = whole.feed(data) + whole.end()
    found = []
    for size in sizes:
        found += pieces.feed(data[:size])
        data = data[size:]
    found += pieces.feed(data) + pieces.end()
    assert found == expected
    assert (pieces.too_long, pieces.binary) == (whole.too_long, whole.binary)
