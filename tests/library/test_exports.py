# SPDX-License-Identifier: Apache-2.0
"""What `import shipdrag_ros` offers, and what it costs: nothing until it is used."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import shipdrag_ros as sd

SOURCE = Path(sd.__file__)


def test_every_name_that_is_exported_is_there() -> None:
    for name in sd.__all__:
        assert getattr(sd, name) is not None
    assert dir(sd) == sd.__all__
    assert len(sd.__all__) <= 15


def test_what_is_not_there_is_said_as_python_does() -> None:
    with pytest.raises(AttributeError, match=r"module 'shipdrag_ros' has no attribute 'nothing'"):
        _ = sd.nothing  # type: ignore[attr-defined]


def test_the_type_checker_sees_each_name_where_it_is_imported_from() -> None:
    tree = ast.parse(SOURCE.read_text(encoding='utf-8'))
    typed = {
        alias.name: (node.module or '').removeprefix('shipdrag_ros.')
        for branch in tree.body
        if isinstance(branch, ast.If)
        for node in branch.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == sd._HOME
    assert sorted(typed) == sd.__all__


def test_the_import_brings_no_other_module_of_the_package() -> None:
    code = (
        'import sys, shipdrag_ros; '
        'print(*(name for name in sys.modules if name.split(".")[0] in '
        '{"shipdrag_ros", "numpy", "numba"}))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True, timeout=200
    )
    assert done.stdout.split() == ['shipdrag_ros']


def test_reading_and_estimating_imports_no_pictures() -> None:
    code = (
        'import sys, shipdrag_ros as sd; sd.read, sd.estimate; '
        'print(*({"matplotlib", "pandas", "shipdrag_ros.diagnosis"} & {*sys.modules}))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True, timeout=200
    )
    assert done.stdout.split() == []
