# SPDX-License-Identifier: Apache-2.0
"""A text file as a table: its delimiter, its header if it has one, its rows."""

from __future__ import annotations

import codecs
import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import NamedTuple

from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import ImportDataError

DELIMITERS = ',;\t'


class Row(NamedTuple):
    """The cells of a row, stripped, and the line it ends on."""

    line: int
    cells: Sequence[str]


class Table:
    """
    A table in a file.

    Parameters
    ----------
    path
        UTF-8, with or without a byte-order mark; separated by comma, semicolon
        or tab, which the first line tells.

    Attributes
    ----------
    delimiter
        One of `DELIMITERS`.
    header
        Names of the columns; None if the first line holds numbers only.
    width
        Number of columns.

    Raises
    ------
    ImportDataError
        If the file cannot be read or has no line.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        blank = DELIMITERS + ' \r\n'
        try:
            with path.open('rb') as read, self._decoded(read) as file:
                first = next((line for line in file if line.strip(blank)), '')
        except OSError as error:
            raise ImportDataError(
                f'{str(path)!r} cannot be read: {error.strerror}; give a CSV file'
            ) from error
        if not first:
            raise ImportDataError(f'{str(path)!r} is empty; give a table with a line a sample')
        if '\0' in first or first.startswith('PK'):  # as spreadsheets begin, which are archives
            raise ImportDataError(
                f'{str(path)!r} is no text, it begins with {first[:4]!r}; save it as CSV'
            )
        # a delimiter in quotes is none
        self.delimiter = max(DELIMITERS, key=lambda mark: len(self._cells(first, mark)))
        cells = self._cells(first, self.delimiter)
        numbers = all(NUMBER.fullmatch(cell) for cell in cells if cell)
        self.header: tuple[str, ...] | None = None if numbers else tuple(cells)
        self.width = len(cells)

    def column(self, name: str) -> int:
        """
        Return the place of a column given by name or number.

        Raises
        ------
        ImportDataError
            If there is none, or several of the name.
        """
        names = self.header or ()
        found = [place for place, each in enumerate(names) if each == name]
        if len(found) > 1:
            numbers = ' or '.join(str(place + 1) for place in found)
            raise ImportDataError(
                f'{str(self.path)!r} has {len(found)} columns {name!r}; write a number: {numbers}'
            )
        if found:
            return found[0]
        if name.isdecimal() and 1 <= int(name) <= self.width:
            return int(name) - 1
        listed = ', '.join(repr(each) for each in names) or 'no header'
        hint = f'and numbers 1 to {self.width} are names too'
        if self.width == 1:
            hint = 'and no comma, semicolon or tab that would separate columns'
        raise ImportDataError(
            f'{str(self.path)!r} has no column {name!r}; it has {listed}, {hint}'
        )

    def rows(self, progress: Callable[[int, int], None] | None = None) -> Iterator[Row]:
        """
        Yield the rows below the header; lines without any cell are skipped.

        Parameters
        ----------
        progress
            Told how many bytes are read, and of how many.
        """
        total = self.path.stat().st_size
        with self.path.open('rb') as read, self._decoded(read) as file:
            for count, row in enumerate(self._rows(file, self.delimiter)):
                if count == 0 and self.header is not None:
                    continue
                if progress is not None and count % 1000 == 0:
                    progress(read.tell(), total)
                yield row

    def _cells(self, line: str, delimiter: str) -> Sequence[str]:
        return next((row.cells for row in self._rows([line], delimiter)), ())

    def _rows(self, lines: Iterable[str], delimiter: str) -> Iterator[Row]:
        reader = csv.reader(lines, delimiter=delimiter)
        try:
            for cells in reader:
                stripped = [cell.strip() for cell in cells]
                if any(stripped):
                    yield Row(reader.line_num, stripped)
        except csv.Error as error:
            raise ImportDataError(
                f'{str(self.path)!r} line {reader.line_num} is no row of a table: {error}'
            ) from error

    def _decoded(self, file: BufferedReader) -> TextIOWrapper:
        if file.peek(2).startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise ImportDataError(f'{str(self.path)!r} is in UTF-16; save it as UTF-8')
        # a name that is not UTF-8 may still be given by its number
        return TextIOWrapper(file, encoding='utf-8-sig', errors='replace', newline='')
