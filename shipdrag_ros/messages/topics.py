# SPDX-License-Identifier: Apache-2.0
"""
Which topics are heard and published, and with which types.

A bag's topics are matched to the inputs here, in any namespace.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import types
from shipdrag_ros.samples import FURTHER

_FIRST: Mapping[str, tuple[str, ...]] = {
    'speed_through_water': (
        types.TWIST_WITH_COVARIANCE,
        types.TWIST,
        types.VELOCITY,
        types.ODOMETRY,
        types.DVL,
    ),
    'speed_over_ground': (
        types.TWIST_WITH_COVARIANCE,
        types.TWIST,
        types.VELOCITY,
        types.ODOMETRY,
        types.DVL,
    ),
    'position': (
        types.POSE_WITH_COVARIANCE,
        types.POSE,
        types.POINT,
        types.ODOMETRY,
        types.NAV_SAT_FIX,
    ),
    'heading': (types.QUATERNION, types.IMU, types.POSE, types.FLOAT64),
    'shaft': (types.JOINT_STATE,),
    'rudder': (types.JOINT_STATE,),
    'wind_apparent': (types.TWIST,),
    'depth': (types.RANGE,),
}
TOPICS: Mapping[str, tuple[str, ...]] = {
    **_FIRST,
    **{name: _FIRST[kind] for name, kind in FURTHER.items()},
}
"""Each input and the types it is accepted in, the preferred first."""


@dataclass(frozen=True)
class OutputTopic:
    """A topic of the node, `name` below the node's own name."""

    name: str
    type: str
    latched: bool = False

    def under(self, node: str) -> str:
        """
        Return the full name below a node, `/coastdown_node` for instance.
        """
        return f'{node}/{self.name}'


DEFAULT_NODE = '/coastdown_node'
SPEED = OutputTopic('speed', types.TWIST_WITH_COVARIANCE)
RESISTANCE = OutputTopic('resistance', types.ACCEL_WITH_COVARIANCE)
RESISTANCE_CURVE = OutputTopic('resistance_curve', types.POINT_CLOUD, latched=True)
FORECAST = OutputTopic('forecast', types.POINT_CLOUD, latched=True)
FORECAST_PATH = OutputTopic('forecast_path', types.PATH, latched=True)
EVENTS = OutputTopic('events', types.DIAGNOSTIC_ARRAY)
DIAGNOSIS = OutputTopic('diagnosis', types.STRING, latched=True)
OUTPUT_TOPICS: tuple[OutputTopic, ...] = (
    SPEED,
    RESISTANCE,
    RESISTANCE_CURVE,
    FORECAST,
    FORECAST_PATH,
    EVENTS,
    DIAGNOSIS,
)


@dataclass(frozen=True)
class Source:
    """An input as it is sent: the key to its decoder."""

    input: str
    type: str


@dataclass(frozen=True)
class MatchedTopics:
    """
    The topics of a bag, sorted by what becomes of them.

    Attributes
    ----------
    heard
        Source of each (topic, type) that carries an input.
    unaccepted
        Input of each (topic, type) that should carry one, and whose type is
        not accepted or not the one type heard.
    """

    heard: dict[tuple[str, str], Source]
    unaccepted: dict[tuple[str, str], str]


def match_inputs(
    topics: Iterable[tuple[str, str]], *, remap: Mapping[str, str] | None = None, own: bool = False
) -> MatchedTopics:
    """
    Find the inputs among the topics of a bag.

    Parameters
    ----------
    topics
        (topic, type) pairs as recorded.
    remap
        Recorded topic -> input, before any match by name; also input -> topic, as ROS writes
        a remapping, where the second is no input.

    own
        Whether a node recorded them, which has used every accepted type one after the other;
        of others the preferred one is used.

    Raises
    ------
    BagError
        If an input is found under two topics, or a remap names nothing.
    """
    types_of: dict[str, list[str]] = {}
    for topic, type_name in topics:
        types_of.setdefault(_absolute(topic), []).append(type_name)
    renamed = dict(_topic_and_input(*each) for each in (remap or {}).items())
    problems = _remap_problems(renamed, types_of)

    heard: dict[tuple[str, str], Source] = {}
    unaccepted: dict[tuple[str, str], str] = {}
    for name, accepted in TOPICS.items():
        candidates = [topic for topic in types_of if renamed.get(topic) == name]
        if not candidates:
            candidates = [
                topic
                for topic in types_of
                if topic not in renamed and topic.rpartition('/')[2] == name
            ]
        audible = [topic for topic in candidates if set(types_of[topic]) & set(accepted)]
        if len(audible) > 1:
            problems.append(
                f'{name}: found under {len(audible)} topics, {", ".join(sorted(audible))}; '
                f'choose one with --remap {sorted(audible)[0]}:={name}'
            )
            continue
        if audible:
            there = [each for each in accepted if each in types_of[audible[0]]]
            for chosen in there if own else there[:1]:
                heard[audible[0], chosen] = Source(name, chosen)
        unaccepted |= {
            (topic, type_name): name
            for topic in candidates
            for type_name in types_of[topic]
            if (topic, type_name) not in heard
        }
    if problems:
        raise BagError('topics cannot be matched to inputs: ' + '; '.join(problems))
    return MatchedTopics(heard, unaccepted)


def _remap_problems(renamed: Mapping[str, str], types_of: Mapping[str, list[str]]) -> list[str]:
    problems = [
        f'--remap {topic}:={name}: no topic {topic!r} in the bag; '
        f'it has {", ".join(sorted(types_of)) or "none"}'
        for topic, name in renamed.items()
        if topic not in types_of
    ]
    problems += [
        f'--remap {topic}:={name}: no input {name!r}; inputs are {", ".join(TOPICS)}'
        for topic, name in renamed.items()
        if name not in TOPICS
    ]
    return problems


def _topic_and_input(one: str, other: str) -> tuple[str, str]:
    if other.strip('/') not in TOPICS and one.strip('/') in TOPICS:
        one, other = other, one
    return _absolute(one), other.strip('/')


def _absolute(topic: str) -> str:
    return topic if topic.startswith('/') else f'/{topic}'
