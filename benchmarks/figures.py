# SPDX-License-Identifier: Apache-2.0
"""
Print the figures of docs/figures.md anew, each by the command that stands above it.

A block of the page that begins with `$ python benchmarks/...` is run, and what it
prints on stdout takes the place of what stands below. All of it takes hours:

    python benchmarks/figures.py final_accuracy replay_speed

runs the blocks whose command holds one of these words.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'figures.md'
BLOCK = re.compile(r'^```console\n\$ python (benchmarks/.*)\n(?:.*\n)*?```$', re.MULTILINE)


def printed(command: str, limit_s: float) -> str:
    """
    Run a command of the page and return what it prints.

    Raises
    ------
    CalledProcessError, TimeoutExpired
        If it fails, or takes longer than `limit_s` [s].
    """
    words = shlex.split(command)
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, stdout=subprocess.PIPE, timeout=limit_s, check=True
    )
    return done.stdout.decode().strip()


def main() -> None:
    """
    Run the blocks that were asked for and write the page after each.
    """
    parser = argparse.ArgumentParser(description=__doc__.strip().partition('\n')[0])
    parser.add_argument('words', nargs='*', help='commands that hold one of them; all by default')
    parser.add_argument('--list', action='store_true', help='name the commands and run none')
    parser.add_argument('--limit', type=float, default=3600.0, help='seconds for each')
    options = parser.parse_args()
    commands = BLOCK.findall(PAGE.read_text(encoding='utf-8'))
    for command in commands:
        if options.words and not any(word in command for word in options.words):
            continue
        print(command, file=sys.stderr, flush=True)
        if options.list:
            continue
        try:
            found = printed(command, options.limit)
        except (subprocess.SubprocessError, OSError) as error:
            print(f'left as it was: {error}', file=sys.stderr)
            continue
        text = PAGE.read_text(encoding='utf-8')
        block = f'```console\n$ python {command}\n{found}\n```'
        made = BLOCK.sub(lambda old: block if old[1] == command else old[0], text)  # noqa: B023
        PAGE.write_text(made, encoding='utf-8')


if __name__ == '__main__':
    main()
