# SPDX-License-Identifier: Apache-2.0
"""The page of the fleet, and the pages that its rows lead to, made when they are asked for."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

_KEPT = 32
FLEET = '/fleet'


class FleetPages:
    """
    Pages of a store, as it was when they were begun.

    Parameters
    ----------
    page
        That of the fleet (HTML).
    rows
        Of the store's `coastdowns`.

    Attributes
    ----------
    page
    """

    def __init__(self, page: str, rows: Sequence[Mapping[str, Any]]) -> None:
        from shipdrag_ros.trend.coastdown_page import page_name  # pictures take long to import

        self.page = page
        self._rows = {page_name(row): row for row in rows}
        self._drawing = threading.Lock()
        self._made = lru_cache(_KEPT)(self._make)

    def coastdown(self, name: str) -> str | None:
        """
        Return the page of a coastdown (HTML) by its name; None where there is none.
        """
        if name not in self._rows:
            return None
        with self._drawing:
            return self._made(name)

    def _make(self, name: str) -> str:
        from shipdrag_ros.trend.coastdown_page import coastdown_page

        return coastdown_page(self._rows[name], fleet=FLEET)
