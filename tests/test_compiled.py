# SPDX-License-Identifier: Apache-2.0
"""Compiled code never outlives its source, wherever it is kept and whatever was kept before."""

from __future__ import annotations

import ast
import os
import random
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from mypy import api

from shipdrag_ros import compiled as subject

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'shipdrag_ros'
SOURCES = sorted(PACKAGE.rglob('*.py'))
NOWHERE = '/dev/null/nowhere'  # no user can make a folder there, not even root

# a package of three modules: a constant, what uses it, and what calls that from another file
CONSTANT = 'FACTOR = 2.0\n'
CALLEE = """
from shipdrag_ros.compiled import compiled
from shipdrag_ros.constant import FACTOR

@compiled
def scale(x: float) -> float:
    return FACTOR * x
"""
CALLER = """
from shipdrag_ros.callee import scale
from shipdrag_ros.compiled import compiled

@compiled('f8(f8)')
def twice(x: float) -> float:
    return scale(x) + scale(x)
"""
CALL = 'from shipdrag_ros.caller import twice; print(twice(1.0))'


def run(package: Path, code: str, *, timeout: float = 250.0, **settings: str) -> tuple[str, str]:
    """Run code in a process of its own; return what it printed and what it complained of."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ('SHIPDRAG_CACHE_DIR', 'XDG_CACHE_HOME') and not name.startswith('NUMBA_')
    }
    environment |= {'PYTHONPATH': str(package), 'PYTHONDONTWRITEBYTECODE': '1', **settings}
    done = subprocess.run(
        [sys.executable, '-c', code],
        cwd=package,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


def kept(cache: Path) -> list[Path]:
    return sorted(path for path in cache.rglob('*') if path.is_file())


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    """Make a package with the decorator as it is and three small modules."""
    folder = tmp_path / 'toy' / 'shipdrag_ros'
    folder.mkdir(parents=True)
    shutil.copy(PACKAGE / 'compiled.py', folder)
    (folder / '__init__.py').touch()
    for name, text in (('constant', CONSTANT), ('callee', CALLEE), ('caller', CALLER)):
        (folder / f'{name}.py').write_text(text)
    return folder.parent


@pytest.fixture
def call(toy: Path, tmp_path: Path) -> Callable[[], str]:
    return lambda: run(toy, CALL, SHIPDRAG_CACHE_DIR=str(tmp_path / 'cache'))[0]


def test_only_the_decorator_compiles() -> None:
    """One that numba itself compiles would be kept by the date of one file."""
    found = [
        str(path.relative_to(PACKAGE))
        for path in SOURCES
        if re.search(r'\b(jit|njit|jitclass|vectorize|guvectorize|cfunc|stencil)\b(?=[(\s,])',
                     path.read_text()) and 'numba' in path.read_text()
    ]  # fmt: skip
    assert found == ['compiled.py']


def test_all_that_a_module_imports_is_in_its_digest() -> None:
    """Held beside Python's own parser, for every module of the package."""
    modules = {
        '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__'): path
        for path in SOURCES
    }
    for module, path in modules.items():
        wanted = set()
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert not node.level, path  # else the decorator must learn to follow it
                wanted |= {node.module} | {f'{node.module}.{alias.name}' for alias in node.names}
        assert wanted & modules.keys() <= subject.read(module)[1], module


def test_text_elsewhere_a_date_and_the_place_compile_nothing_anew(
    toy: Path, call: Callable[[], str]
) -> None:
    source = toy / 'shipdrag_ros' / 'elsewhere.py'
    source.write_text('"""Imports `shipdrag_ros.caller`, but nothing compiled imports it."""')
    call()
    cache = toy.parent / 'cache'
    before = {path: path.stat().st_mtime_ns for path in kept(cache)}
    assert len(before) == 2
    source.write_text('"""Another text."""')
    os.utime(toy / 'shipdrag_ros' / 'callee.py', (0, 0))  # nor does a date
    moved = shutil.copytree(toy, toy.parent / 'moved')
    assert run(moved, CALL, SHIPDRAG_CACHE_DIR=str(cache)) == ('4.0', '')
    assert {path: path.stat().st_mtime_ns for path in kept(cache)} == before


def test_an_edit_acts_at_once(toy: Path, call: Callable[[], str]) -> None:
    assert call() == '4.0'
    for module, old, new, result in (
        ('constant', 'FACTOR = 2.0', 'FACTOR = 7.0', '14.0'),
        ('callee', 'FACTOR * x', 'FACTOR + x', '6.0'),
        ('caller', '+ scale(x)', '- scale(x)', '0.0'),
    ):
        file = toy / 'shipdrag_ros' / f'{module}.py'
        date = file.stat()
        edit(file, old, new)
        os.utime(file, ns=(date.st_atime_ns, date.st_mtime_ns))  # a date says nothing
        assert call() == result  # and the edit before, taken back, acts no more
        edit(file, new, old)
    assert call() == '4.0'


def test_what_is_damaged_is_compiled_again(toy: Path, call: Callable[[], str]) -> None:
    call()
    cache = toy.parent / 'cache'
    whole = {path: path.read_bytes() for path in kept(cache)}
    for damage in (lambda b: b'', lambda b: b[:-100] + bytes(100)):
        for path, content in whole.items():
            path.write_bytes(damage(content))
        assert call() == '4.0'
        assert [len(path.read_bytes()) for path in whole] == [len(b) for b in whole.values()]


def test_only_old_folders_of_ours_are_removed(tmp_path: Path) -> None:
    cache, target = tmp_path / 'cache', tmp_path / 'target'
    versions = [cache / f'caller-{number:016x}' for number in range(subject._KEPT + 3)]
    other, gone = cache / f'other-{0:016x}', cache / f'moved.away-{0:016x}'
    foreign, link = cache / 'caller-of-somebody', cache / f'caller-{99:016x}'
    for folder in (*versions, other, gone, foreign, target):
        folder.mkdir(parents=True)
        (folder / 'file').touch()
    link.symlink_to(target)
    now = time.time()
    for age, folder in enumerate(versions):
        os.utime(folder, (now - age, now - age))
    for folder in (gone, foreign, target):
        os.utime(folder, (0, 0))
    subject._forget_old(versions[0])
    assert set(cache.iterdir()) == {*versions[: subject._KEPT], other, foreign, link}
    assert (target / 'file').exists()


def test_where_nothing_can_be_written_it_works_and_says_so_once(toy: Path) -> None:
    code = f'import tempfile; tempfile.tempdir = {NOWHERE!r}; {CALL}'
    result, complaint = run(toy, code, HOME=NOWHERE)
    assert result == '4.0'
    assert complaint.count('\n') == 1
    assert 'compiled code is not kept' in complaint
    assert 'SHIPDRAG_CACHE_DIR' in complaint


def test_without_a_home_it_is_kept_where_nobody_else_writes(toy: Path, tmp_path: Path) -> None:
    place = tmp_path / f'shipdrag_ros-{os.getuid()}'
    place.mkdir(mode=0o777)
    for _ in range(2):
        assert run(toy, CALL, HOME=NOWHERE, TMPDIR=str(tmp_path)) == ('4.0', '')
    assert len(kept(place)) == 2
    for folder in (place, *{path.parent for path in kept(place)}):
        assert folder.stat().st_mode & 0o777 == 0o700


def test_a_link_that_somebody_laid_is_not_followed(toy: Path, tmp_path: Path) -> None:
    theirs = tmp_path / 'theirs'
    theirs.mkdir()
    (tmp_path / f'shipdrag_ros-{os.getuid()}').symlink_to(theirs)
    result, complaint = run(toy, CALL, HOME=NOWHERE, TMPDIR=str(tmp_path))
    assert result == '4.0'
    assert 'somebody else' in complaint
    assert not kept(theirs)


def test_a_given_folder_that_cannot_be_used_is_said(toy: Path, tmp_path: Path) -> None:
    settings = {'SHIPDRAG_CACHE_DIR': NOWHERE, 'XDG_CACHE_HOME': str(tmp_path)}
    result, complaint = run(toy, CALL, **settings)
    assert result == '4.0'
    assert f'SHIPDRAG_CACHE_DIR is not used ({NOWHERE}: Not a directory)' in complaint
    assert len(kept(tmp_path / 'shipdrag_ros')) == 2


def test_a_folder_that_vanishes_while_it_runs_is_made_again(toy: Path, tmp_path: Path) -> None:
    made = 'import shutil; from shipdrag_ros.compiled import cache_root; cache_root()'
    code = f'{made}; shutil.rmtree({str(tmp_path / "c")!r}); {CALL}'
    assert run(toy, code, SHIPDRAG_CACHE_DIR=str(tmp_path / 'c')) == ('4.0', '')
    assert len(kept(tmp_path / 'c')) == 2


def test_the_machine_code_is_for_any_processor_of_its_kind(toy: Path, tmp_path: Path) -> None:
    """Also where something else has imported numba before: no bit depends on the processor."""
    for before in ('', 'import numba; '):
        settings = {'SHIPDRAG_CACHE_DIR': str(tmp_path / f'c{len(before)}')}
        show = 'from numba.core.registry import cpu_target as t; '
        show += 'print(t.target_context.codegen().magic_tuple()[1:])'
        found, _ = run(toy, f'{before}{CALL}; {show}', **settings)
        assert found.split('\n') == ['4.0', "('generic', '')"]


def test_numba_that_compiled_before_is_said(toy: Path, tmp_path: Path) -> None:
    before = 'import numba; numba.njit(lambda: 1)(); '
    found, said = run(toy, f'{before}{CALL}', SHIPDRAG_CACHE_DIR=str(tmp_path))
    assert found == '4.0'
    assert said.count('the last digits may differ') == 1


def test_two_threads_at_once_may_need_the_compiler_first(toy: Path) -> None:
    """The second comes in the middle of the import, whose modules import each other."""
    code = """if True:
        import sys, threading, time
        from shipdrag_ros.caller import twice
        def work(): sys.stdout.write(f'{twice(1.0)}\\n')
        other = threading.Thread(target=work)
        def watch(event, values):
            if event == 'import' and values[0] == 'numba.misc.special' and not other.ident:
                other.start()
                time.sleep(0.5)
        sys.addaudithook(watch)
        work()
        other.join()
    """
    assert run(toy, code) == ('4.0\n4.0', '')


def test_a_closure_is_refused() -> None:
    outer = 1.0
    with pytest.raises(TypeError, match='stands in a module'):
        subject.compiled(lambda: outer)


def test_the_type_checker_sees_what_calls_a_compiled_function(tmp_path: Path) -> None:
    snippet = tmp_path / 'snippet.py'
    whiten = 'from shipdrag_ros.inference.rows import whiten\n'
    products = 'from shipdrag_ros.inference.linear import products_of\n'
    wrong = "products_of('wrong')\nproducts_of()\n"
    snippet.write_text(f"{whiten}{products}whiten(1, 2, 3, 'wrong')\n{wrong}")
    # with the options of `make types`, whose cache it takes; others would empty it
    told, _, status = api.run(['--config-file', str(ROOT / 'pyproject.toml'), str(snippet)])
    assert status == 1
    assert 'Too many arguments for "whiten"' in told
    assert 'Argument 1 to "products_of" has incompatible type "str"' in told
    assert 'Missing positional argument "table" in call to "products_of"' in told


# a live estimate, a final one and the noise of a diagnosis, printed to the last bit
ESTIMATES = """
import numpy as np
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.inference.rows import GaussMarkovNoise, Noise, whiten
from shipdrag_ros.inference.rows import LOG, POSITION, Rows
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

rng = np.random.default_rng(0)
time_s = np.arange(0.0, 900.0, 2.0)
n, stamps = len(time_s), (time_s * 1e9).astype(np.int64)
coasting_s = np.maximum(time_s - 300.0, 0.0)
way = np.minimum(time_s, 300.0) * 8.0 + 4000.0 * np.log1p(coasting_s / 500.0)
speed = 8.0 / (1.0 + coasting_s / 500.0) + 0.05 * rng.standard_normal(n)
place = np.column_stack([way, 0.3 * way]) / np.hypot(1.0, 0.3) + 5.0 * rng.standard_normal((n, 2))
block = in_arrival_order([
    Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed),
    Block.of(Channel.POSITION, stamps, place),
])
window = Window.from_block(block, 300_000_000_000, 900_000_000_000, before_ns=0)
ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
for each in (estimate, estimate_final):
    found = each(window, ship, Parameters())
    print(found.estimator, found.curve.speed_m_s.tobytes().hex(),
          found.curve.resistance_m_s2.tobytes().hex(), found.curve.sigma_m_s2.tobytes().hex())
kind = np.where(np.arange(n) % 2, LOG, POSITION)
slow = GaussMarkovNoise(1e-3, 90.0, 0.02, 600.0, 0.05, 50.0, 2.0, 50.0)
table = np.array([speed, way])
noise = Noise(np.full(n, 0.01), slow, np.full(n, 2e-3), np.full(n, 1.05))
whiten(Rows(time_s, kind, speed), table, noise)
print(table.tobytes().hex())
"""
# functions that call those of another file, and what they call
CALLING, CALLED = 'inference.linear', 'inference.rows'


@pytest.mark.timeout(900)
def test_the_bits_of_an_estimate_do_not_depend_on_what_was_kept(tmp_path: Path) -> None:
    """Callers are compiled anew, with half of their callees as they were kept and half anew."""
    result, _ = run(ROOT, ESTIMATES, timeout=800.0)  # compiled here where it never was
    assert len(result) > 10_000
    cache = tmp_path / 'cache'
    for path in SOURCES:
        folder = subject._folder('.'.join(path.relative_to(ROOT).with_suffix('').parts))
        if folder is not None and folder.exists():
            shutil.copytree(folder, cache / folder.name)
    of = {path: path.parent.name.rpartition('-')[0] for path in kept(cache)}
    callers, callees = ([path for path in of if of[path] == name] for name in (CALLING, CALLED))
    assert callers
    assert callees
    for path in callers + random.Random(0).sample(callees, len(callees) // 2):
        path.unlink()
    assert run(ROOT, ESTIMATES, timeout=800.0, SHIPDRAG_CACHE_DIR=str(cache))[0] == result
    # what is kept may hold compiled variants that these estimates do not call
    assert any(path.exists() for path in callers)
