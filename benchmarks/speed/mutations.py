# SPDX-License-Identifier: Apache-2.0
"""
How many faults put into the code do the tests catch?

Mutations are drawn by a seed, not by hand: a room, then an operator of cosmic-ray, then a place.
Each is made in a copy of the package; the tests of its module run first, then those of its room,
then, with --whole, all. Equivalent mutations are judged by a person: the survivors are printed
with their lines.

    pip install cosmic-ray          # into an environment of its own; it is given with --cosmic-ray
    python -m benchmarks.speed.mutations --count 60 --seed 1 --cosmic-ray .mutations/bin/python
"""

from __future__ import annotations

import argparse
import difflib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
OUT = HERE / 'benchmarks' / 'out'
# left out: what changes annotations only, or speed only
OPERATORS = (
    'ReplaceComparisonOperator',
    'ReplaceBinaryOperator_Add',
    'ReplaceBinaryOperator_Sub',
    'ReplaceBinaryOperator_Mul',
    'ReplaceBinaryOperator_Div',
    'ReplaceBinaryOperator_Pow',
    'ReplaceUnaryOperator',
    'ReplaceTrueWithFalse',
    'ReplaceFalseWithTrue',
    'ReplaceAndWithOr',
    'ReplaceOrWithAnd',
    'AddNot',
    'NumberReplacer',
    'ReplaceBreakWithContinue',
    'ReplaceContinueWithBreak',
    'ZeroIterationForLoop',
)

# what the modules below all rooms are tried on
GROUND_FLOOR = ['tests/ship', 'tests/messages', 'tests/coastdown', 'tests/test_compiled.py']

# both are run by the interpreter that has cosmic-ray
_DRAW = """
import json, random, sys
from functools import cache
import cosmic_ray.plugins as plugins
from cosmic_ray.ast import ast_nodes, get_ast
kinds, rooms, count, seed = json.loads(sys.stdin.read())
loud = ('BitOr', 'BitAnd', 'BitXor', 'LShift', 'RShift', 'Invert', 'Mod')  # not defined for floats
names = [
    n for n in plugins.operator_names()
    if n.split('/')[1].startswith(tuple(kinds)) and not n.endswith(loud)
]
@cache
def nodes(file):
    return list(ast_nodes(get_ast(open(file, encoding='utf-8').read())))
@cache
def sites(file, kind):
    found = []
    for name in names:
        if name.split('/')[1].startswith(kind):
            operator = plugins.get_operator(name)()
            places = sum(sum(1 for _ in operator.mutation_positions(n)) for n in nodes(file))
            found += [(file, name, i) for i in range(places)]
    return found
draw, drawn = random.Random(seed), []
while len(drawn) < count:
    room = sorted(rooms)[len(drawn) % len(rooms)]
    there = sites(draw.choice(rooms[room]), draw.choice(kinds))
    if there:
        drawn.append(draw.choice(there))
print(json.dumps(drawn))
"""
_MUTATE = """
import sys
import cosmic_ray.plugins as plugins
from cosmic_ray.mutating import mutate_code
name, occurrence = sys.argv[1:]
sys.stdout.write(mutate_code(sys.stdin.read(), plugins.get_operator(name)(), int(occurrence)))
"""


def main() -> None:
    """Draw mutations, run the tests on each, print what survived."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--count', type=int, default=60)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--cosmic-ray', default=sys.executable, help='interpreter that has it')
    parser.add_argument('--whole', action='store_true', help='survivors against all tests')
    parser.add_argument('--limit-s', type=float, default=900.0, help='for the tests of one')
    options = parser.parse_args()
    OUT.mkdir(exist_ok=True)
    kept = OUT / f'mutations_{options.seed}.jsonl'
    done = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / 'copy'
        subprocess.run(['git', 'clone', '-q', str(HERE), str(copy)], check=True)
        mutations = _drawn(copy, options)
        for number, (module, name, occurrence) in enumerate(mutations):
            if number < len(done):
                continue
            began = time.monotonic()
            found = _tried(copy, module, name, occurrence, options)
            found['seconds'] = round(time.monotonic() - began)
            done.append(found)
            with kept.open('a') as file:
                file.write(json.dumps(found) + '\n')
            print(
                f'{number + 1:3d} {found["outcome"]:9} {found["seconds"]:5d} s  {module}',
                flush=True,
            )
    _print(done)


def _drawn(copy: Path, options: argparse.Namespace) -> list[tuple[str, str, int]]:
    """Return mutations: module, operator, number of its place."""
    files = [
        str(path.relative_to(copy))
        for path in sorted((copy / 'shipdrag_ros').rglob('*.py'))
        if path.name not in ('__init__.py', '__main__.py')
    ]
    rooms: dict[str, list[str]] = {}
    for file in files:
        parts = Path(file).parts
        rooms.setdefault(parts[1] if len(parts) > 2 else '', []).append(file)
    ran = subprocess.run(
        [options.cosmic_ray, '-c', _DRAW],
        input=json.dumps([OPERATORS, rooms, options.count, options.seed]),
        cwd=copy,
        capture_output=True,
        text=True,
        check=True,
    )
    return [(file, name, occurrence) for file, name, occurrence in json.loads(ran.stdout)]


def _tried(
    copy: Path, module: str, name: str, occurrence: int, options: argparse.Namespace
) -> dict[str, object]:
    """Return what became of one mutation."""
    path = copy / module
    source = path.read_text()
    ran = subprocess.run(
        [options.cosmic_ray, '-c', _MUTATE, name, str(occurrence)],
        input=source,
        capture_output=True,
        text=True,
        check=True,
    )
    path.write_text(ran.stdout)
    difference = [
        line
        for line in difflib.unified_diff(
            source.split('\n'), ran.stdout.split('\n'), n=0, lineterm=''
        )
        if line[:3] not in ('---', '+++')
    ]
    changed = [line[1:].strip() for line in difference if line.startswith('-')]
    # frozen or not, by keyword or not: no run of the program differs, or there is none
    if all(line.startswith(('@', 'def ', '*,')) for line in changed):
        path.write_text(source)
        return _row(module, name, 'declaration', difference)
    outcome = 'survived'
    try:
        for tests in _tests(copy, module, options.whole):
            failed = _failed(copy, tests, options.limit_s)
            if failed or failed is None:
                outcome = 'caught' if failed else 'timed out'
                break
    finally:
        path.write_text(source)
    return _row(module, name, outcome, difference)


def _row(module: str, name: str, outcome: str, difference: list[str]) -> dict[str, object]:
    return {'module': module, 'operator': name, 'outcome': outcome, 'difference': difference}


def _tests(copy: Path, module: str, whole: bool) -> list[list[str]]:
    """Return what to run, nearest first."""
    inside = Path(module).relative_to('shipdrag_ros')
    room = Path('tests') / inside.parent
    near = room / f'test_{inside.stem}.py'
    stages = [[str(near)]] if (copy / near).exists() else []
    naming = [str(path) for path in _naming(copy, inside)]
    stages += [naming] if naming else []
    top = Path('tests') / inside.parts[0]
    if len(inside.parts) == 1:
        stages.append(GROUND_FLOOR)
    elif (copy / top).exists():
        stages.append([str(top)])
    return [*stages, ['tests']] if whole or not stages else stages


def _naming(copy: Path, inside: Path) -> list[Path]:
    """Return the tests that import a module by its name, wherever they stand."""
    room = '.'.join(('shipdrag_ros', *inside.parent.parts))
    by_name = re.compile(
        rf'{re.escape(room)}\.{inside.stem}\b'
        rf'|from {re.escape(room)} import [^\n]*\b{inside.stem}\b'
    )
    tests = sorted((copy / 'tests').rglob('test_*.py'))
    return [path.relative_to(copy) for path in tests if by_name.search(path.read_text())]


def _failed(copy: Path, tests: list[str], limit_s: float) -> bool | None:
    """Run tests; say whether one fails, None where they do not end."""
    command = [sys.executable, '-m', 'pytest', '-q', '-x', '-n', '2', *tests]
    if shutil.which('unshare') and os.geteuid() == 0:
        inner = 'ip link set lo up; exec "$@"'
        command = ['unshare', '-n', 'bash', '-c', inner, 'tests', *command]
    environment = {
        **os.environ,
        'PYTHONPATH': str(copy),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONDONTWRITEBYTECODE': '1',
    }
    with subprocess.Popen(
        command,
        cwd=copy,
        env=environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as ran:
        try:
            return ran.wait(limit_s) not in (0, 5)
        except subprocess.TimeoutExpired:
            os.killpg(ran.pid, 9)
            return None


def _print(done: list[dict[str, object]]) -> None:
    """Print the share caught, and what was not."""
    caught = sum(one['outcome'] == 'caught' for one in done)
    counted = [one for one in done if one['outcome'] != 'declaration']
    print(f'\n{caught} of {len(counted)} caught ({100.0 * caught / max(len(counted), 1):.0f} %)')
    for one in counted:
        if one['outcome'] != 'caught':
            print(f'\n{one["module"]}  {one["operator"]}')
            for line in one['difference']:  # type: ignore[attr-defined]
                print(f'    {line}')


if __name__ == '__main__':
    main()
