# SPDX-License-Identifier: Apache-2.0
"""
What an MCAP file says about its topics, and about itself.

One place, because a file is written in two ways: while it grows, and whole.
"""

from __future__ import annotations

from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Schema

from shipdrag_ros import __version__
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import OUTPUT_TOPICS, types

PROFILE = 'ros2'
METADATA = 'shipdrag_ros'
"""Name of the metadata record that says which recording a file is part of."""
LIBRARY = f'shipdrag_ros {__version__}'

# as rosbag2 writes it; a player needs it to latch the topic again
_LATCHED_QOS = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
_LATCHED = {(topic.name, topic.type) for topic in OUTPUT_TOPICS if topic.latched}


def metadata(recording_id: str, part: int) -> dict[str, str]:
    """
    Return which part of which recording a file is.
    """
    return {'version': __version__, 'recording_id': recording_id, 'part': str(part)}


def attachment(name: str, text: str) -> Attachment:
    """
    Return the record of an attached text.
    """
    kind = 'application/yaml' if name.endswith('.yaml') else 'text/plain'
    return Attachment(create_time=0, log_time=0, name=name, media_type=kind, data=text.encode())


def schema(number: int, type_name: str) -> Schema:
    """
    Return the schema record of a type.

    Raises
    ------
    BagError
        If the definition of the type is not known.
    """
    if not types.is_known(type_name):
        raise BagError(f'{type_name!r} is no message type of ROS 2 Jazzy that is known')
    text = types.definition(type_name).encode()
    return Schema(id=number, name=type_name, encoding='ros2msg', data=text)


def channel(number: int, topic: str, type_name: str, *, schema_id: int) -> Channel:
    """
    Return the channel record of a topic.
    """
    latched = (topic.rpartition('/')[2], type_name) in _LATCHED
    return Channel(
        id=number,
        topic=topic,
        message_encoding='cdr',
        schema_id=schema_id,
        metadata={
            'offered_qos_profiles': _LATCHED_QOS if latched else '',
            'topic_type_hash': types.type_hash(type_name),
        },
    )


def as_bytes(*records: Any) -> bytes:
    """
    Return records of `mcap.records` as they stand in a file.
    """
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())
