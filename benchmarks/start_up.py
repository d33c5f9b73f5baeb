# SPDX-License-Identifier: Apache-2.0
"""
How long each verb of the command line takes to start, once all is compiled.

    python benchmarks/start_up.py                     # this tree
    python benchmarks/start_up.py --tree OLD --tree . # two trees, in turns

A start is `shipdrag VERB --help`: all that the verb imports, and nothing of its work. Trees
and verbs take turns; of each the least CPU time (user and system) is stated, which other
programs on the machine disturb least.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VERBS = 'import sys; from shipdrag_ros.cli import VERBS; print(*[verb.name for verb in VERBS])'


def cpu_s(tree: Path, *line: str) -> float:
    """Return the CPU time of a program on a tree [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, 'PYTHONPATH': str(tree)}
    # in its folder too, which Python looks into first
    subprocess.run(
        [sys.executable, *line], check=True, env=environment, cwd=tree, stdout=subprocess.DEVNULL
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print a line a verb."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('verbs', nargs='*', help='all by default')
    parser.add_argument('--tree', type=Path, action='append', default=[])
    parser.add_argument('--times', type=int, default=5)
    options = parser.parse_args()
    trees = [tree.resolve() for tree in options.tree] or [ROOT]
    asked = subprocess.run(
        [sys.executable, '-c', VERBS], check=True, capture_output=True, text=True
    )
    for verb in options.verbs or asked.stdout.split():
        line = ('-m', 'shipdrag_ros.cli', verb, '--help')
        taken = [[cpu_s(tree, *line) for tree in trees] for _ in range(options.times)]
        least = [min(each) for each in zip(*taken, strict=True)]
        print(f'{verb:16}' + ' '.join(f'{seconds:6.2f} s' for seconds in least), flush=True)


if __name__ == '__main__':
    main()
