# SPDX-License-Identifier: Apache-2.0
"""Imports: quick ones, those that an extra of the package brings, and those of other packages."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import TypeVar

_T = TypeVar('_T')

EXTRA_OF = {
    'matplotlib': 'report',
    'jinja2': 'report',
    'starlette': 'watch',
    'uvicorn': 'watch',
    'dask': 'fleet',
    'distributed': 'fleet',
    'pyarrow': 'fleet',
    'duckdb': 'fleet',
    'fsspec': 'fleet',
    's3fs': 'fleet',
    'nmea2000': 'logs',
    'pymavlink': 'logs',
    'pyulog': 'logs',
    'rclpy': 'ros',
}
"""Module -> the extra of this package that installs it."""
_OF_ROS = ('_msgs', '_srvs', '_interfaces')


def need(*modules: str) -> None:
    """
    Refuse work at once whose result could not be written at its end.

    Raises
    ------
    ModuleNotFoundError
        If one of the modules is not installed.
    """
    for name in modules:
        if find_spec(name) is None:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)


def what_to_install(error: ModuleNotFoundError) -> str | None:
    """
    Say which extra brings a module that is missing; None of a module that none brings.
    """
    module = (error.name or '').partition('.')[0]
    extra = EXTRA_OF.get(module, 'ros' if module.endswith(_OF_ROS) else None)
    if extra is None:
        return None
    if extra == 'ros':
        return (
            f'ROS 2 is not installed here (no module {module!r}): pip install {pip_name(extra)}, '
            'or source the set-up file of a ROS 2 Jazzy installation'
        )
    return f'{module} is not installed: pip install {pip_name(extra)}'


def pip_name(extra: str) -> str:
    """
    Return what pip installs with an extra.
    """
    return f"'shipdrag_ros[{extra}]'"


@contextmanager
def uncollected() -> Iterator[None]:
    """
    Disable the garbage collector during a block of imports.

    All that is imported stays. The collector would walk it a dozen times meanwhile, which is a
    tenth of the start.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def of_other_packages(
    group: str, accept: Callable[[object], _T], *, own: str
) -> Iterator[tuple[EntryPoint, _T]]:
    """
    Yield what packages that are installed beside this one declare as entry points, by name.

    One that cannot be loaded or accepted is left out with a warning.

    Parameters
    ----------
    group
        Of the entry points.
    accept
        Returns what was loaded, or raises what is wrong with it.
    own
        Package whose entry points are known without an installation.
    """
    for entry in sorted(entry_points(group=group)):
        if entry.module.startswith(f'{own}.'):
            continue
        try:
            found = accept(entry.load())
        except Exception as error:  # whatever the code of a stranger does
            warnings.warn(
                f'{entry.name!r} ({entry.value}) of {group} is left out: {error}; mend or '
                'uninstall its package',
                RuntimeWarning,
                stacklevel=2,
            )
            continue
        yield entry, found
