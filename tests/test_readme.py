# SPDX-License-Identifier: Apache-2.0
"""The README says what the code does, and its commands exist."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from benchmarks import figures

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / 'README.md').read_text(encoding='utf-8')
FILES = sorted(set(re.findall(r'(?:benchmarks|docs|config)/[\w./-]+\w', TEXT)))


def test_tables_are_made_from_the_code() -> None:
    spec = importlib.util.spec_from_file_location('tables', ROOT / 'docs' / 'tables.py')
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    for page, of_page in tables.PAGES.items():
        text = page.read_text(encoding='utf-8')
        assert tables.updated(text, of_page) == text, 'run: python docs/tables.py'


def test_it_is_read_in_minutes() -> None:
    assert len(TEXT.splitlines()) <= 150
    assert len(TEXT.split()) <= 1500


def test_opens_with_the_two_commands() -> None:
    opening = TEXT[: TEXT.index('## ')]
    makefile = (ROOT / 'Makefile').read_text()
    for target in ('demo', 'test'):
        assert f'make {target}' in opening
        assert re.search(rf'^{target}:', makefile, flags=re.MULTILINE)


@pytest.mark.parametrize('path', FILES)
def test_every_file_it_names_exists(path: str) -> None:
    assert (ROOT / path).exists()


def test_its_figures_are_those_of_the_results() -> None:
    trend = (ROOT / 'docs' / 'results' / 'trend.txt').read_text(encoding='utf-8')
    (ships,) = re.findall(r'trend_score --ships (\d+)', trend)
    (found,) = re.findall(r'one cleaning of 5 % that nobody noted.*?\| (\d+) %', trend)
    assert f'{int(ships) * int(found) // 100} of {ships} simulated ships' in TEXT
    # each figure stands once, as its file has it
    assert figures.page() == figures.PAGE.read_text(encoding='utf-8'), 'benchmarks.figures'
