# SPDX-License-Identifier: Apache-2.0
"""Options of a script from their defaults, and work in several processes."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

Task = TypeVar('Task')
Result = TypeVar('Result')


def asked(
    doc: str | None, arguments: Sequence[str] | None = None, **defaults: Any
) -> argparse.Namespace:
    """
    Return the options of a script.

    Parameters
    ----------
    doc
        What `--help` prints; it says what the options are.
    arguments
        The command line; by default that of the process.
    **defaults
        An option each: a flag where it is False, one of several where it is a tuple (the first
        is the default), several at once where it is a list, else a value of the default's type;
        a type stands for an option without a default.
    """
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        how: dict[str, Any] = {'type': type(default), 'default': default}
        if default is False:
            how = {'action': 'store_true'}
        elif isinstance(default, type):
            how = {'type': default}
        elif isinstance(default, tuple):
            how = {'choices': default, 'default': default[0]}
        elif isinstance(default, list):
            how = {'nargs': '+', 'type': type(default[0]), 'default': default}
        parser.add_argument('--' + name.replace('_', '-'), **how)
    return parser.parse_args(arguments)


def pooled(
    work: Callable[[Task], Result], tasks: Sequence[Task], processes: int | None = None
) -> Iterator[Result]:
    """
    Yield what is made of each task, in their order, by several processes.
    """
    processes = processes or os.cpu_count() or 1
    if processes == 1:
        yield from map(work, tasks)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(work, tasks)
