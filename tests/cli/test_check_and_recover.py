# SPDX-License-Identifier: Apache-2.0
"""`check` and `recover` as a user meets them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.cli import main

KEYS = {
    'messages_recovered',
    'messages_crc_suspect',
    'bytes_read',
    'bytes_lost',
    'damage',
    'output',
    'quarantine',
}


def told(line: list[str], capsys: pytest.CaptureFixture[str], status: int = 0) -> Any:
    capsys.readouterr()
    assert main([*line, '--json']) == status
    return json.loads(capsys.readouterr().out)


@pytest.fixture
def damaged(steady_bag: Path, tmp_path: Path) -> Path:
    """The bag with a bit flipped in its middle, and cut off at nine tenths."""
    content = bytearray(steady_bag.read_bytes())
    content[len(content) // 2] ^= 4
    path = tmp_path / 'damaged.mcap'
    path.write_bytes(content[: len(content) * 9 // 10])
    return path


def test_a_sound_bag(steady_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    about = told(['check', str(steady_bag)], capsys)
    assert about['sound'] is True
    (file,) = about['files']
    assert (file['messages'], file['damage']) == (4 * 302, [])
    output = tmp_path / 'saved.mcap'
    result = told(['recover', str(steady_bag), '-o', str(output)], capsys)
    assert set(result) == KEYS
    assert result['messages_recovered'] == 4 * 302
    assert result['bytes_read'] == steady_bag.stat().st_size
    assert (result['bytes_lost'], result['damage'], result['quarantine']) == (0, [], None)
    replayed = [told(['replay', str(path)], capsys) for path in (steady_bag, output)]
    assert replayed[0]['inputs'] == replayed[1]['inputs']


def test_a_damaged_bag_is_told_by_offset_and_what_is_saved_is_sound(damaged, tmp_path, capsys):
    assert main(['check', str(damaged)]) == 1
    words = capsys.readouterr().out
    assert 'NOT SOUND' in words
    assert 'missing' in words
    about = told(['check', str(damaged)], capsys, status=1)
    assert about['sound'] is False
    (file,) = about['files']
    size = damaged.stat().st_size
    assert {(each['record'], each['kind']) for each in file['damage']} >= {('footer', 'missing')}
    assert all(0 <= each['offset'] <= size for each in file['damage'])
    output = tmp_path / 'saved.mcap'
    result = told(['recover', str(damaged), '-o', str(output)], capsys)
    assert set(result) == KEYS
    assert {'offset', 'record', 'kind'} == set().union(*result['damage'])
    assert any(each['record'] == 'chunk' for each in result['damage'])
    for path, messages in (
        (result['output'], result['messages_recovered']),
        (result['quarantine'], result['messages_crc_suspect']),
    ):
        if path is not None:
            (saved,) = told(['check', path], capsys)['files']
            assert (saved['sound'], saved['messages']) == (True, messages)
    assert main(['recover', str(damaged), '-o', str(output)]) == 1
    assert 'exists; choose another name' in capsys.readouterr().err
    assert main(['recover', str(damaged), '-o', str(tmp_path / 'in_words.mcap')]) == 0
    words = capsys.readouterr().out
    assert 'bytes gave nothing' in words
    assert 'chunk' in words


def test_of_a_damaged_index_it_is_said_that_the_data_are_whole(steady_bag, tmp_path, capsys):
    content = bytearray(steady_bag.read_bytes())
    content[-12] ^= 4  # the checksum of the summary
    path, output = tmp_path / 'index.mcap', tmp_path / 'saved.mcap'
    path.write_bytes(content)
    assert main(['check', str(path)]) == 1
    capsys.readouterr()
    document = tmp_path / 'recover.json'
    assert main(['recover', str(path), '-o', str(output), '--json', str(document)]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'All data are whole. The index of' in said
    (damage,) = json.loads(document.read_text())['damage']
    assert damage.keys() == {'offset', 'record', 'kind'}
    assert damage['record'] == 'summary'
    assert main(['check', str(output)]) == 0
    content[len(content) // 2] ^= 4  # and a chunk
    path.write_bytes(content)
    assert main(['check', str(path)]) == 1
    said = ' '.join(capsys.readouterr().out.split())
    assert re.search(
        r' channel message counts of 1, 2, 3, 4; message count 1208, in the data \d+ ', said
    )


@pytest.mark.parametrize('verb', [['check'], ['recover', '-o', 'saved.mcap']])
def test_no_bag_is_an_error(verb: list[str], tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'text.mcap').write_text('no bag at all')
    for name in ('nowhere.mcap', 'text.mcap'):
        assert main([verb[0], name, *verb[1:]]) == 1
        assert capsys.readouterr().err.startswith(f"ERROR: '{name}'")


def test_recover_asks_where_to_write(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(['recover', 'a.mcap'])
    assert end.value.code == 2
    assert '-o/--out' in capsys.readouterr().err
