# SPDX-License-Identifier: Apache-2.0
"""
How many faults put into the code do the tests catch?

Mutations are drawn by a seed, not by hand: a room, then an operator of cosmic-ray, then a place.
cosmic-ray makes each in a copy of the package and runs the tests of its module, then those of its
room, then, with --whole, all. It goes on where it was broken off. Equivalent mutations are judged
by a person: those that survived are printed with their lines.

    pip install cosmic-ray          # into an environment of its own; its folder is given
    python -m benchmarks.speed.mutations --count 60 --seed 1 --cosmic-ray .mutations/bin
"""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from tempfile import gettempdir

from benchmarks import ROOT
from benchmarks._asked import asked

OUT = Path(gettempdir()) / 'shipdrag_mutations'
PACKAGE = 'shipdrag_ros'
# left out: what changes annotations only, or speed only, and what floats do not have
OPERATORS = re.compile(
    r'ReplaceComparisonOperator|ReplaceBinaryOperator_(Add|Sub|Mul|Div|Pow)|ReplaceUnaryOperator'
    r'|ReplaceTrueWithFalse|ReplaceFalseWithTrue|ReplaceAndWithOr|ReplaceOrWithAnd|AddNot'
    r'|NumberReplacer|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop'
)
NOT_OF_FLOATS = ('BitOr', 'BitAnd', 'BitXor', 'LShift', 'RShift', 'Invert', 'Mod')
# what the modules below all rooms are tried on
GROUND_FLOOR = ['tests/ship', 'tests/messages', 'tests/coastdown', 'tests/test_compiled.py']
# without a way out of this machine, where that can be had
ALONE = ['unshare', '-n', 'bash', '-c', 'ip link set lo up; exec "$@"', 'tests']


def main() -> None:
    """Draw mutations, run the tests on each, print what survived."""
    options = asked(
        __doc__, count=60, seed=1, cosmic_ray=Path, whole=False, limit_s=900.0, nearest=False
    )
    if options.nearest:
        sys.exit(nearest(options.whole))
    copy, session = OUT / f'copy_{options.seed}', OUT / f'{options.seed}.sqlite'
    program = str((options.cosmic_ray or Path(sys.executable).parent).absolute() / 'cosmic-ray')
    if not session.exists():
        OUT.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(copy, ignore_errors=True)
        subprocess.run(['git', 'clone', '-q', str(ROOT), str(copy)], check=True)
        rng = random.Random(options.seed)
        modules = drawn_modules(copy, options.count, rng)
        test = f'{sys.executable} -m benchmarks.speed.mutations --nearest'
        settings = {
            'module-path': sorted(set(modules)),
            'timeout': options.limit_s,
            'excluded-modules': [],
            'test-command': test + ' --whole' * options.whole,
        }
        lines = [f'{name} = {json.dumps(value)}' for name, value in settings.items()]
        local = ['[cosmic-ray.distributor]', 'name = "local"']
        (copy / 'mutations.toml').write_text('\n'.join(['[cosmic-ray]', *lines, *local]))
        subprocess.run([program, 'init', 'mutations.toml', str(session)], cwd=copy, check=True)
        draw(session, modules, rng)
    # where it was broken off, the last one is still there
    subprocess.run(['git', 'checkout', '-q', '--', PACKAGE], cwd=copy, check=True)
    subprocess.run([program, 'exec', 'mutations.toml', str(session)], cwd=copy, check=True)
    report = [str(Path(program).with_name('cr-report')), '--show-diff', '--surviving-only']
    subprocess.run([*report, str(session)], check=True)


def drawn_modules(copy: Path, count: int, rng: random.Random) -> list[str]:
    """Return modules, one of each room in turn."""
    rooms: dict[str, list[str]] = defaultdict(list)
    for path in sorted((copy / PACKAGE).rglob('*.py')):
        file = path.relative_to(copy)
        if path.name not in ('__init__.py', '__main__.py'):
            rooms[file.parts[1] if len(file.parts) > 2 else ''].append(str(file))
    return [rng.choice(rooms[sorted(rooms)[i % len(rooms)]]) for i in range(count)]


def draw(session: Path, modules: list[str], rng: random.Random) -> None:
    """Keep a mutation of each module, and forget the others."""
    jobs: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    with sqlite3.connect(session) as file:
        every = 'SELECT job_id, module_path, operator_name FROM mutation_specs'
        every += ' ORDER BY module_path, operator_name, occurrence'
        for job, module, operator in file.execute(every):
            kind = OPERATORS.search(operator)
            if kind is not None and not operator.endswith(NOT_OF_FLOATS):
                jobs[module][kind[0]].append(job)
        kept = [rng.choice(of[rng.choice(sorted(of))]) for each in modules if (of := jobs[each])]
        marks = ', '.join('?' * len(kept))
        for table in ('mutation_specs', 'work_items'):
            file.execute(f'DELETE FROM {table} WHERE job_id NOT IN ({marks})', kept)


def nearest(whole: bool) -> int:
    """Run the tests of what is changed in this folder; return what the first that fails does."""
    changed = subprocess.run(
        ['git', 'diff', '--name-only', '--', PACKAGE], capture_output=True, text=True, check=True
    )
    inside = Path(changed.stdout.split()[0]).relative_to(PACKAGE)
    room, top = '.'.join((PACKAGE, *inside.parent.parts)), Path('tests', inside.parts[0])
    by_name = re.compile(
        rf'{re.escape(room)}\.{inside.stem}\b'
        rf'|from {re.escape(room)} import [^\n]*\b{inside.stem}\b'
    )
    near = Path('tests') / inside.with_name(f'test_{inside.name}')
    naming = [t for t in sorted(Path('tests').rglob('test_*.py')) if by_name.search(t.read_text())]
    stages = [[near] if near.exists() else [], naming, [top] if top.is_dir() else []]
    if len(inside.parts) == 1:
        stages.append([Path(each) for each in GROUND_FLOOR])
    if whole or not any(stages):
        stages.append([Path('tests')])
    alone = ALONE if shutil.which('unshare') and os.geteuid() == 0 else []
    environment = {**os.environ, 'PYTHONPATH': '.', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    for tests in filter(None, stages):
        command = [sys.executable, '-m', 'pytest', '-q', '-x', '-n', '2', *map(str, tests)]
        status = subprocess.run([*alone, *command], env=environment, check=False).returncode
        if status not in (0, 5):
            return status
    return 0


if __name__ == '__main__':
    main()
