# SPDX-License-Identifier: Apache-2.0
"""One attack: what is tried, and how it is found out that it failed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


class Succeeded(Exception):
    """The attack did what it should not be able to."""


@dataclass(frozen=True)
class Attack:
    """
    An attack; `run` takes an empty folder and says what happened, or raises `Succeeded`.
    """

    area: str
    kind: str
    run: Callable[[Path], str]


def check(held: object, why: str) -> None:
    """
    Raise `Succeeded` unless the defence held.
    """
    if not held:
        raise Succeeded(why)
