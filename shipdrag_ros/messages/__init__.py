# SPDX-License-Identifier: Apache-2.0
"""CDR bytes to samples, and samples and events to CDR bytes, without ROS."""

from shipdrag_ros.messages.decoding import Decoded as Decoded
from shipdrag_ros.messages.decoding import Unreadable as Unreadable
from shipdrag_ros.messages.decoding import decode as decode
from shipdrag_ros.messages.encoding import EncodedMessage as EncodedMessage
from shipdrag_ros.messages.encoding import encode as encode
from shipdrag_ros.messages.encoding import input_type as input_type
from shipdrag_ros.messages.topics import DEFAULT_NODE as DEFAULT_NODE
from shipdrag_ros.messages.topics import OUTPUT_TOPICS as OUTPUT_TOPICS
from shipdrag_ros.messages.topics import TOPICS as TOPICS
from shipdrag_ros.messages.topics import EventKind as EventKind
from shipdrag_ros.messages.topics import EventNote as EventNote
from shipdrag_ros.messages.topics import OutputMessage as OutputMessage
from shipdrag_ros.messages.topics import OutputTopic as OutputTopic
from shipdrag_ros.messages.topics import Source as Source
from shipdrag_ros.messages.topics import event_message as event_message
from shipdrag_ros.messages.topics import match_inputs as match_inputs
from shipdrag_ros.messages.topics import read_event as read_event
from shipdrag_ros.messages.types import MalformedMessage as MalformedMessage
