# SPDX-License-Identifier: Apache-2.0
"""Tables that benchmarks write: of pages, and of data to try the verbs on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from shipdrag_ros.samples import Float64


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table.
    """
    lines = [columns, ['---'] * len(columns), *rows]
    return [f'| {" | ".join(map(str, line))} |' for line in lines]


def titled(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table under its title.
    """
    return ['', title, '', *table(columns, rows)]


def put(page: Path, blocks: Mapping[str, str]) -> None:
    """
    Write into a page what stands between `<!-- NAME -->` and `<!-- end NAME -->`.

    Raises
    ------
    ValueError
        If the page lacks the markers of a block.
    """
    text = page.read_text(encoding='utf-8')
    for name, made in blocks.items():
        begin, end = f'<!-- {name} -->\n', f'\n<!-- end {name} -->'
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not (found and closed):
            raise ValueError(f'{page}: no {begin.strip()} .. {end.strip()}')
        text = f'{before}{begin}{made}{end}{after}'
    page.write_text(text, encoding='utf-8')


def write_csv(path: Path, columns: Sequence[str], rows: Float64) -> None:
    """
    Write (n, k) numbers to six digits.
    """
    path.parent.mkdir(exist_ok=True)
    lines = [','.join(f'{value:.6g}' for value in row) for row in rows]
    path.write_text('\n'.join([','.join(columns), *lines]) + '\n', encoding='utf-8')


def publish(page: Path, lines: Sequence[str], *, rows: int, keep: int = 0) -> None:
    """
    Write a page; long tables and what scripts print go into a file beside it.

    Parameters
    ----------
    page
        Of the docs; the file is `results/NAME.txt` there.
    lines
        Markdown.
    rows
        Longest table [rows] that stays on the page.
    keep
        Tables at the top that stay, however long.
    """
    kept: list[str] = []
    aside: list[str] = []
    heading, link = '', f'([table](results/{page.stem}.txt))'
    for block in re.split(r'\n{2,}(?![^`]*\n```(?:\n|$))', '\n'.join(lines).strip()):
        heading = block if block.startswith('#') else heading
        keep -= block.startswith('|')
        is_long = block.startswith('|') and block.count('\n') > rows + 1 and keep < 0
        if block.startswith('```text') or is_long:
            aside += ['', heading.lstrip('# '), '', block.removeprefix('```text\n').rstrip('`\n')]
            if kept[-1].endswith('.txt))'):
                continue
            if kept[-1].startswith(('#', '!', '|')):
                kept.append(link)
            else:
                kept[-1] += f' {link}'
        else:
            kept.append(block)
    page.write_text('\n\n'.join(kept) + '\n', encoding='utf-8')
    file = page.parent / 'results' / f'{page.stem}.txt'
    file.write_text('\n'.join(aside).strip() + '\n', encoding='utf-8')
