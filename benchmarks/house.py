# SPDX-License-Identifier: Apache-2.0
"""
Count the house: how much code there is, and through how many rooms a job goes.

    python -m benchmarks.house                     # this tree
    python -m benchmarks.house --tree OLD .        # two trees beside each other

Core code is what a coastdown may need: lines of `shipdrag_ros` without
docstrings, blanks and comments, and without the studies S1 to S5; an `__init__` is no
module. Numbers are those that the inner rooms choose: constants of modules, the priors and
regimes in printed tables, and numbers within functions but 0, 1, 2, -1 and 1/2. The walk is a
replay of a simulated coastdown, traced: which calls cross from one room into
another between the bytes of the bag and those of a published estimate. The
diagnosis of the same bag shows which modules run in it.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from benchmarks import ROOT
from benchmarks._asked import asked

PACKAGE = 'shipdrag_ros'
LINES, PARAMETERS = 60, 8
# counted by themselves: the ways in and out, the studies and the ground floor
OUTER = ('bags', 'cli', 'fleet', 'library', 'live', 'messages', 'nmea', 'node', 'report')
OUTER += ('sources', 'studies', 'trend', '')
# rows of tables of priors, which pages show
PRINTED = {'Declared', '_families', '_number', '_grid', '_shares'}
PLAIN = {0, 1, 2, 0.5}
WALK = """
import json, sys
from pathlib import Path
sys.path.insert(0, {tree!r})
from shipdrag_ros.cli import main
package = str(Path({tree!r}) / 'shipdrag_ros') + '/'
calls, modules, depth = set(), set(), [0]
main({line!r})  # whatever is compiled once, is compiled now

def place(frame):
    name = frame.f_code.co_filename
    if not name.startswith(package) or name == package + 'compiled.py':  # it passes calls on
        return None
    return name.removeprefix(package)

def traced(frame, event, argument):
    here = place(frame) if event in ('call', 'return') else None
    if here is None:
        return
    if here.endswith({module!r}) and frame.f_code.co_name == {function!r}:
        depth[0] += 1 if event == 'call' else -1
    if event == 'return' or not depth[0]:
        return
    modules.add(here)
    caller = frame.f_back
    while caller is not None and place(caller) is None:
        caller = caller.f_back
    if caller is not None and place(caller).split('/')[0] != here.split('/')[0]:
        calls.add((place(caller), caller.f_code.co_name, here, frame.f_code.co_name))

sys.setprofile(traced)
main({line!r})
sys.setprofile(None)
print('WALKED', json.dumps([sorted(calls), sorted(modules)]))
"""


@dataclass
class Count:
    """What a tree holds; of functions that are long, or take much, where they are and how much."""

    raw: int = 0
    lines: int = 0
    core: int = 0
    outer: int = 0
    modules: int = 0
    core_modules: int = 0
    numbers: Counter[str] = field(default_factory=Counter)
    long: list[tuple[str, int]] = field(default_factory=list)
    wide: list[tuple[str, int]] = field(default_factory=list)


def code_lines(path: Path) -> set[int]:
    """
    Return the lines of a file that hold code: no docstring, comment or blank.
    """
    text = path.read_text(encoding='utf-8')
    held: set[int] = set()
    with path.open('rb') as file:
        for token in tokenize.tokenize(file.readline):
            if token.type != tokenize.COMMENT and token.string.strip() and token.start[0]:
                held.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, 'body', None)
        for each in body if isinstance(body, list) else ():
            value = each.value if isinstance(each, ast.Expr) else None
            # also what stands below an attribute, which is a docstring to the reader
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                held -= set(range(each.lineno, (each.end_lineno or each.lineno) + 1))
    return held


def numbers(path: Path) -> Counter[str]:
    """
    Count the numbers of a file, by where they stand.
    """
    tree = ast.parse(path.read_text(encoding='utf-8'))
    found: Counter[str] = Counter()
    constants = [node for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            found['code'] += node.value not in PLAIN
    for each in constants:
        held = [node for node in ast.walk(each) if isinstance(node, ast.Constant)]
        values = [node.value for node in held if type(node.value) in (int, float)]
        call = each.value.func if isinstance(each.value, ast.Call) else None
        printed = isinstance(call, ast.Name) and call.id in PRINTED
        found['printed' if printed else 'constants'] += len(values)
        found['code'] -= sum(value not in PLAIN for value in values)
    return found


def functions(path: Path) -> Iterator[tuple[ast.FunctionDef | ast.AsyncFunctionDef, bool]]:
    """
    Yield each function of a file, and whether it is compiled.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            names = {ast.unparse(each).partition('(')[0] for each in node.decorator_list}
            yield node, bool(names & {'compiled', 'numba.njit', 'njit', 'numba.guvectorize'})


def parameters(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """
    Return how many parameters a function has; `self` and `cls` are none.
    """
    given = node.args
    named = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(named) - (bool(named) and named[0] in ('self', 'cls'))


def count(tree: Path) -> Count:
    """
    Count the package of a tree.
    """
    package = tree / PACKAGE
    found = Count()
    for path in sorted(package.rglob('*.py')):
        held = code_lines(path)
        room = path.relative_to(package).parent.as_posix().partition('/')[0].strip('.')
        core, module = room != 'studies', path.name != '__init__.py'
        found.raw += len(path.read_text(encoding='utf-8').splitlines())
        found.lines += len(held)
        found.core += len(held) * core
        found.outer += len(held) * (room in OUTER)
        found.numbers += numbers(path) if room not in OUTER else Counter()
        found.modules += module
        found.core_modules += module and core
        for node, is_compiled in functions(path):
            place = f'{path.relative_to(package)}:{node.name}'
            long = len(held & set(range(node.lineno, (node.end_lineno or 0) + 1)))
            if long > LINES and not is_compiled:
                found.long.append((place, long))
            if parameters(node) > PARAMETERS and not is_compiled:
                found.wide.append((place, parameters(node)))
    return found


def dotted(path: Path, tree: Path) -> str:
    """
    Return the name by which a source file is imported.
    """
    return '.'.join(path.relative_to(tree).with_suffix('').parts).removesuffix('.__init__')


@cache
def imports(path: Path) -> tuple[str, ...]:
    """
    Return the dotted names that a source file imports, wherever in it.
    """
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            found += (f'{node.module}.{alias.name}' for alias in node.names)
    return tuple(found)


def circles(tree: Path) -> set[frozenset[str]]:
    """
    Return the modules of each room of a tree that import each other in a circle.
    """
    files = {dotted(path, tree): path for path in (tree / PACKAGE).glob('*/**/*.py')}
    below = {}
    for name, path in files.items():
        named = (each if each in files else each.rpartition('.')[0] for each in imports(path))
        room = name.split('.')[1]
        below[name] = {each for each in named if each in files and each.split('.')[1] == room} - {
            name
        }
    for by in files:  # Warshall: what is reached by way of each
        for name in files:
            if by in below[name]:
                below[name] = below[name] | below[by]
    return {
        frozenset(each for each in below[name] if name in below[each])
        for name in files
        if name in below[name]
    }


def walk(
    tree: Path, line: list[str], module: str, function: str
) -> tuple[list[list[str]], list[str]]:
    """
    Run a command line of a tree in a process of its own, traced below one function.

    Returns
    -------
    calls, modules
        Calls from one room into another, each pair of functions once; modules of
        which a function was called. What calls within compiled code is not seen.
    """
    code = WALK.format(tree=str(tree), line=line, module=module, function=function)
    done = of_tree(tree, '-c', code)
    printed = [each for each in done.stdout.splitlines() if each.startswith('WALKED ')]
    if not printed:
        raise SystemExit(f'{tree}: {" ".join(line)} failed:\n{done.stderr[-2000:]}')
    calls, modules = json.loads(printed[0].removeprefix('WALKED '))
    return calls, modules


def of_tree(tree: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """
    Run Python in a tree.
    """
    environment = {**os.environ, 'PYTHONPATH': str(tree)}
    line = [sys.executable, *words]
    return subprocess.run(line, capture_output=True, text=True, env=environment, cwd=tree)


def figures(tree: Path, folder: Path) -> dict[str, tuple[int, int | None]]:
    """
    Return the figures of a tree, by name, each with its aim.
    """
    held = count(tree)
    bag = folder / f'{len(list(folder.iterdir()))}.mcap'
    simulate = ['simulate', '--ship', str(tree / 'config' / 'vitus_bering.yaml'), '-o', str(bag)]
    simulate += ['--lead-in', '900', '--seed', '5', '--effect', 'current=0.4']
    of_tree(tree, '-m', f'{PACKAGE}.cli', *simulate).check_returncode()
    calls, _ = walk(tree, ['replay', str(bag)], 'playback.py', 'replay')
    _, modules = walk(tree, ['diagnose', str(bag)], 'diagnosis/diagnose.py', 'diagnose')
    return {
        'lines, with docstrings, comments and blanks': (held.raw, None),
        'lines of code': (held.lines, None),
        'lines of code, core': (held.core, 24_000),
        'lines of code, outer rooms': (held.outer, 14_500),
        'modules': (held.modules, 210),
        'modules, core': (held.core_modules, None),
        'numbers in constants, inner rooms': (held.numbers['constants'], 200),
        'numbers in printed tables, inner rooms': (held.numbers['printed'], None),
        'numbers within functions, inner rooms': (held.numbers['code'], None),
        'calls from room to room, bytes of a bag to bytes published': (len(calls), 25),
        'modules that run in a diagnosis': (len(modules), 45),
        f'functions over {LINES} lines of code': (len(held.long), 0),
        f'functions over {PARAMETERS} parameters': (len(held.wide), 0),
        'import circles': (len(circles(tree)), 0),
        'lines of code, tests': (lines(tree / 'tests'), 25_000),
        'lines of code, benchmarks': (lines(tree / 'benchmarks'), 10_000),
        'words, README and docs': (words(tree), 25_000),
    }


def lines(folder: Path) -> int:
    """
    Return how many lines of code a folder has.
    """
    return sum(len(code_lines(path)) for path in folder.rglob('*.py'))


def words(tree: Path) -> int:
    """
    Return how many words and numbers the pages have; bars and dashes of tables are none.
    """
    pages = [tree / 'README.md', *(tree / 'docs').glob('*.md')]
    return sum(len(re.findall(r'\S*\w\S*', page.read_text(encoding='utf-8'))) for page in pages)


def main() -> None:
    """
    Print the table, and what is too long or too wide in the last tree.
    """
    trees = [each.resolve() for each in asked(__doc__, tree=[ROOT]).tree]
    with tempfile.TemporaryDirectory() as folder:
        columns = [figures(tree, Path(folder)) for tree in trees]
    print('| | ' + ' | '.join(tree.name for tree in trees) + ' | aim |')
    print('|---|' + '---:|' * len(trees) + '---:|')
    for name in columns[0]:
        aim = columns[-1][name][1]
        cells = [name, *(each[name][0] for each in columns), '' if aim is None else aim]
        print(f'| {" | ".join(map(str, cells))} |')
    last = count(trees[-1])
    for place, many in (*last.long, *last.wide):
        print(f'{place}: {many}')


if __name__ == '__main__':
    main()
