# SPDX-License-Identifier: Apache-2.0
"""The page of one coastdown, and the rows for an office."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

import pyarrow.parquet as pq
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.store import read_coastdowns
from shipdrag_ros.trend.export import COLUMNS
from shipdrag_ros.trend.page import coastdown_page, page_name
from tests.page import Page


@pytest.fixture
def row(fleet_store: Path) -> dict[str, Any]:
    """A run with 11 % of added resistance."""
    rows = read_coastdowns(fleet_store).to_pylist()
    return max(rows, key=lambda each: each['time_ns'])


def text_of(row: dict[str, Any], tmp_path: Path) -> str:
    path = tmp_path / 'page.html'
    path.write_text(coastdown_page(row, fleet='fleet.html'))
    return str(Page(path).text)


def test_it_says_what_the_store_knows_of_a_run(row: Any, tmp_path: Path) -> None:
    size = {'value': 0.11, 'sd': 0.02}
    named = [{'name': 'fouling', 'probability': 0.9, 'parameters': {'friction_factor': size}}]
    other = [{'name': 'an effect to come', 'probability': 0.1, 'parameters': {'x': size}}]
    candidates = [
        {'names': ['fouling'], 'probability': 0.9, 'effects': named},
        {'names': ['none'], 'probability': 0.1, 'effects': other},
    ]
    row |= {
        'candidates': json.dumps(candidates),
        'verdict': 'one_of',
        'flags': ['cut'],
        'bag': '<i>',
    }
    said = text_of(row, tmp_path)
    assert 'Test <b>ship</b>: coastdown of' in said  # as text, not as markup
    assert '11.0 ± 6.0 % over the clean hull' in said
    assert 'part of the record was cut' in said
    assert 'fouling 90.0%' in said
    assert 'x 0.110 ± 0.040' in said
    assert "shipdrag diagnose '<i>' --report" in said


def test_it_speaks_of_three_quarters_of_the_speed_at_the_stop(row: Any, tmp_path: Path) -> None:
    said = text_of(row, tmp_path)
    knots = float(said.partition('At ')[2].partition(' knots')[0])
    step = max(b - a for a, b in pairwise(row['speed_m_s']))
    assert knots * 1852.0 / 3600.0 == pytest.approx(0.75 * row['speed_at_stop_m_s'], abs=step)


def test_without_an_estimate_it_says_why(row: Any, tmp_path: Path) -> None:
    nothing = [None] * len(row['froude'])
    row |= {'resistance_m_s2': nothing, 'sigma_m_s2': nothing, 'error': 'too short'}
    said = text_of(row, tmp_path)
    assert 'No estimate: too short.' in said
    assert 'It was not diagnosed.' in said
    assert 'clean_m_s2' not in text_of(row | {'clean_m_s2': None}, tmp_path)


def test_rows_of_the_report_lead_to_pages_and_back(fleet_store: Path, tmp_path: Path) -> None:
    report, pages = tmp_path / 'a' / 'fleet.html', tmp_path / 'the pages'
    report.parent.mkdir()
    line = ['trend', str(fleet_store), '--report', str(report), '--pages', str(pages)]
    assert main(line) == 0
    rows = read_coastdowns(fleet_store).to_pylist()
    assert sorted(path.name for path in pages.iterdir()) == sorted(map(page_name, rows))
    text = report.read_text()
    for each in rows:
        href = f'../the%20pages/{page_name(each)}'
        assert f'<a href="{href}">' in text
        there = Path(urljoin(report.as_uri(), href).removeprefix('file://').replace('%20', ' '))
        assert '<a href="../a/fleet.html">The fleet</a>' in there.read_text()


def test_pages_without_a_report_are_refused(fleet_store: Path, tmp_path, capsys) -> None:
    assert main(['trend', str(fleet_store), '--pages', str(tmp_path)]) == 1
    assert 'give --report' in capsys.readouterr().err


def test_csv_and_parquet_hold_the_same_rows(fleet_store: Path, tmp_path: Path) -> None:
    table, frame = tmp_path / 'rows.csv', tmp_path / 'rows.parquet'
    assert main(['trend', str(fleet_store), '--csv', str(table), '--parquet', str(frame)]) == 0
    with table.open(newline='') as file:
        rows = list(csv.DictReader(file))
    found = pq.read_table(frame).to_pylist()
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == len(found) == 12
    assert [row['bag'] for row in rows] == [row['bag'] for row in found]
    last = found[-1]
    assert last['added_resistance'] == pytest.approx(0.11, abs=1e-6)
    assert last['speed_loss_at_equal_effective_power'] == pytest.approx(1 - 1.11 ** (-1 / 3))
    assert float(rows[-1]['added_resistance']) == last['added_resistance']
    assert rows[-1]['time'].endswith('Z')
    assert main(['trend', str(fleet_store), '--csv', '/proc/rows.csv']) == 1
