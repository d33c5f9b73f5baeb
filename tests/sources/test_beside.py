# SPDX-License-Identifier: Apache-2.0
"""The file of a run is the same one to `replay` and to `fleet`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import shipdrag_ros as sd
from shipdrag_ros.cli import main
from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.fleet.find import find
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.sources.beside import sheet_of
from shipdrag_ros.sources.reading import read_any
from tests.runs import write_run


@pytest.fixture(scope='module')
def content(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A table, and bags of it."""
    folder = tmp_path_factory.mktemp('made')
    table, bag = folder / 'a.csv', folder / 'a.mcap'
    table.write_text('time_s,STW [kn]\n0,12.0\n1,11.9\n')
    (run,) = read_any([table])
    run.save(bag, {})
    about = {'storage_identifier': 'mcap', 'relative_file_paths': ['bag_0.mcap']}
    metadata = f'rosbag2_bagfile_information: {about}'.encode()
    return {'.csv': table.read_bytes(), '.mcap': bag.read_bytes(), '.yaml': metadata}


@pytest.mark.parametrize(
    ('bags', 'sheets', 'holds', 'noted'),
    [
        (['a.mcap'], ['run.yaml'], 'run.yaml', False),
        (['a.mcap', 'b.mcap'], ['run.yaml'], '', True),
        (['a.mcap', 'b.mcap'], ['run.yaml', 'a.mcap.run.yaml'], 'a.mcap.run.yaml', True),
        (['a.mcap', 'b.mcap'], ['a.run.yaml'], 'a.run.yaml', False),
        (['run_1.mcap', 'run_2.mcap'], ['run.yaml'], '', True),
        (['part_000.mcap', 'part_1000_2.mcap'], ['run.yaml'], 'run.yaml', False),
        (['a.mcap', 'a.csv'], ['run.yaml'], 'run.yaml', True),
        (['a.csv', 'a.mcap'], ['run.yaml'], '', True),
        (['a.csv'], ['run.yaml'], 'run.yaml', False),
        (['a.csv', 'b.csv'], ['run.yaml'], '', True),
        (['a.csv', 'b.csv', 'truth.csv'], ['a.csv.run.yaml'], 'a.csv.run.yaml', False),
        (['a.csv', 'truth.csv', 'events.csv'], ['run.yaml'], 'run.yaml', False),
        (['2026.11.30.csv', '2026.12.01.csv'], ['2026.run.yaml'], '', False),
        (['bag/bag_0.mcap', 'bag/metadata.yaml'], ['run.yaml'], 'run.yaml', False),
        (['bag/bag_0.mcap', 'bag/metadata.yaml'], ['bag/run.yaml'], 'bag/run.yaml', False),
        (['bag/bag_0.mcap', 'bag/metadata.yaml'], ['bag.run.yaml'], 'bag.run.yaml', False),
        (['bag/bag_0.mcap', 'bag/metadata.yaml', 'more.csv'], ['run.yaml'], 'run.yaml', True),
    ],
)
def test_the_file_of_a_run(
    bags: list[str], sheets: list[str], holds: str, noted: bool, content, tmp_path: Path
) -> None:
    for name in bags:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content[Path(name).suffix])
    for name in sheets:
        (tmp_path / name).write_text(f'{{draught_m: {len(name)}}}')
    wanted = len(holds) or None

    said: list[str] = []
    (run,) = read_any([tmp_path / bags[0]])
    sheet, where = sheet_of(run, said.append)
    assert (sheet.draught_m, where) == (wanted, str(tmp_path / holds) if holds else '')
    assert ['used for none' in text for text in said] == [False] * bool(holds) or noted

    found = find([str(tmp_path)])
    texts = {each.bag: each.run for each in found.sources}
    assert texts[bags[0].rpartition('/')[0] or bags[0]] == (
        f'{{draught_m: {wanted}}}' if holds else ''
    )
    assert ['used for none' in note for note in found.notes] == [True] * noted
    (alone,) = find([str(tmp_path / bags[0])]).sources
    assert alone.run == texts.get(bags[0], alone.run)
    assert alone.may_be_part == bags[0].startswith('part_')


def test_two_files_of_a_run_are_one_too_many(content, tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_bytes(content['.csv'])
    for name in ('run.yaml', 'a.run.yaml'):
        (tmp_path / name).write_text('{}')
    (run,) = read_any([tmp_path / 'a.csv'])
    with pytest.raises(ShipFileError, match='two run files'):
        sheet_of(run, print)
    (skipped,) = find([str(tmp_path)]).skipped
    assert 'two run files' in skipped.reason


def test_a_frame_has_no_file_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'run.yaml').write_text('{}')  # of whatever lies where the script was started
    monkeypatch.chdir(tmp_path)
    frame = pd.DataFrame({'t': [0.0, 1.0], 'log': [6.0, 5.9]})
    record = sd.read(frame, columns={'speed_through_water': 'log'}, time='t')
    assert sheet_of(record.runs[0], print)[1] == ''


@pytest.mark.parametrize('verb', [['replay'], ['forecast'], ['diagnose', '--stop', '5']])
def test_a_bag_without_inputs_says_so_before_a_ship_is_asked_for(
    verb: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = Block.of(Channel.HEADING, np.zeros(0, np.int64), np.zeros(0))
    bag = write_run(tmp_path / 'a.mcap', nothing)
    (tmp_path / 'run.yaml').write_text('{draught_m: 8}')
    assert main([*verb, '--', str(bag)]) == 1
    assert 'holds no message' in capsys.readouterr().err
