# SPDX-License-Identifier: Apache-2.0
"""What viewers need: a header first, and definitions that lack nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS, EncodedMessage
from tests.recorded import summary

TYPES = sorted(
    {type_name for accepted in TOPICS.values() for type_name in accepted}
    | {topic.type for topic in OUTPUT_TOPICS}
)
UNSTAMPED = ('std_msgs/msg/Float64', 'std_msgs/msg/String')
PRIMITIVE = re.compile(r'(bool|byte|char|u?int(8|16|32|64)|float(32|64)|w?string)(<=\d+)?')


def fields(text: str) -> list[tuple[str, str]]:
    """Return (type, name) of the fields of one definition; constants are none."""
    lines = [line.partition('#')[0].split() for line in text.splitlines()]
    return [(line[0], line[1]) for line in lines if len(line) > 1 and '=' not in ''.join(line[1:])]


def definition(directory: Path, type_name: str) -> tuple[str, dict[str, str]]:
    """Return the definition of a type as a bag holds it, and those it needs by their names."""
    path = directory / 'a.mcap'
    with BagWriter(path) as bag:
        bag.put(EncodedMessage('/topic', type_name, b'\0\1\0\0', 1, 1))
    (schema,) = summary(path).schemas.values()
    path.unlink()
    assert (schema.name, schema.encoding) == (type_name, 'ros2msg')
    main, *others = re.split(r'\n=+\nMSG: ', schema.data.decode())
    return main, {text.split('\n')[0]: text.partition('\n')[2] for text in others}


@pytest.mark.parametrize('type_name', TYPES)
def test_definitions_are_complete_and_begin_with_a_header(tmp_path: Path, type_name: str) -> None:
    main, sections = definition(tmp_path, type_name)
    if type_name not in UNSTAMPED:
        assert fields(main)[0] == ('std_msgs/Header', 'header')
    needed = set()
    for text in (main, *sections.values()):
        for kind, _ in fields(text):
            base = kind.partition('[')[0]
            if not PRIMITIVE.fullmatch(base):
                needed.add(base)
    assert needed == set(sections)
