# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet, and what the verb says."""

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
from shipdrag_ros.fleet.store import Store, read_coastdowns
from shipdrag_ros.trend.page import coastdown_page, page_name
from shipdrag_ros.trend.words import COLUMNS
from tests.page import Page

NAME = 'Test <b>ship</b>'


def test_json_is_the_contracts(fleet_store, tmp_path, capsys):
    assert (
        main(['trend', str(fleet_store), '--json', '--report', str(tmp_path / 'page.html')]) == 0
    )
    found = json.loads(capsys.readouterr().out)
    [ship] = found['ships']
    assert ship['name'] == 'Test <b>ship</b>'
    assert (ship['coastdowns'], ship['rank'], ship['cleaning_pays_from']) == (12, 1, None)
    assert set(ship['added_resistance'][0]) == {'time_ns', 'bag', 'value', 'sd', 'used', 'reason'}
    assert set(ship['now']) == {'value', 'sd', 'power_kw'}
    assert set(ship['growth_per_year']) == {'value', 'sd'}
    [event] = ship['events']
    assert set(event) == {'time_ns', 'kind', 'known', 'probability', 'change'}
    assert event['kind'] == 'cleaning'
    assert found['skipped'] == [{'bag': '99.mcap', 'reason': 'no bag: 3 bytes of text'}]
    page = (tmp_path / 'page.html').read_text()
    assert 'Test &lt;b&gt;ship&lt;/b&gt;' in page
    assert '<b>ship</b>' not in page
    assert 'data:image/svg+xml' in page
    # power goes about as the cube of the speed
    loss = 1.0 - (1.0 + ship['now']['value']) ** (-1.0 / 3.0)
    assert f', about {loss:.1%} of speed lost at equal effective power.' in page


@pytest.mark.parametrize(
    ('question', 'row'),
    [
        (
            'select date::date, round(added_percent, 1), used from runs order by date limit 1',
            ['2023-11-14', 0.0, True],
        ),
        (
            'select count(*), min(resistance_kn) > 0 from runs where usd_per_year is null',
            [12, True],
        ),
        ('select ship, rank, added_percent > 5, usd_per_year from ships', [NAME, 1, True, None]),
        ('select to_timestamp(min(time_ns) / 1e9) from coastdowns', ['2023-11-14 22:13:20+00:00']),
        ('select [1, 2], 1.5::decimal(4, 2), null', [[1, 2], '1.50', None]),
    ],
)
def test_what_an_office_asks_is_answered(fleet_store, capsys, question, row):
    assert main(['trend', str(fleet_store), '--sql', question, '--json']) == 0
    out, table = capsys.readouterr()
    assert json.loads(out)['rows'] == [row]
    assert table


def test_questions_in_sql_read_the_store_and_no_file(fleet_store, tmp_path, capsys):
    question = 'select ship, count(*) as n from coastdowns group by ship'
    assert main(['trend', str(fleet_store), '--sql', question, '--json']) == 0
    assert json.loads(capsys.readouterr().out)['rows'] == [['Test <b>ship</b>', 12]]
    secret = tmp_path / 'secret.csv'
    secret.write_text('a\n1\n')
    assert main(['trend', str(fleet_store), '--sql', f"select * from '{secret}'"]) == 1
    assert main(['trend', str(fleet_store), '--sql', 'selec']) == 1
    assert main(['trend', str(fleet_store), '--sql', 'select * from trends']) == 1
    assert main(['trend', str(fleet_store), '--sql', '']) == 1
    assert (
        main(['trend', str(fleet_store), '--sql', question, '--csv', str(tmp_path / 'x.csv')]) == 1
    )
    said = capsys.readouterr().err
    assert '--sql: leave out --csv' in said
    assert not (tmp_path / 'x.csv').exists()
    assert main(['trend', str(fleet_store), '--sql', 'select froude from coastdowns limit 1']) == 0
    assert '77 values' in capsys.readouterr().out
    assert main(['trend', str(fleet_store), '--sql', 'select * from coastdowns limit 2']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 120
    assert [line.split()[-1] for line in lines if line.startswith('froude  ')] == ['values'] * 2
    assert 'the tables are runs (ship, date, added_percent' in said
    assert 'begin with SELECT' in said


def test_a_folder_that_is_no_store(tmp_path, capsys):
    assert main(['trend', str(tmp_path)]) == 1
    assert 'is no store of a fleet' in capsys.readouterr().err


def test_an_empty_store_says_so(tmp_path, capsys):
    Store(tmp_path / 'store')
    assert main(['trend', str(tmp_path / 'store')]) == 0
    assert 'holds no coastdown: no trend' in capsys.readouterr().out


@pytest.fixture
def latest(fleet_store: Path) -> dict[str, Any]:
    """A run with 11 % of added resistance."""
    rows = read_coastdowns(fleet_store).to_pylist()
    return max(rows, key=lambda each: each['time_ns'])


def text_of(latest: dict[str, Any], tmp_path: Path) -> str:
    path = tmp_path / 'page.html'
    path.write_text(coastdown_page(latest, fleet='fleet.html'))
    return str(Page(path).text)


def test_it_says_what_the_store_knows_of_a_run(latest: Any, tmp_path: Path) -> None:
    size = {'value': 0.11, 'sd': 0.02}
    named = [{'name': 'fouling', 'probability': 0.9, 'parameters': {'friction_factor': size}}]
    other = [{'name': 'an effect to come', 'probability': 0.1, 'parameters': {'x': size}}]
    candidates = [
        {'names': ['fouling'], 'probability': 0.9, 'effects': named},
        {'names': ['none'], 'probability': 0.1, 'effects': other},
    ]
    latest |= {
        'candidates': json.dumps(candidates),
        'verdict': 'one_of',
        'flags': ['cut'],
        'bag': '<i>',
    }
    said = text_of(latest, tmp_path)
    assert 'Test <b>ship</b>: coastdown of' in said  # as text, not as markup
    assert '11.0 ± 6.0 % over the clean hull' in said
    assert 'part of the record was cut' in said
    assert 'fouling 90.0%' in said
    assert 'x 0.110 ± 0.040' in said
    assert "shipdrag diagnose '<i>' --report" in said


def test_it_speaks_of_three_quarters_of_the_speed_at_the_stop(latest: Any, tmp_path: Path) -> None:
    said = text_of(latest, tmp_path)
    knots = float(said.partition('At ')[2].partition(' knots')[0])
    step = max(b - a for a, b in pairwise(latest['speed_m_s']))
    assert knots * 1852.0 / 3600.0 == pytest.approx(0.75 * latest['speed_at_stop_m_s'], abs=step)


def test_without_an_estimate_it_says_why(latest: Any, tmp_path: Path) -> None:
    nothing = [None] * len(latest['froude'])
    latest |= {'resistance_m_s2': nothing, 'sigma_m_s2': nothing, 'error': 'too short'}
    said = text_of(latest, tmp_path)
    assert 'No estimate: too short.' in said
    assert 'It was not diagnosed.' in said
    assert 'clean_m_s2' not in text_of(latest | {'clean_m_s2': None}, tmp_path)


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
    assert [latest['bag'] for latest in rows] == [latest['bag'] for latest in found]
    last = found[-1]
    assert last['added_resistance'] == pytest.approx(0.11, abs=1e-6)
    assert last['speed_loss_at_equal_effective_power'] == pytest.approx(1 - 1.11 ** (-1 / 3))
    assert float(rows[-1]['added_resistance']) == last['added_resistance']
    assert rows[-1]['time'].endswith('Z')
    assert main(['trend', str(fleet_store), '--csv', '/proc/rows.csv']) == 1
