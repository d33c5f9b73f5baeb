# SPDX-License-Identifier: Apache-2.0
"""`shipdrag fleet` in a file: how far it is, now and then; tests/fleet/ tries the rest."""

from __future__ import annotations

import pytest

from shipdrag_ros.cli import main


@pytest.mark.parametrize('given', ['0', '-1', 'two', '1025'])
def test_a_number_of_workers_that_is_none_is_refused(given: str, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['fleet', 'x', '-o', 'y', f'--workers={given}'])
    assert ended.value.code == 2
    assert 'expected a whole number from 1 to 1024' in capsys.readouterr().err


def test_where_no_bag_lies_no_store_is_left(tmp_path, capsys) -> None:
    store = tmp_path / 'store'
    (tmp_path / 'empty').mkdir()
    assert main(['fleet', str(tmp_path / 'empty'), '-o', str(store)]) == 1
    assert 'no bag lies below' in capsys.readouterr().err
    assert not store.exists()


def test_bags_in_the_folder_of_the_store_are_not_passed_over_in_silence(tmp_path, capsys) -> None:
    (tmp_path / 'bags' / 'ship').mkdir(parents=True)
    store = str(tmp_path / 'bags')
    for place in (store, f'{store}/ship'):
        assert main(['fleet', place, '-o', store]) == 1
        assert f'{place!r} lies in the store {store!r}' in capsys.readouterr().err
