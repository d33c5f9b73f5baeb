# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet, and what the verb says."""

import json

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.store import Store

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
    assert 'the tables are runs (ship, date, added_percent' in said
    assert 'begin with SELECT' in said


def test_a_folder_that_is_no_store(tmp_path, capsys):
    assert main(['trend', str(tmp_path)]) == 1
    assert 'is no store of a fleet' in capsys.readouterr().err


def test_an_empty_store_says_so(tmp_path, capsys):
    Store(tmp_path / 'store')
    assert main(['trend', str(tmp_path / 'store')]) == 0
    assert 'holds no coastdown: no trend' in capsys.readouterr().out
