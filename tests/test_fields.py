# SPDX-License-Identifier: Apache-2.0
"""A ship file may be any path a user types; none hangs or fills the reader."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.fields import read_small_text
from shipdrag_ros.ship import Ship
from shipdrag_ros.strict_yaml import LARGEST


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    path = tmp_path / 'fifo'
    os.mkfifo(path)
    return path


def test_text_is_read_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / 'text'
    path.write_bytes('\ufeffä'.encode())
    assert read_small_text(path, most_bytes=5) == 'ä'
    with pytest.raises(OSError, match='more than 4 bytes'):
        read_small_text(path, most_bytes=4)


def test_what_is_no_small_regular_file_is_refused(tmp_path: Path, fifo: Path) -> None:
    large = tmp_path / 'large'
    large.write_bytes(b'x' * (LARGEST + 1))
    endless = tmp_path / 'endless'
    endless.symlink_to('/dev/zero')
    for path, said in (
        (fifo, 'no regular file'),
        (endless, 'no regular file'),
        (large, 'more than 1000000 bytes'),
        (tmp_path, 'Is a directory'),
        (tmp_path / 'none', 'No such file'),
    ):
        with pytest.raises(ShipFileError, match=said):
            Ship.load(path)


def test_nothing_of_another_file_is_told(tmp_path: Path) -> None:
    other = tmp_path / 'secrets.yaml'
    other.write_text('password_of_the_bank: hunter2\nusers: [anna]\n')
    with pytest.raises(ShipFileError, match='is no ship file') as told:
        Ship.load(other)
    for secret in ('password', 'hunter2', 'users', 'anna'):
        assert secret not in str(told.value)
    other.write_text('root:x:0:0:root:/root:/bin/bash\n')
    with pytest.raises(ShipFileError) as told:
        Ship.load(other)
    assert 'bash' not in str(told.value)
