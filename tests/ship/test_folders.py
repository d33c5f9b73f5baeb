# SPDX-License-Identifier: Apache-2.0
"""Learnt effects of a folder and of a ship file: one check, in the same words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from shipdrag_ros.errors import EffectFileError, ShipFileError
from shipdrag_ros.ship import LearntTerm, Ship
from shipdrag_ros.ship.term import read_folders
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
    with pytest.raises(EffectFileError, match=r'no \.yaml file'):
        read_folders([tmp_path])
    for name in 'ab':
        (tmp_path / f'{name}.yaml').write_text(WEED.read_text())
    with pytest.raises(EffectFileError, match='that of another'):
        read_folders([tmp_path])
    (tmp_path / 'b.yaml').write_text('name: fouling')
    with pytest.raises(EffectFileError, match=r'b\.yaml'):
        read_folders([tmp_path])


def test_every_bad_file_of_a_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / 'a.yaml').write_text(WEED.read_text().replace('name: weed', 'name: fouling'))
    (tmp_path / 'b.yaml').write_text('{')
    (tmp_path / 'c.yaml').write_text(WEED.read_text().replace('u_c*sqrt(g*L)', 'u_c'))
    with pytest.raises(EffectFileError) as told:
        read_folders([tmp_path, tmp_path / 'none'])
    places = ('b.yaml: ', 'none: cannot be read', 'a.yaml: name', 'c.yaml: term.expression')
    assert len(told.value.problems) == len(places)
    assert all(place in why for place, why in zip(places, told.value.problems, strict=True))


@pytest.mark.parametrize('count', [2, 201])
def test_a_ship_file_and_a_folder_refuse_the_same_in_the_same_words(count: int, tmp_path) -> None:
    texts = [WEED.read_text().replace('name: weed', 'name: fouling')] * 2
    if count > 2:
        texts = [WEED.read_text().replace('name: weed', f'name: weed_{i}') for i in range(count)]
    for i, text in enumerate(texts):
        (tmp_path / f'{i:03d}.yaml').write_text(text)
    terms = tuple(LearntTerm.load(WEED) for _ in texts)
    whole = replace(Ship.example(), learnt=terms).to_yaml()
    for text in texts:
        name = text.partition('name: ')[2].partition('\n')[0]
        whole = whole.replace('name: weed\n', f'name: {name}\n', 1)
    with pytest.raises(EffectFileError) as by_folder:
        read_folders([tmp_path])
    with pytest.raises(ShipFileError) as by_ship:
        Ship.from_yaml(whole, subject='ship')
    found = [
        [problem.partition(start)[2] or problem for problem in told.value.problems]
        for told, start in ((by_folder, '.yaml: '), (by_ship, '].'))
    ]
    assert found[0] == found[1]
    assert ('at most 200' if count > 2 else 'effect of the library') in found[0][0]
