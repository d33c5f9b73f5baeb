# SPDX-License-Identifier: Apache-2.0
"""The page of a paper says what its script computes, where that costs nothing."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize('name', ['s2_cable'])
def test_the_page_is_as_its_script_makes_it(name: str) -> None:
    spec = importlib.util.spec_from_file_location(name, ROOT / 'benchmarks' / f'{name}.py')
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    shown = (ROOT / 'docs' / f'{name}.md').read_text(encoding='utf-8')
    assert shown == script.page(), f'run: python benchmarks/{name}.py --write'
    for picture in script.PICTURES:
        assert (ROOT / 'docs' / 'pictures' / picture).stat().st_size < 150_000
