# SPDX-License-Identifier: Apache-2.0
"""CDR bytes to samples, and samples and events to CDR bytes, without ROS."""

from shipdrag_ros.messages.decoding import Decoded, Unreadable, decode
from shipdrag_ros.messages.encoding import EncodedMessage, encode, input_type
from shipdrag_ros.messages.topics import (
    DEFAULT_NODE,
    OUTPUT_TOPICS,
    TOPICS,
    EventKind,
    EventNote,
    MatchedTopics,
    OutputMessage,
    OutputTopic,
    Source,
    event_message,
    match_inputs,
    read_event,
)
from shipdrag_ros.messages.types import MalformedMessage

__all__ = [
    'DEFAULT_NODE',
    'OUTPUT_TOPICS',
    'TOPICS',
    'Decoded',
    'EncodedMessage',
    'EventKind',
    'EventNote',
    'MalformedMessage',
    'MatchedTopics',
    'OutputMessage',
    'OutputTopic',
    'Source',
    'Unreadable',
    'decode',
    'encode',
    'event_message',
    'input_type',
    'match_inputs',
    'read_event',
]
