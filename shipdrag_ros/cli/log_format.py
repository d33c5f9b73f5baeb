# SPDX-License-Identifier: Apache-2.0
"""How a format of `shipdrag import` shows itself on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from shipdrag_ros.cli.output import Output
from shipdrag_ros.importing import formats


@dataclass(frozen=True)
class LogFormat:
    """
    A format, as `shipdrag import` offers it.

    Attributes
    ----------
    title
        Of its arguments in the help.
    kind
        What a source of it is called in an error.
    chosen_by
        Argument that chooses it; '' where none is needed.
    arguments
        Those that it alone knows, and where argparse keeps each.
    add_arguments
        Adds all of them, `chosen_by` too.
    missing
        Says what a command line lacks; '' where it lacks nothing.
    write
        Makes the bag of options, attachments and a progress to tell, and returns
        a dataclass with what became of the source.
    show
        Prints that.
    """

    title: str
    kind: str
    chosen_by: str
    arguments: Mapping[str, str]
    add_arguments: Callable[[argparse._ArgumentGroup], None]
    missing: Callable[[argparse.Namespace], str]
    write: Callable[[argparse.Namespace, Mapping[str, str], Callable[[int, int], None]], Any]
    show: Callable[[Output, Path, Any], None]

    def given(self, options: argparse.Namespace) -> list[str]:
        """
        Return those of its arguments that the command line has.
        """
        return [name for name, place in self.arguments.items() if getattr(options, place)]

    def is_chosen(self, options: argparse.Namespace) -> bool:
        """
        Return whether the command line asks for it by name.
        """
        return bool(self.chosen_by and getattr(options, self.chosen_by.lstrip('-')))


def found() -> tuple[LogFormat, ...]:
    """
    Return every format; the one that needs no argument to be chosen is first.
    """
    faces = [import_module(f'{formats.__name__}.{name}.face') for name in formats.names()]
    return tuple(sorted((face.FORMAT for face in faces), key=lambda each: each.chosen_by))
