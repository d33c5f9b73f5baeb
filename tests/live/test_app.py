# SPDX-License-Identifier: Apache-2.0
"""Frames: whoever reads, however slowly, ends with the picture as it is."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.display import json_text
from shipdrag_ros.live.app import HISTORY, KEPT, Frames


def events(data: bytes) -> list[tuple[str, dict[str, Any]]]:
    """What a browser makes of a stream."""
    found = []
    for block in data.decode().split('\n\n')[:-1]:
        kind, _, body = block.split('\n')
        found.append((kind.removeprefix('event: '), json.loads(body.removeprefix('data: '))))
    return found


class Reader:
    """Keeps a picture as the page does."""

    def __init__(self) -> None:
        self.seen: int | None = None
        self.parts: dict[str, Any] = {}
        self.rows: list[Any] = []

    def read(self, frames: Frames) -> None:
        self.seen, data = frames.after(self.seen)
        for kind, body in events(data):
            rows = body.pop(HISTORY, [])
            self.rows = rows if kind == 'whole' else [*self.rows, *rows]
            self.parts |= body


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans(), st.booleans()), max_size=200))
def test_a_reader_who_reads_at_any_time_has_the_picture(steps):
    rows: list[list[int]] = []
    frames = Frames(lambda: rows)
    reader, slow = Reader(), Reader()
    for number, (value, anew, reads) in enumerate(steps):
        if anew:
            rows.clear()
        rows.append([number])
        frames.add({'value': value, 'same': 1}, [[number]], anew=anew)
        if reads:
            reader.read(frames)
            assert reader.parts == {'value': value, 'same': 1}
            assert reader.rows == rows
    slow.read(frames)
    assert slow.rows == rows


def test_one_who_is_behind_gets_the_whole_once_and_it_is_counted() -> None:
    frames = Frames(list)
    reader = Reader()
    frames.add({'value': 0}, [])
    reader.read(frames)
    for value in range(1, 3 * KEPT):
        frames.add({'value': value}, [])
    _, data = frames.after(reader.seen)
    assert [kind for kind, _ in events(data)] == ['whole']
    assert frames.dropped == 3 * KEPT - 1
    assert len(data) < 200  # not one byte for what was missed


def test_nothing_new_is_no_frame_and_what_is_not_finite_is_null() -> None:
    frames = Frames(list)
    frames.add({'value': float('nan')}, [])
    frames.add({'value': float('nan')}, [])
    assert frames.number == 1
    assert json.loads(json_text({'a': [float('inf'), 1.5]}, indent=None)) == {'a': [None, 1.5]}
