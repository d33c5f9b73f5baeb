# SPDX-License-Identifier: Apache-2.0
"""How a log of any format is damaged: bytes, lines, fields, and the end cut off."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

from shipdrag_ros.samples import Block
from shipdrag_ros.sources.reading import read_any
from tests.sources.log_samples import TEXTS as TEXTS
from tests.sources.log_samples import samples as samples

PER_LINE = 8  # values of one line at most
HEAD_LINES = 5  # of a table: its names and units decide about all lines

Value = tuple[int, float, float]


def damaged_text(data: bytes, draw: random.Random, above: int) -> tuple[bytes, int]:
    """Damage a text; return it and how many lines were touched, none of the first ones."""
    lines = data.split(b'\n')
    touched = 0
    for _ in range(draw.choice((1, 1, 2, 5, 20))):
        place = draw.randrange(min(above, len(lines) - 1), len(lines))
        kind = draw.randrange(8)
        line = lines[place]
        if kind == 0 and line:
            at = draw.randrange(len(line))
            lines[place] = line[:at] + bytes((draw.randrange(256),)) + line[at + 1 :]
        elif kind == 1:
            lines[place] = line[: draw.randrange(len(line) + 1)]
        elif kind == 2:
            mark = draw.choice((b',', b';', b' ', b'"'))
            fields = line.split(mark)
            draw.shuffle(fields)
            lines[place] = mark.join(fields)
        elif kind == 3:
            lines.insert(place, line)
        elif kind == 4 and len(lines) > above + 2:
            del lines[place]
        elif kind == 5:
            other = draw.randrange(min(above, len(lines) - 1), len(lines))
            lines[place], lines[other] = lines[other], lines[place]
        elif kind == 6:
            lines[place] = bytes(draw.randrange(256) for _ in range(draw.randrange(200)))
        elif kind == 7 and line:
            at = draw.randrange(len(line))
            lines[place] = line[:at] + draw.choice((b'9', b'-', b'.', b'e9', b'\0')) + line[at:]
        touched += 2
    return b'\n'.join(lines), touched


def damaged_bytes(data: bytes, draw: random.Random) -> bytes:
    """Damage a binary file."""
    made = bytearray(data)
    for _ in range(draw.choice((1, 1, 3, 10, 100))):
        kind = draw.randrange(4)
        at = draw.randrange(max(len(made), 1))
        if kind == 0 and made:
            made[at] = draw.randrange(256)
        elif kind == 1 and made:
            made[at : at + 4] = draw.choice((b'\xff' * 4, bytes(4), b'\xff\xff\xff\x7f'))
        elif kind == 2:
            del made[at : at + draw.randrange(64)]
        elif draw.random() < 0.2:
            del made[at:]
    return bytes(made)


def values_of(path: Path) -> Counter[Value]:
    """Read a file and return its values, whatever their times."""
    (run,) = read_any([path])
    found: Counter[Value] = Counter()
    for part in run.inputs():
        if isinstance(part, Block):
            for channel, (a, b) in zip(part.channel.tolist(), part.value.tolist(), strict=True):
                found[channel, round(a, 9), round(b, 9)] += 1
    return found
