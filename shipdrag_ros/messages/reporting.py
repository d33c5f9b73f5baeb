# SPDX-License-Identifier: Apache-2.0
"""
What the node says on `~/events` and `~/diagnosis`, as messages and back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from shipdrag_ros.messages import types
from shipdrag_ros.messages.topics import DEFAULT_NODE, DIAGNOSIS, EVENTS, OutputTopic


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
    values: Mapping[str, str]


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
    payload = types.serialize(DIAGNOSIS.type, types.make(DIAGNOSIS.type, data=text))
    return OutputMessage(DIAGNOSIS.under(node), DIAGNOSIS.type, payload, stamp_ns)


def reset_request(receive_ns: int, reason: str, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that a reset was asked for, so that replay resets there too.

    To be recorded before the reset is done, at log time `receive_ns`. Resets
    that the monitor decides by itself need none: the samples bring them about.
    """
    return event_message(EventNote(EventKind.RESET_REQUEST, receive_ns, reason, {}), node=node)


def silence_mark(receive_ns: int, reason: str, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that all sources are silent, so that replay ends a coastdown there too.

    To be recorded before the coastdown is ended, at log time `receive_ns`.
    """
    return event_message(EventNote(EventKind.SILENCE, receive_ns, reason, {}), node=node)


def stop_mark(receive_ns: int, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that a person said that the engine was stopped just then, so that replay takes it too.

    To be recorded before the monitor takes it, at log time `receive_ns`.
    """
    note = EventNote(EventKind.ENGINE_STOPPED, receive_ns, 'the engine was stopped', {})
    return event_message(note, node=node)


def event_message(note: EventNote, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode a note for `~/events`.
    """
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
    """
    Encode a message of the node.
    """
    return OutputMessage(
        topic.under(node), topic.type, types.serialize(topic.type, message), stamp_ns
    )
