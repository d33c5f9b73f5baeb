# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet, and what the verb says."""

import json

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.rows import FROUDE, BagResult
from shipdrag_ros.fleet.store import Store, bag_schema, coastdown_schema

DAY_NS = 86_400_000_000_000
START_NS = 1_700_000_000_000_000_000


def result(number, added, *, error=None):
    """A bag of one coastdown, as the fleet writes it."""
    speed = FROUDE * 28.0
    clean = 1e-3 * speed**2
    common = {'content_hash': f'{number:064x}', 'bag': f'{number}.mcap'}
    row = dict.fromkeys(coastdown_schema().names) | {
        **common,
        'time_ns': START_NS + number * 15 * DAY_NS,
        'froude': FROUDE,
        'speed_m_s': speed,
        'resistance_m_s2': (1.0 + added) * clean,
        'sigma_m_s2': 0.03 * clean,
        'sigma_repeatable_m_s2': 0.01 * clean,
        'clean_m_s2': clean,
        'speed_at_stop_m_s': 8.0,
        'length_m': 80.0,
        'displaced_volume_m3': 1000.0,
        'water_density_kg_m3': 1025.0,
        'software_version': '1',
    }
    bag = dict.fromkeys(bag_schema().names) | {
        **common,
        'root': 'r',
        'ship': None if error else 'Test <b>ship</b>',
        'software_version': '1',
        'coastdowns': 0 if error else 1,
        'messages': 1,
        'warnings': [],
        'error': error,
    }
    return BagResult(bag, () if error else (row,))


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / 'store')
    for number in range(12):
        made.write(result(number, 0.01 * number))
    made.write(result(99, 0.0, error='no bag: 3 bytes of text'))
    made.keep_ship('Test <b>ship</b>', {'events.csv': 'date,kind\n2024-02-01,cleaning\n'})
    return made.path


def test_json_is_the_contracts(store, tmp_path, capsys):
    assert main(['trend', str(store), '--json', '--report', str(tmp_path / 'page.html')]) == 0
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


def test_questions_in_sql_read_the_store_and_no_file(store, tmp_path, capsys):
    question = 'select ship, count(*) as n from coastdowns group by ship'
    assert main(['trend', str(store), '--sql', question, '--json']) == 0
    assert json.loads(capsys.readouterr().out)['rows'] == [['Test <b>ship</b>', 12]]
    secret = tmp_path / 'secret.csv'
    secret.write_text('a\n1\n')
    assert main(['trend', str(store), '--sql', f"select * from '{secret}'"]) == 1
    assert main(['trend', str(store), '--sql', 'selec']) == 1
    assert 'the tables are coastdowns and bags' in capsys.readouterr().err


def test_a_folder_that_is_no_store(tmp_path, capsys):
    assert main(['trend', str(tmp_path)]) == 1
    assert 'is no store of a fleet' in capsys.readouterr().err


def test_an_empty_store_says_so(tmp_path, capsys):
    Store(tmp_path / 'store')
    assert main(['trend', str(tmp_path / 'store')]) == 0
    assert 'holds no coastdown: no trend' in capsys.readouterr().out
