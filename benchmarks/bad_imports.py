# SPDX-License-Identifier: Apache-2.0
"""
Damaged logs of every format: never a traceback, a hang, a blow-up or a wrong value.

    python benchmarks/bad_imports.py [--count 10000] [--seed 17] [--only KIND] [--write]

Each file of `_log_samples.py` is damaged: bytes flipped, lines cut, swapped, doubled
or left out, fields swapped, the end cut off. What is read of it is held against what
is read of the whole file: a value that stands nowhere in the whole file must come from
a line that was touched. With `--write` the table goes into docs/results/import.txt.
"""

from __future__ import annotations

import argparse
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from _log_samples import TEXTS, samples

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.samples import Block
from shipdrag_ros.sources.reading import read_any

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'results' / 'import.txt'
BEGIN, END = '<!-- bad_imports begin -->', '<!-- bad_imports end -->'
LIMIT_S = 20
MEMORY_MB = 300
PER_LINE = 8  # values of one line at most
HEAD_LINES = 5  # of a table: its names and units decide about all lines

Value = tuple[int, float, float]


@dataclass
class Tally:
    """What became of the damaged files of a kind."""

    read: int = 0
    refused: int = 0
    defects: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    slowest_s: float = 0.0


class Hang(Exception):
    """Reading took too long."""


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


def _too_long(*_: object) -> None:
    raise Hang


def check(kind: str, name: str, data: bytes, *, count: int, seed: int, folder: Path) -> Tally:
    """Damage a file many times and read it."""
    draw = random.Random(f'{kind} {seed}')
    path = folder / name
    path.write_bytes(data)
    whole = values_of(path)
    text = kind in TEXTS
    above = HEAD_LINES if kind.startswith('csv') or kind == 'gpx' else 0
    tally = Tally()
    signal.signal(signal.SIGALRM, _too_long)
    for number in range(count):
        made, touched = damaged_text(data, draw, above) if text else (damaged_bytes(data, draw), 0)
        path.write_bytes(made)
        started = time.perf_counter()
        signal.alarm(LIMIT_S)
        try:
            found = values_of(path)
        except (ShipdragError, OSError):
            tally.refused += 1
        except Hang:
            tally.defects.append(f'{number}: more than {LIMIT_S} s')
        except BaseException as error:  # what this looks for
            tally.defects.append(f'{number}: {type(error).__name__}: {error}')
        else:
            tally.read += 1
            new = sum((found - whole).values())
            if text and new > PER_LINE * touched:
                tally.wrong.append(f'{number}: {new} new values of {touched} touched lines')
        finally:
            signal.alarm(0)
        tally.slowest_s = max(tally.slowest_s, time.perf_counter() - started)
        if tally.defects and len(tally.defects) > 5:
            break
    return tally


def main() -> int:
    """Damage the files of every format and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=10_000, help='damaged files of each format')
    parser.add_argument('--seed', type=int, default=17)
    parser.add_argument('--only', action='append')
    parser.add_argument('--write', action='store_true', help=f'put the table into {PAGE.name}')
    options = parser.parse_args()
    before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    lines = [
        '| format | damaged files | read | refused | tracebacks, hangs | wrong values '
        '| slowest [s] |',
        '|---|---|---|---|---|---|---|',
    ]
    failed = 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for kind, (name, data) in samples(folder).items():
            if options.only and kind not in options.only:
                continue
            found = check(kind, name, data, count=options.count, seed=options.seed, folder=folder)
            failed += len(found.defects) + len(found.wrong)
            wrong = len(found.wrong) if kind in TEXTS else '-'
            lines.append(
                f'| {kind} | {found.read + found.refused + len(found.defects)} | {found.read} | '
                f'{found.refused} | {len(found.defects)} | {wrong} | {found.slowest_s:.2f} |'
            )
            print(lines[-1], *found.defects[:5], *found.wrong[:5], sep='\n   ', flush=True)
    grown_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before_mb
    lines += ['', f'Seed {options.seed}; memory grew by {grown_mb:.0f} MB.']
    print('\n'.join(lines))
    if options.write:
        before, _, rest = PAGE.read_text(encoding='utf-8').partition(BEGIN)
        after = rest.partition(END)[2]
        made = '\n'.join([BEGIN, *lines, END])
        PAGE.write_text(f'{before}{made}{after}', encoding='utf-8')
    return 1 if failed or grown_mb > MEMORY_MB else 0


if __name__ == '__main__':
    sys.exit(main())
