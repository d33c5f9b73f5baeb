# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet, and what the verb says."""

import json

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.store import Store


def test_json_is_the_contracts(fleet_store, tmp_path, capsys):
    assert (
        main(['trend', str(fleet_store), '--json', '--report', str(tmp_path / 'page.html')]) == 0
    )
    found = json.loads(capsys.readouterr().out)
    [ship] = found['ships']
    assert ship['name'] == 'Test <b>ship</b>'
    assert (ship['coastdowns'], ship['rank'], ship['cleaning_pays_from']) == (12, 1, None)
    assert set(ship['added_resistance'][0]) == {
        'time_ns',
        'bag',
        'value',
        'sd',
        'used',
        'reason',
    }
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


def test_questions_in_sql_read_the_store_and_no_file(fleet_store, tmp_path, capsys):
    question = 'select ship, count(*) as n from coastdowns group by ship'
    assert main(['trend', str(fleet_store), '--sql', question, '--json']) == 0
    assert json.loads(capsys.readouterr().out)['rows'] == [['Test <b>ship</b>', 12]]
    secret = tmp_path / 'secret.csv'
    secret.write_text('a\n1\n')
    assert main(['trend', str(fleet_store), '--sql', f"select * from '{secret}'"]) == 1
    assert main(['trend', str(fleet_store), '--sql', 'selec']) == 1
    assert 'the tables are coastdowns and bags' in capsys.readouterr().err


def test_a_folder_that_is_no_store(tmp_path, capsys):
    assert main(['trend', str(tmp_path)]) == 1
    assert 'is no store of a fleet' in capsys.readouterr().err


def test_an_empty_store_says_so(tmp_path, capsys):
    Store(tmp_path / 'store')
    assert main(['trend', str(tmp_path / 'store')]) == 0
    assert 'holds no coastdown: no trend' in capsys.readouterr().out
