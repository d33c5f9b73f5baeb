# SPDX-License-Identifier: Apache-2.0
"""Imports: quick ones, those that an extra of the package brings, and those of other packages."""

from __future__ import annotations

import gc
import os
import warnings
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
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
LEFT_OUT: dict[EntryPoint, str] = {}
"""What other packages declare and was left out, and why."""
_PACKAGE = Path(os.path.abspath(__file__)).parent
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


def points(group: str, attribute: str, *places: str) -> tuple[EntryPoint, ...]:
    """
    Return the entry points of a group: this package's own first, then those of others.

    Its own are made of its modules in some places, so that a tree need not be installed.

    Parameters
    ----------
    group
        Of the entry points.
    attribute
        That each module of this package declares.
    places
        Patterns of paths in this package.
    """
    own = []
    for file in (file for place in places for file in sorted(_PACKAGE.glob(place))):
        path = Path(os.path.normpath(file)).relative_to(_PACKAGE.parent).with_suffix('')
        own.append(EntryPoint(path.name, f'{".".join(path.parts)}:{attribute}', group))
    known = {point.value for point in own}
    others = (point for point in entry_points(group=group) if point.value not in known)
    return (*own, *sorted(others))


def load(
    points: Iterable[EntryPoint], kind: type[_T], key: str = 'name', taken: Collection[str] = ()
) -> dict[str, tuple[EntryPoint, _T]]:
    """
    Return what entry points declare, by its name.

    What cannot be loaded of another package, is of another kind or has a name that is taken, is
    left out with a warning; `LEFT_OUT` keeps why.

    Parameters
    ----------
    points
    kind
        Of what they declare.
    key
        Its attribute that is the name.
    taken
        Names that none may have.
    """
    found: dict[str, tuple[EntryPoint, _T]] = {}
    for point in points:
        try:
            declared = point.load()
            if not isinstance(declared, kind) or getattr(declared, key) in {*taken, *found}:
                what = f'{declared!r:.80}, expected {kind.__name__} with a name that is not taken'
                raise TypeError(what)
        except (Exception, SystemExit) as error:  # whatever the code of a stranger does
            if point.dist is None:
                raise
            why = f'{point.name!r} ({point.value}) of {point.group} is left out: {error}'
            if point not in LEFT_OUT:
                do = f'mend or uninstall the package {point.dist.name!r}'
                warnings.warn(f'{why}; {do}', RuntimeWarning, stacklevel=2)
            LEFT_OUT[point] = why
        else:
            found[getattr(declared, key)] = (point, declared)
    return found
