# SPDX-License-Identifier: Apache-2.0
"""
Installed size and number of packages: the base, and what each extra adds to it.

Read from the environment that it runs in, which `make env` has made; nothing is installed.

    python -m benchmarks.speed.install_size
"""

from __future__ import annotations

import sys
from distutils.core import run_setup
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from benchmarks import ROOT

_MIB = 2**20


def declared() -> tuple[list[str], dict[str, list[str]]]:
    """
    Return the requirements of the base and of each extra, as setup.py states them.
    """
    stated = run_setup(str(ROOT / 'setup.py'), stop_after='init')
    return stated.install_requires, stated.extras_require


def closure(requirements: list[str]) -> set[str]:
    """
    Return the names of the packages that these requirements bring, themselves included.

    Raises
    ------
    PackageNotFoundError
        If one of them is not installed here.
    """
    reached: set[str] = set()
    waiting = [(Requirement(text), frozenset[str]()) for text in requirements]
    done: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        requirement, _ = waiting.pop()
        name = canonicalize_name(requirement.name)
        extras = frozenset(requirement.extras)
        if (name, extras) in done:
            continue
        done.add((name, extras))
        reached.add(name)
        for text in distribution(name).requires or ():
            below = Requirement(text)
            environments = [{'extra': extra} for extra in extras] or [{'extra': ''}]
            if below.marker is None or any(map(below.marker.evaluate, environments)):
                waiting.append((below, extras))
    return reached


def size_bytes(name: str) -> int:
    """
    Return the size of the files of a package, compiled Python left out.
    """
    files = distribution(name).files or ()
    paths = (Path(str(file.locate())) for file in files if file.suffix != '.pyc')
    return sum(path.stat().st_size for path in paths if path.is_file())


def main() -> None:
    """
    Print the table.
    """
    base, extras = declared()
    own = sum(path.stat().st_size for path in (ROOT / 'shipdrag_ros').rglob('*.*')
              if path.is_file() and path.suffix != '.pyc')  # fmt: skip
    packages = closure(base)
    sizes = {name: size_bytes(name) for name in packages}
    total = own + sum(sizes.values())
    print('| | packages | MiB |\n| --- | ---: | ---: |')
    print(f'| base, with shipdrag_ros itself | {len(packages) + 1} | {total / _MIB:.0f} |')
    for extra, requirements in extras.items():
        try:
            more = closure(requirements) - packages
        except PackageNotFoundError as error:
            print(f'{extra}: {error} is not installed here', file=sys.stderr)
            continue
        added = sum(map(size_bytes, more))
        print(f'| `[{extra}]` adds | {len(more)} | {added / _MIB:.0f} |')
    largest = sorted(sizes, key=sizes.__getitem__, reverse=True)[:6]
    print(f'\nlargest: {", ".join(f"{name} {sizes[name] / _MIB:.0f}" for name in largest)}')


if __name__ == '__main__':
    main()
