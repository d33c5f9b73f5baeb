# SPDX-License-Identifier: Apache-2.0
"""
Is there a wheel of everything in requirements.lock for the Python of ROS 2 Jazzy?

    python deploy/check_wheels.py [--python 3.12] [--machine x86_64|aarch64] [--ros]

Asks the package index through uv, for Linux, and installs nothing. Ends with 1 where something
would have to be built from source. The packages of ROS itself are left out without --ros: on a
machine with Jazzy they come from apt.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S = 300.0


def pinned(lock: Path, *, ros: bool) -> list[str]:
    """
    Return the lines of the lock file that name a package, with their markers.
    """
    lines = (line.rstrip(' \\') for line in lock.read_text(encoding='utf-8').splitlines())
    named = [line for line in lines if re.match(r'[A-Za-z0-9]', line)]
    return [line for line in named if ros or not line.startswith('ros-')]


def without_wheel(lines: list[str], python: str, machine: str) -> list[str]:
    """
    Return the packages that have no wheel.

    Raises
    ------
    RuntimeError
        If uv says something else.
    """
    line = ['uv', 'pip', 'compile', '-', '--quiet', '--no-deps', '--only-binary', ':all:']
    line += ['--python-version', python, '--python-platform', f'{machine}-manylinux_2_28']
    found: list[str] = []
    while True:
        asked = '\n'.join(each for each in lines if each.partition('==')[0] not in found)
        done = subprocess.run(
            line, input=asked, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        if done.returncode == 0:
            return found
        named = re.search(r'Because (\S+?)==\S+ has no (?:usable )?wheels', done.stderr)
        if named is None or named[1] in found:
            raise RuntimeError(done.stderr.strip())
        found.append(named[1])


def main() -> int:
    """
    Print what was found.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--python', default='3.12', help='version (default: %(default)s)')
    parser.add_argument('--machine', default='x86_64', choices=['x86_64', 'aarch64'])
    parser.add_argument('--ros', action='store_true', help='the packages of ROS too')
    parser.add_argument('--lock', type=Path, default=ROOT / 'requirements.lock')
    options = parser.parse_args()
    lines = pinned(options.lock, ros=options.ros)
    bad = without_wheel(lines, options.python, options.machine)
    print(
        f'Python {options.python}, Linux {options.machine}: {len(lines)} lines of the lock file,',
        end=' ',
    )
    print(f'no wheel of {", ".join(bad)}' if bad else 'a wheel of each that applies')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
