# SPDX-License-Identifier: Apache-2.0
"""No kind of bad input ends in a traceback or a silent success; the page shows them all."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'docs' / 'results' / 'bad_input.txt').read_text(encoding='utf-8')


def _script() -> ModuleType:
    folder = ROOT / 'benchmarks'
    spec = importlib.util.spec_from_file_location('bad_input', folder / 'bad_input.py')
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(folder))
    try:
        spec.loader.exec_module(script)
    finally:
        sys.path.remove(str(folder))
    return script


bad_input = _script()
CASES = bad_input.CASES


@pytest.mark.parametrize('case', CASES, ids=[f'{c.area}: {c.kind}' for c in CASES])
def test_the_user_is_told_what_is_wrong_and_what_to_do(case, tmp_path: Path) -> None:
    if case.process:
        pytest.importorskip('rclpy')
    assert bad_input.faults(case, bad_input.run(case, tmp_path)) == []


def test_the_page_shows_every_kind_with_its_exit_code() -> None:
    for area in dict.fromkeys(case.area for case in CASES):
        section = PAGE.partition(f'## {area}\n')[2].partition('\n## ')[0]
        for case in (case for case in CASES if case.area == area):
            kind = bad_input.cell(case.kind)
            assert f'| {kind} | {case.status} | `` ' in section, (
                f'{kind}: run: python benchmarks/bad_input.py --write'
            )


def test_the_kinds_are_many_and_named_once() -> None:
    names = [(case.area, case.kind) for case in CASES]
    assert len(names) == len(set(names)) >= 45
