# SPDX-License-Identifier: Apache-2.0
"""
Is there a wheel of everything in requirements.lock for the Python of ROS 2 Jazzy?

    python deploy/check_wheels.py [--python 3.12] [--lock requirements.lock]

Asks the package index through pip, for Linux on x86-64, and installs nothing. Ends with 1
where something would have to be built from source. The packages of ROS itself are left
out: on a machine with Jazzy they come from apt.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
# what the C library of Ubuntu 24.04 runs
PLATFORMS = ('manylinux_2_39_x86_64', 'manylinux_2_28_x86_64', 'manylinux_2_17_x86_64')
PLATFORMS += ('manylinux2014_x86_64', 'manylinux_2_12_x86_64', 'manylinux2010_x86_64')
PLATFORMS += ('manylinux_2_5_x86_64', 'manylinux1_x86_64', 'linux_x86_64')


def pinned(lock: Path, python: str) -> list[Requirement]:
    """
    Return what the lock file names for a version of Python on Linux, ROS left out.
    """
    target = {
        **default_environment(),
        'python_version': python,
        'python_full_version': f'{python}.3',
        'implementation_name': 'cpython',
        'platform_system': 'Linux',
        'platform_machine': 'x86_64',
        'sys_platform': 'linux',
        'os_name': 'posix',
    }
    found = []
    for line in lock.read_text(encoding='utf-8').splitlines():
        if re.match(r'[A-Za-z0-9]', line):
            requirement = Requirement(line.rstrip(' \\'))
            applies = requirement.marker is None or requirement.marker.evaluate(target)
            if applies and not requirement.name.startswith('ros-jazzy-'):
                found.append(requirement)
    return found


def trouble(requirements: Sequence[Requirement], python: str) -> str:
    """
    Return what pip says of packages without a wheel, '' if all have one.
    """
    line = [sys.executable, '-m', 'pip', 'install', '--dry-run', '--quiet', '--no-deps']
    line += ['--disable-pip-version-check', '--ignore-installed', '--only-binary=:all:']
    line += ['--python-version', python, '--implementation', 'cp', '--abi', _abi(python)]
    line += ['--abi', 'abi3', '--abi', 'none']
    # that of the Python which asks is meant; the tag of a wheel says which it is for
    line += ['--ignore-requires-python']
    line += [word for platform in PLATFORMS for word in ('--platform', platform)]
    with tempfile.TemporaryDirectory() as folder:
        line += ['--target', folder]
        line += [f'{each.name}{each.specifier}' for each in requirements]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
    return done.stderr.strip() if done.returncode else ''


def _abi(python: str) -> str:
    return f'cp{python.replace(".", "")}'


def main() -> int:
    """
    Print what was found.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--python', default='3.12', help='version (default: %(default)s)')
    parser.add_argument('--lock', type=Path, default=ROOT / 'requirements.lock')
    options = parser.parse_args()
    requirements = pinned(options.lock, options.python)
    why = trouble(requirements, options.python)
    if not why:
        print(f'Python {options.python}, Linux x86-64: all {len(requirements)} have a wheel')
        return 0
    bad = [each for each in requirements if trouble([each], options.python)]
    print(f'Python {options.python}, Linux x86-64: of {len(requirements)}, without a wheel:')
    for each in bad:
        print(f'  {each.name}{each.specifier}')
    return 1


if __name__ == '__main__':
    sys.exit(main())
