# SPDX-License-Identifier: Apache-2.0
"""Cut off, bit-flipped and invented files: never another error than `BagError`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.samples import Block
from tests.bags.test_wild_bags import read_or_refuse

EXAMPLES = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def read(path: Path, content: bytes) -> tuple[Run, Block]:
    path.write_bytes(content)
    (run,) = open_runs([path])
    block = run.inputs().block()
    list(run.outputs())
    return run, block


@pytest.mark.parametrize('fraction', [0.3, 0.6, 0.9, 0.999])
def test_what_is_whole_in_a_file_cut_off_is_used_and_the_rest_told(tmp_path, sample_bag, fraction):
    _, whole = read(tmp_path / 'a.mcap', sample_bag)
    run, block = read(tmp_path / 'a.mcap', sample_bag[: int(fraction * len(sample_bag))])
    assert 0 < len(block) <= len(whole)
    np.testing.assert_array_equal(block.value, whole.value[: len(block)])
    assert 'was not closed, or it is cut off' in run.warnings[0]
    assert run.attachments == {'ship.yaml': 'name: x\n'}
    if fraction < 0.9:
        assert 'is damaged (truncated): left out' in run.warnings[1]
        assert len(block) < len(whole)


def test_a_flipped_bit_costs_one_chunk_and_is_told(tmp_path: Path, sample_bag: bytes) -> None:
    _, whole = read(tmp_path / 'a.mcap', sample_bag)
    damaged = bytearray(sample_bag)
    damaged[len(damaged) // 3] ^= 1
    run, block = read(tmp_path / 'a.mcap', bytes(damaged))
    assert 0 < len(whole) - len(block) < 60
    assert any('the chunk at byte' in warning for warning in run.warnings)
    assert any('messages are there where the index lists' in w for w in run.warnings)
    kept = np.isin(whole.receive_ns, block.receive_ns)
    np.testing.assert_array_equal(whole.value[kept], block.value)


def test_a_damaged_index_is_not_trusted(tmp_path: Path, sample_bag: bytes) -> None:
    _, whole = read(tmp_path / 'a.mcap', sample_bag)
    damaged = bytearray(sample_bag)
    damaged[-200] ^= 1
    run, block = read(tmp_path / 'a.mcap', bytes(damaged))
    np.testing.assert_array_equal(block.value, whole.value)
    assert 'the index has a wrong checksum' in run.warnings[0]


def test_a_damaged_attachment_is_left_out_and_told(tmp_path: Path, sample_bag: bytes) -> None:
    damaged = sample_bag.replace(b'name: x\n', b'name: y\n')
    run, block = read(tmp_path / 'a.mcap', damaged)
    assert run.attachments == {}
    assert len(block) == 200
    assert any("'ship.yaml' has a wrong checksum" in warning for warning in run.warnings)


@pytest.mark.parametrize('opcode', [1, 3, 12, 255])
def test_a_record_of_another_kind_than_indexed(tmp_path, sample_bag: bytes, opcode: int) -> None:
    at = sample_bag.index(b'ship.yaml') - 4 - 8 - 8 - 9
    assert sample_bag[at] == 9, 'the place of the attachment'
    damaged = bytearray(sample_bag)
    damaged[at] = opcode
    run, _ = read(tmp_path / 'a.mcap', bytes(damaged))
    assert any('is not what the index says' in warning for warning in run.warnings)


@EXAMPLES
@given(junk=st.binary(max_size=300), closed=st.booleans())
def test_any_junk_behind_the_magic(tmp_path: Path, junk: bytes, closed: bool) -> None:
    read_or_refuse(tmp_path / 'a.mcap', MAGIC + junk + (MAGIC if closed else b''))


@EXAMPLES
@given(records=st.lists(st.tuples(st.integers(1, 20), st.binary(max_size=80)), max_size=8))
def test_records_with_any_content(tmp_path: Path, records: list[tuple[int, bytes]]) -> None:
    body = b''.join(
        bytes([opcode]) + len(content).to_bytes(8, 'little') + content
        for opcode, content in records
    )
    footer = b'\x02' + (20).to_bytes(8, 'little') + (8).to_bytes(8, 'little') + bytes(12)
    assert read_or_refuse(tmp_path / 'a.mcap', MAGIC + body + footer + MAGIC) is not None
