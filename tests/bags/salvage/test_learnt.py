# SPDX-License-Identifier: Apache-2.0
"""Of two declarations that differ, the one that is vouched for is believed."""

from __future__ import annotations

import pytest
from mcap.records import Schema

from shipdrag_ros.bags.salvage.learnt import Learnt, Trust


def schema(name: str) -> Schema:
    return Schema(data=b'', encoding='ros2msg', id=1, name=name)


@pytest.mark.parametrize('first', Trust)
@pytest.mark.parametrize('second', Trust)
def test_the_better_vouched_for_stands(first: Trust, second: Trust) -> None:
    learnt = Learnt()
    assert learnt.add(schema('a'), first)
    assert learnt.add(schema('b'), second) == (second > first)
    assert learnt.schemas[1].name == ('b' if second > first else 'a')
    assert learnt.add(schema(learnt.schemas[1].name), first)  # what is known agrees
