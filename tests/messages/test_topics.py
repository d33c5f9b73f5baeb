# SPDX-License-Identifier: Apache-2.0
"""Topics of a bag are found by name, in any namespace, or by a remap."""

from __future__ import annotations

import pytest

from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import TOPICS, Source, decoding, match_inputs
from shipdrag_ros.samples import INPUTS

TWIST = 'geometry_msgs/msg/TwistStamped'
TWIST_COVARIANCE = 'geometry_msgs/msg/TwistWithCovarianceStamped'


def test_every_accepted_type_has_a_decoder_and_no_other() -> None:
    accepted = {Source(name, kind) for name, kinds in TOPICS.items() for kind in kinds}
    assert set(decoding._readings()) == accepted
    assert tuple(TOPICS) == INPUTS


@pytest.mark.parametrize(
    'topic', ['/speed_through_water', '/a/b/speed_through_water', 'speed_through_water']
)
def test_any_namespace(topic: str) -> None:
    matched = match_inputs([(topic, TWIST), ('/log/speed_through_water_raw', TWIST)])
    (source,) = matched.heard.values()
    assert source == Source('speed_through_water', TWIST)
    assert matched.unaccepted == {}


def test_two_namespaces_are_an_error_that_lists_both() -> None:
    topics = [('/a/depth', 'sensor_msgs/msg/Range'), ('/b/depth', 'sensor_msgs/msg/Range')]
    with pytest.raises(BagError, match=r'depth: found under 2 topics, /a/depth, /b/depth'):
        match_inputs(topics)
    chosen = match_inputs(topics, remap={'/b/depth': 'depth'})
    assert list(chosen.heard) == [('/b/depth', 'sensor_msgs/msg/Range')]


def test_all_ambiguities_are_reported_together() -> None:
    topics = [(f'/{n}/{name}', TWIST) for n in 'ab' for name in TOPICS if 'speed' in name]
    with pytest.raises(BagError, match=r'(?s)through_water: .*over_ground: '):
        match_inputs(topics)


def test_a_type_that_is_not_accepted_is_reported_and_not_heard() -> None:
    matched = match_inputs(
        [('/depth', 'std_msgs/msg/Float32'), ('/x/depth', 'sensor_msgs/msg/Range')]
    )
    assert list(matched.heard) == [('/x/depth', 'sensor_msgs/msg/Range')]
    assert matched.unaccepted == {('/depth', 'std_msgs/msg/Float32'): 'depth'}


def test_of_two_types_on_one_topic_the_preferred_is_heard() -> None:
    matched = match_inputs(
        [('/speed_over_ground', TWIST), ('/speed_over_ground', TWIST_COVARIANCE)]
    )
    assert list(matched.heard) == [('/speed_over_ground', TWIST_COVARIANCE)]
    assert matched.unaccepted == {('/speed_over_ground', TWIST): 'speed_over_ground'}


def test_a_remapped_topic_is_heard_and_no_longer_under_its_own_name() -> None:
    matched = match_inputs(
        [('/speed_through_water', TWIST)], remap={'speed_through_water': 'speed_over_ground'}
    )
    assert list(matched.heard.values()) == [Source('speed_over_ground', TWIST)]


def test_a_remap_takes_both_orders_where_one_side_is_an_input() -> None:
    topics = [('/log/speed', TWIST), ('/speed_through_water', TWIST)]
    ours = match_inputs(topics, remap={'/log/speed': 'speed_through_water'})
    assert match_inputs(topics, remap={'speed_through_water': '/log/speed'}) == ours
    with pytest.raises(BagError, match='gives one topic as two inputs'):
        match_inputs(topics, remap={'/log/speed': 'speed_through_water', 'depth': '/log/speed'})
    assert list(ours.heard) == [('/log/speed', TWIST)]
