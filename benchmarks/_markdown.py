# SPDX-License-Identifier: Apache-2.0
"""Tables of the pages that benchmarks write."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """
    Return the lines of a table.
    """
    lines = [columns, ['---'] * len(columns), *rows]
    return [f'| {" | ".join(map(str, line))} |' for line in lines]
