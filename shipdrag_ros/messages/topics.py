# SPDX-License-Identifier: Apache-2.0
"""
Which topics are subscribed and published, with which types, and the node's own messages.

A bag's topics are matched to the inputs here, in any namespace.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from shipdrag_ros.display import printable
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import types
from shipdrag_ros.samples import FURTHER, Block

_SPEEDS = (types.TWIST_WITH_COVARIANCE, types.TWIST, types.VELOCITY, types.ODOMETRY, types.DVL)
_POSITIONS: tuple[str, ...] = (types.POSE_WITH_COVARIANCE, types.POSE, types.POINT, types.ODOMETRY)
_POSITIONS += (types.NAV_SAT_FIX,)
# one more type: its name in types.py, here, and how it is read at the end of decoding.py
_FIRST: Mapping[str, tuple[str, ...]] = {
    'speed_through_water': _SPEEDS,
    'speed_over_ground': _SPEEDS,
    'position': _POSITIONS,
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
        """Return the full name below a node, `/coastdown_node` for instance."""
        return f'{node}/{self.name}'


DEFAULT_NODE = '/coastdown_node'
SPEED = OutputTopic('speed', types.TWIST_WITH_COVARIANCE)
RESISTANCE = OutputTopic('resistance', types.ACCEL_WITH_COVARIANCE)
RESISTANCE_CURVE = OutputTopic('resistance_curve', types.POINT_CLOUD, latched=True)
FORECAST = OutputTopic('forecast', types.POINT_CLOUD, latched=True)
FORECAST_PATH = OutputTopic('forecast_path', types.PATH, latched=True)
EVENTS = OutputTopic('events', types.DIAGNOSTIC_ARRAY)
DIAGNOSIS = OutputTopic('diagnosis', types.STRING, latched=True)
OUTPUT_TOPICS = (SPEED, RESISTANCE, RESISTANCE_CURVE, FORECAST, FORECAST_PATH, EVENTS, DIAGNOSIS)


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
    pairs = list(dict.fromkeys(_topic_and_input(*each) for each in (remap or {}).items()))
    renamed = dict(pairs)
    problems = _remap_problems(renamed, types_of)
    if len(pairs) > len(renamed):
        problems.append('--remap gives one topic as two inputs; give it as one')

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


@dataclass(frozen=True)
class OutputMessage:
    """A message of the node, ready to be published and recorded."""

    topic: str
    type: str
    payload: bytes
    stamp_ns: int


class EventKind(Enum):
    """What a message on `~/events` reports."""

    ONSET = 'onset'
    COASTDOWN = 'coastdown'
    NO_ESTIMATE = 'no_estimate'
    DISMISSED = 'dismissed'  # nearly a coastdown, or a part of one that was cut
    RESET = 'reset'  # done, whatever the cause
    RESET_REQUEST = 'reset_request'  # asked for from outside: an input of replay
    SILENCE = 'silence'  # by the clock, which no sample shows: an input of replay
    ENGINE_STOPPED = 'engine_stopped'  # a person says so: an input of replay
    LIFECYCLE = 'lifecycle'
    CLOCK_JUMP = 'clock_jump'
    FILES = 'files'  # recordings removed
    MESSAGE_LOST = 'message_lost'  # sent, and not received
    SOURCE = 'source'  # an input is fed by another

    @property
    def is_warning(self) -> bool:
        """Whether an operator should look at it."""
        return self in (
            EventKind.NO_ESTIMATE,
            EventKind.RESET,
            EventKind.CLOCK_JUMP,
            EventKind.FILES,
            EventKind.MESSAGE_LOST,
            EventKind.SOURCE,
            EventKind.SILENCE,
        )


@dataclass(frozen=True)
class EventNote:
    """
    The content of a message on `~/events`.

    `values` are texts by name, the unit at the end of the name.
    """

    kind: EventKind
    stamp_ns: int
    text: str
    values: Mapping[str, str] = field(default_factory=dict)


def diagnosis_message(text: str, stamp_ns: int, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode the document of a diagnosis.

    Parameters
    ----------
    text
        JSON.
    stamp_ns
        End of the coastdown; the message itself holds no time [ns].
    """
    return output_message(DIAGNOSIS, types.make(DIAGNOSIS.type, data=text), stamp_ns, node)


def event_message(note: EventNote, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """Encode a note for `~/events`."""
    kind = types.class_of('diagnostic_msgs/msg/DiagnosticStatus')
    status = types.make(
        'diagnostic_msgs/msg/DiagnosticStatus',
        level=kind.WARN if note.kind.is_warning else kind.OK,
        name=note.kind.value,
        message=note.text,
        values=[
            types.make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
            for key, value in note.values.items()
        ],
    )
    message = types.make(EVENTS.type, header=types.header(note.stamp_ns, ''), status=[status])
    return output_message(EVENTS, message, note.stamp_ns, node)


def read_event(payload: bytes) -> EventNote:
    """
    Decode a message of `~/events`.

    Raises
    ------
    MalformedMessage
        If it is none of this package's.
    """
    message = types.deserialize(EVENTS.type, payload)
    try:
        (status,) = message.status
        kind = EventKind(status.name)
    except ValueError as error:
        raise types.MalformedMessage(f'not an event of the node: {error}') from error
    values = {item.key: item.value for item in status.values}
    return EventNote(kind, types.stamp_ns(message), status.message, values)


def output_message(topic: OutputTopic, message: object, stamp_ns: int, node: str) -> OutputMessage:
    """Encode a message of the node."""
    return OutputMessage(
        topic.under(node), topic.type, types.serialize(topic.type, message), stamp_ns
    )


OK, WARN, ERROR, STALE = range(4)
AHEAD = 'a coastdown from here'
"""Key of what the next coastdown would show."""
OF_CONDITIONS = 'they are'
"""Key of the conditions that the figures of an estimate are of."""
READY_S = 600.0  # of steady sailing from which the noise is known well enough


@dataclass(frozen=True)
class Samples:
    """Readings of the inputs, in order of arrival."""

    block: Block


@dataclass(frozen=True)
class NodeMessage:
    """A message of the node, by the name of its topic below the node."""

    name: str
    payload: bytes


@dataclass(frozen=True)
class ShipFile:
    """The ship file that the node uses."""

    text: str


@dataclass(frozen=True)
class Status:
    """
    One part of a node's health.

    Attributes
    ----------
    node
        As the status names it.
    part
        `state`, `input heading`, `recording`, ...
    level
        One of `OK`, `WARN`, `ERROR`, `STALE`.
    message
    values
        Texts by key, the unit in the key.
    """

    node: str
    part: str
    level: int
    message: str
    values: Mapping[str, str]

    @classmethod
    def of(cls, part: str, level: int, message: str, values: Mapping[str, object]) -> Status:
        """Make a status of values of any kind."""
        return cls('', part, int(level), message, {k: _text(v) for k, v in values.items()})

    @property
    def input(self) -> str:
        """Name of the input that it is of; '' of none."""
        return self.part.removeprefix('input ') if self.part.startswith('input ') else ''

    def number(self, key: str) -> float | None:
        """Return a finite figure, None where there is none; the unit need not be given."""
        for name, text in self.values.items():
            if name == key or name.partition(' [')[0] == key:
                try:
                    value = float(text)
                except ValueError:
                    return None
                return value if math.isfinite(value) else None
        return None


@dataclass(frozen=True)
class Health:
    """All that a node says of itself at one time."""

    statuses: tuple[Status, ...]

    def of(self, part: str) -> Status:
        """Return the status of a part; one that says nothing where there is none."""
        blank = Status.of(part, OK, '', {})
        return next((status for status in self.statuses if status.part == part), blank)

    @property
    def lead(self) -> tuple[float, float] | tuple[None, None]:
        """How long the ship has been steady, and from when the record is ready [s]."""
        state = self.of('state')
        steady_s, most_s = state.number('steady lead'), state.number('steady lead used at most')
        if steady_s is None or most_s is None:
            return None, None
        return steady_s, min(READY_S, most_s)

    @property
    def inputs(self) -> tuple[Status, ...]:
        """Those of the inputs."""
        return tuple(status for status in self.statuses if status.input)


Heard = Samples | NodeMessage | ShipFile | Health


def read_health(payload: bytes) -> list[Health]:
    """
    Decode a message of /diagnostics: the health of each node of this package in it.

    Raises
    ------
    MalformedMessage
        If it is no DiagnosticArray.
    """
    return health_of(types.deserialize(types.DIAGNOSTIC_ARRAY, payload).status)


def health_of(statuses: Iterable[Any]) -> list[Health]:
    """
    Sort statuses by node; those of others, which have no life cycle and monitor, are left out.
    """
    sorted_by_node: dict[str, list[Status]] = {}
    for status in statuses:
        status = _read(status)
        sorted_by_node.setdefault(status.node, []).append(status)
    return [
        Health(tuple(found))
        for found in sorted_by_node.values()
        if any({'lifecycle', 'monitor'} <= status.values.keys() for status in found)
    ]


def _text(value: object) -> str:
    if value is None:
        return 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _read(status: Any) -> Status:
    node, _, part = printable(str(status.name)).rpartition(': ')
    level = status.level  # a byte of rclpy, a number elsewhere
    return Status(
        node=node,
        part=part,
        level=level[0] if isinstance(level, bytes) else int(level),
        message=printable(str(status.message)),
        values={printable(str(item.key)): printable(str(item.value)) for item in status.values},
    )
