# SPDX-License-Identifier: Apache-2.0
"""Tables that benchmarks write: of pages, and of data to try the verbs on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from shipdrag_ros.samples import Float64


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table.
    """
    lines = [columns, ['---'] * len(columns), *rows]
    return [f'| {" | ".join(map(str, line))} |' for line in lines]


def write_csv(path: Path, columns: Sequence[str], rows: Float64) -> None:
    """
    Write (n, k) numbers to six digits.
    """
    path.parent.mkdir(exist_ok=True)
    lines = [','.join(f'{value:.6g}' for value in row) for row in rows]
    path.write_text('\n'.join([','.join(columns), *lines]) + '\n', encoding='utf-8')
