# SPDX-License-Identifier: Apache-2.0
"""Records are known by their own lengths."""

from __future__ import annotations

import struct

import pytest
from mcap.opcode import Opcode

from shipdrag_ros.bags.salvage.layout import fits


@pytest.mark.parametrize(('length', 'plausible'), [(0, True), (65536, True), (65537, False)])
def test_a_name_longer_than_any_is_no_name(length: int, plausible: bool) -> None:
    head = struct.pack('<I4sI', 4, b'ros2', length) + bytes(length)
    assert fits(head, Opcode.HEADER, 0, len(head)) is plausible
