# SPDX-License-Identifier: Apache-2.0
"""Folders of learnt effects."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.learning.folder import read_folders
from shipdrag_ros.simulation.effects import LIBRARY, using

WEED = Path(__file__).resolve().parents[2] / 'docs' / 'data' / 'effects' / 'weed.yaml'


def test_the_files_of_a_folder_are_in_the_library_for_a_while() -> None:
    terms = read_folders([WEED.parent])
    before = dict(LIBRARY)
    with using(terms):
        assert set(LIBRARY) - set(before) == {term.name for term in terms}
        with pytest.raises(EffectFileError, match='weed'), using(terms):
            pass
    assert dict(LIBRARY) == before


def test_a_folder_that_cannot_be_used_says_why(tmp_path: Path) -> None:
    with pytest.raises(EffectFileError, match='cannot be read'):
        read_folders([tmp_path / 'none'])
    with pytest.raises(EffectFileError, match=r'0 \.yaml files'):
        read_folders([tmp_path])
    for name in 'ab':
        (tmp_path / f'{name}.yaml').write_text(WEED.read_text())
    with pytest.raises(EffectFileError, match='another file'):
        read_folders([tmp_path])
    (tmp_path / 'b.yaml').write_text('name: fouling')
    with pytest.raises(EffectFileError, match=r'b\.yaml'):
        read_folders([tmp_path])
