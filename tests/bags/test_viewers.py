# SPDX-License-Identifier: Apache-2.0
"""What viewers need: a header first, definitions that lack nothing, layouts that fit the bags."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from mcap.reader import make_reader

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS
from shipdrag_ros.messages.publishing import CURVE_FIELDS
from shipdrag_ros.messages.topics import DEFAULT_NODE, RESISTANCE_CURVE

CONFIG = Path(__file__).parents[2] / 'config'
RECORDED = {f'/{name}': accepted[0] for name, accepted in TOPICS.items()} | {
    topic.under(DEFAULT_NODE): topic.type for topic in OUTPUT_TOPICS
}
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
        bag.write('/topic', type_name, b'\0\1\0\0', log_ns=1, publish_ns=1)
    with path.open('rb') as file:
        summary = make_reader(file).get_summary()
    path.unlink()
    assert summary is not None
    (schema,) = summary.schemas.values()
    assert (schema.name, schema.encoding) == (type_name, 'ros2msg')
    main, *others = re.split(r'\n=+\nMSG: ', schema.data.decode())
    return main, {text.split('\n')[0]: text.partition('\n')[2] for text in others}


def kind_of(path: str, directory: Path, type_name: str) -> str:
    """Return the type of the field at the end of a path; KeyError if there is none."""
    main, sections = definition(directory, type_name)
    kind, text = '', main
    for name in path.split('.'):
        kind = {name: kind for kind, name in fields(text)}[name.partition('[')[0]]
        text = sections.get(kind.partition('[')[0], '')
    return kind


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


def test_the_layout_for_foxglove_shows_what_is_recorded(tmp_path: Path) -> None:
    layout = json.loads((CONFIG / 'foxglove_layout.json').read_text())
    panels = layout['configById'].values()
    paths = [path['value'] for panel in panels for path in panel.get('paths', ())]
    paths += [panel['xAxisPath']['value'] for panel in panels if 'xAxisPath' in panel]
    (script,) = layout['userNodes'].values()
    source = script['sourceCode']
    (made,) = re.findall(r'output = "(.+)"', source)
    (used,) = re.findall(r'inputs = \["(.+)"\]', source)
    assert RECORDED[used] == RESISTANCE_CURVE.type
    assert set(re.findall(r'value\("(\w+)"\)', source)) == set(CURVE_FIELDS)
    plain = []
    for path in paths:
        topic, _, field = path.partition('.')
        if topic == made:
            assert re.search(rf'\b{field.rpartition(".")[2]}\b', source)
        elif topic != '/diagnostics':  # live only
            plain.append(kind_of(field, tmp_path, RECORDED[topic]))
    assert set(plain) == {'float64', 'string'}
    shown = set(re.findall(r'"(\w+!\w+)"', json.dumps(layout['layout'])))
    assert shown == set(layout['configById'])


def test_the_layout_for_plotjuggler_shows_what_is_recorded(tmp_path: Path) -> None:
    tree = ElementTree.parse(CONFIG / 'plotjuggler_layout.xml')
    curves = list(tree.iter('curve'))
    assert curves
    for curve in curves:
        for path in (curve.get('curve_x'), curve.get('curve_y') or curve.get('name')):
            if path is not None:
                topic = max((it for it in RECORDED if path.startswith(f'{it}/')), key=len)
                field = path.removeprefix(f'{topic}/').replace('/', '.')
                assert kind_of(field, tmp_path, RECORDED[topic]) == 'float64'
