# SPDX-License-Identifier: Apache-2.0
"""What a study says of itself before anything of it is imported."""

from __future__ import annotations

from typing import NamedTuple


class Study(NamedTuple):
    """The verb of a study, what it does in one line, and command lines to try."""

    verb: str
    summary: str
    examples: tuple[str, ...]
