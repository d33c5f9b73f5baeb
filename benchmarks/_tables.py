# SPDX-License-Identifier: Apache-2.0
"""Tables that benchmarks write: of pages, and of data to try the verbs on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import track
from rich.table import Table

from shipdrag_ros.samples import Float64

Item = TypeVar('Item')


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table.
    """
    lines = [columns, ['---'] * len(columns), *rows]
    return [f'| {" | ".join(map(str, line))} |' for line in lines]


def grid(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, width: int, left: int = 1
) -> None:
    """
    Print a table in a frame; the first columns, names, are flush left.
    """
    found = Table(title=title)
    for number, name in enumerate(columns):
        found.add_column(name, justify='left' if number < left else 'right')
    for row in rows:
        found.add_row(*row)
    Console(width=width).print(found)


def along(items: Iterable[Item], what: str, count: int | None = None) -> Iterable[Item]:
    """
    Yield items, and show how far it is.
    """
    return track(items, what, count, console=Console(stderr=True))


def titled(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table under its title.
    """
    return ['', title, '', *table(columns, rows)]


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """
    Return a page with what stands between `<!-- NAME -->` and `<!-- end NAME -->` replaced.

    Raises
    ------
    ValueError
        If the page lacks the markers of a block.
    """
    for name, made in blocks.items():
        begin, end = f'<!-- {name} -->\n', f'\n<!-- end {name} -->'
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not (found and closed):
            raise ValueError(f'no {begin.strip()} .. {end.strip()} on the page')
        text = f'{before}{begin}{made}{end}{after}'
    return text


def put(page: Path, blocks: Mapping[str, str]) -> None:
    """
    Write blocks into a page; see `filled`.
    """
    text = filled(page.read_text(encoding='utf-8'), blocks)
    page.write_text(text, encoding='utf-8')


def write_csv(path: Path, columns: Sequence[str], rows: Float64) -> None:
    """
    Write (n, k) numbers to six digits.
    """
    path.parent.mkdir(exist_ok=True)
    lines = [','.join(f'{value:.6g}' for value in row) for row in rows]
    path.write_text('\n'.join([','.join(columns), *lines]) + '\n', encoding='utf-8')
