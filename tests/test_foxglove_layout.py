# SPDX-License-Identifier: Apache-2.0
"""The layouts for viewers show topics and fields that there are, and their script unpacks r(v)."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from shipdrag_ros.messages import DEFAULT_NODE, OUTPUT_TOPICS, input_type
from shipdrag_ros.messages.publishing import CURVE_FIELDS
from shipdrag_ros.node.health import Standing, state_status
from shipdrag_ros.samples import Channel

CONFIG = Path(__file__).resolve().parents[1] / 'config'
LAYOUT = json.loads((CONFIG / 'foxglove_layout.json').read_text(encoding='utf-8'))
PANELS = LAYOUT['configById']
STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = (
    {f'/{channel.input}': input_type(channel) for channel in Channel}
    | {topic.under(DEFAULT_NODE): topic.type for topic in OUTPUT_TOPICS}
    | {'/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
)
(SCRIPT,) = LAYOUT['userNodes'].values()
SOURCE = SCRIPT['sourceCode']
SCRIPT_OUTPUT = re.findall(r'output = "(.*?)"', SOURCE)[0]
# slice, index or filter behind a field
PART = re.compile(r'(\w+)((?:\[(?:\d+|:)\])?)((?:\{\w+==".*?"\})?)')


def panels_of(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
        return
    assert set(tree) == {'direction', 'first', 'second', 'splitPercentage'}
    assert tree['direction'] in ('row', 'column')
    assert 0 < tree['splitPercentage'] < 100
    yield from panels_of(tree['first'])
    yield from panels_of(tree['second'])


def paths() -> Iterator[str]:
    for panel in PANELS.values():
        yield from (path['value'] for path in panel.get('paths', []))
        if 'xAxisPath' in panel:
            yield panel['xAxisPath']['value']
        if 'topicPath' in panel:
            yield panel['topicPath']
        if 'topicToRender' in panel:
            yield panel['topicToRender']


def leaf(type_name: str, fields: str) -> str:
    """Follow a path of fields; return the type at its end."""
    while fields:
        found = PART.match(fields)
        assert found is not None, fields
        name, index, condition = found.groups()
        kind, content = dict(STORE.fielddefs[type_name][1])[name]
        if kind.name in ('ARRAY', 'SEQUENCE'):
            assert index, f'{name} is an array'
            kind, content = content[0]
        else:
            assert not index, f'{name} is no array'
        type_name = content if kind.name == 'NAME' else content[0]
        if condition:
            key = condition[1:].partition('==')[0]
            assert key in dict(STORE.fielddefs[type_name][1])
        fields = fields[found.end() :].removeprefix('.')
    return type_name


def test_the_tree_shows_every_panel_once() -> None:
    assert sorted(panels_of(LAYOUT['layout'])) == sorted(PANELS)
    kinds = {name.partition('!')[0] for name in PANELS}
    assert kinds == {'Plot', 'StateTransitions', 'DiagnosticSummary', 'RawMessages'}
    assert set(LAYOUT) == {
        'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout',
    }  # fmt: skip


@pytest.mark.parametrize('path', sorted(set(paths())))
def test_every_path_is_a_topic_and_a_field(path: str) -> None:
    topic, _, fields = path.partition('.')
    if topic == SCRIPT_OUTPUT:
        name = fields.removeprefix('points[:].')
        assert re.search(rf'\b{name}: number', SOURCE), f'the script gives no {name}'
        return
    assert topic in TYPES
    end = leaf(TYPES[topic], fields)
    if fields and path != PANELS['RawMessages!event']['topicPath']:
        assert end in ('float64', 'string')


def test_speed_resistance_curve_and_state_are_shown() -> None:
    shown = {path.partition('.')[0] for path in paths()}
    assert {topic.under(DEFAULT_NODE) for topic in OUTPUT_TOPICS[:2]} <= shown
    assert {'/speed_through_water', '/diagnostics', f'{DEFAULT_NODE}/events'} <= shown
    assert SCRIPT_OUTPUT in shown
    for panel in PANELS.values():
        assert ('xAxisPath' in panel) == (panel.get('xAxisVal') in ('custom', 'currentCustom'))


def test_a_path_to_nothing_is_found() -> None:
    for wrong in ('twist.linear.w', 'twist.twist.speed', 'twist.covariance'):
        with pytest.raises((AssertionError, KeyError)):
            leaf(TYPES['/speed_through_water'], wrong)


def test_the_state_has_the_name_that_the_node_gives_it() -> None:
    status = state_status(Standing('active', None, clock_ns=1, sim_time=False), [])
    name = f'{DEFAULT_NODE.lstrip("/")}: {status.part}'
    assert any(f'{{name=="{name}"}}' in path for path in paths())


def test_the_script_unpacks_the_curve(tmp_path: Path) -> None:
    assert re.findall(r'inputs = \["(.*?)"\]', SOURCE) == [f'{DEFAULT_NODE}/resistance_curve']
    assert set(re.findall(r'value\("(\w+)"\)', SOURCE)) == set(CURVE_FIELDS)
    node = shutil.which('node')
    if node is None:
        pytest.skip('node is not installed')
    # without its types it is JavaScript
    plain = re.sub(r'^(import|type) .*$', '', SOURCE, flags=re.MULTILINE)
    plain = re.sub(r': (Input<.*?>|Point\[\]|Output|string|number)(?=[),; ={])', '', plain)
    offsets = ', '.join(
        f'{{name: "{name}", offset: {8 * k}}}' for k, name in enumerate(CURVE_FIELDS)
    )
    module = tmp_path / 'script.mjs'
    module.write_text(
        f"""{plain}
const values = new Float64Array([NaN, 2, 0.01, 0.001, 0.05, 4, 0.03, 0.002, 0.1]);
const data = new Uint8Array(values.buffer, 8);
const message = {{width: 2, point_step: 32, data, fields: [{offsets}]}};
console.log(JSON.stringify(script({{message}})));
"""
    )
    done = subprocess.run([node, module], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    points = json.loads(done.stdout)['points']
    assert [list(point.values()) for point in points] == [
        pytest.approx([2, 0.01, 0.008, 0.012, 0.05], rel=1e-12),
        pytest.approx([4, 0.03, 0.026, 0.034, 0.1], rel=1e-12),
    ]


def test_plotjuggler_curves_are_topics_and_fields() -> None:
    root = ElementTree.parse(CONFIG / 'plotjuggler_layout.xml').getroot()
    names = []
    for plot in root.iter('plot'):
        for curve in plot.iter('curve'):
            if plot.get('mode') == 'XYPlot':
                names += [curve.get('curve_x', ''), curve.get('curve_y', '')]
            else:
                names.append(curve.get('name', ''))
    assert len(names) == 6
    for name in names:
        topic = next(each for each in TYPES if name.startswith(f'{each}/'))
        assert leaf(TYPES[topic], name.removeprefix(f'{topic}/').replace('/', '.')) == 'float64'
