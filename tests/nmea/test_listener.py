# SPDX-License-Identifier: Apache-2.0
"""Bytes to lines: whatever the cut, whatever a hostile peer sends."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.nmea.live import LINE_BYTES, LineSplitter


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
