# SPDX-License-Identifier: Apache-2.0
"""The page of a paper says what its script computes, where that costs nothing."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from benchmarks import figures

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize('name', ['s2_cable'])
def test_the_page_has_the_numbers_of_its_script(name: str) -> None:
    script = importlib.import_module(f'benchmarks.accuracy.{name}')
    shown = (ROOT / 'docs' / f'{name}.md').read_text(encoding='utf-8')
    begin, end = '<!-- numbers -->\n', '\n<!-- end numbers -->'
    numbers = shown.partition(begin)[2].partition(end)[0]
    assert numbers == script.numbers(), f'run: python -m benchmarks.accuracy.{name} --write'
    for picture in script.PICTURES:
        assert (ROOT / 'docs' / 'pictures' / picture).stat().st_size < 150_000


def test_the_page_of_figures_is_as_its_result_files_make_it() -> None:
    shown = (ROOT / 'docs' / 'figures.md').read_text(encoding='utf-8')
    assert shown == figures.page(), 'run: python -m benchmarks.figures'
    missing = figures.FIGURES[0]._replace(pattern='no such row (.)')
    with pytest.raises(SystemExit, match='does not answer'):
        figures.found(missing)
    # what the README says of the final curve
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    for figure, words in zip(figures.FIGURES, ('is within', 'under gusts within'), strict=False):
        error = float(figures.found(figure).split()[2])
        said = re.search(rf'{words} ([\d.]+) %', readme.replace('\n', ' '))
        assert said is not None
        assert float(said[1]) == pytest.approx(error, abs=0.051)


def test_what_the_readme_says_of_trends_is_what_was_counted() -> None:
    counted = (ROOT / 'docs' / 'results' / 'trend.txt').read_text(encoding='utf-8')
    [ships] = re.findall(r'trend_score --ships (\d+)', counted)
    [share] = re.findall(r'found and dated within a month \| (\d+) %', counted)
    [false] = re.findall(r'\| false steps \| (\d+) \|', counted)
    found = round(int(share) / 100 * int(ships))
    readme = ' '.join((ROOT / 'README.md').read_text(encoding='utf-8').split())
    assert f'{found} of {ships} simulated ships, with {false} false ones in 100' in readme
