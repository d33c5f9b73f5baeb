# SPDX-License-Identifier: Apache-2.0
"""
Where the numbers wanted of a message type lie in its CDR bytes.

Strings move what follows them, so that a layout is a list of
steps through the bytes, made once a type from its definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from shipdrag_ros.messages import types
from shipdrag_ros.samples import Int64

_BYTES = {
    'bool': 1,
    'int8': 1,
    'uint8': 1,
    'int16': 2,
    'uint16': 2,
    'int32': 4,
    'uint32': 4,
    'float32': 4,
    'float64': 8,
}


class Step(IntEnum):
    """One step through the bytes, with its two operands."""

    SECTION = 0  # alignment and size of what has a fixed size
    FLOAT64 = 1  # offset in the section, column
    FLOAT32 = 2
    UINT8 = 3
    INT8 = 4
    STRING = 5
    UNSTAMPED = 6  # the first, of a type without a header


_TAKEN = {
    'float64': Step.FLOAT64,
    'float32': Step.FLOAT32,
    'uint8': Step.UINT8,
    'int8': Step.INT8,
}


def steps(type_name: str, fields: Sequence[str]) -> Int64:
    """
    Return the steps through a message, behind its header if it has one.

    Parameters
    ----------
    type_name
        A type; where it has a `std_msgs/Header`, it begins with it.
    fields
        What goes into which column, `pose.pose.position.x` or `twist.covariance[7]`
        for instance; '' for nothing.

    Returns
    -------
    (k, 3) int64
        A `Step` and its operands a row.
    """
    column = {field: number for number, field in enumerate(fields) if field}
    listed: list[list[int]] = []
    if not types.is_stamped(type_name):
        listed.append([Step.UNSTAMPED, 0, 0])
    section: list[int] = []  # the row of the one that is open
    for leaf in types.leaves(type_name):
        if leaf.path.startswith('header.'):
            continue
        if leaf.length is None:
            raise ValueError(f'{type_name}: {leaf.path} is a sequence, which has no fixed place')
        if leaf.kind == 'string':
            section = []
            listed.append([Step.STRING, 0, 0])
            continue
        size = _BYTES[leaf.kind]
        if not section or size > section[1]:
            section = [Step.SECTION, size, 0]
            listed.append(section)
        first = -(-section[2] // size) * size
        section[2] = first + size * leaf.length
        for i in range(leaf.length):
            name = leaf.path if leaf.length == 1 else f'{leaf.path}[{i}]'
            if name in column:
                listed.append([_TAKEN[leaf.kind], first + size * i, column.pop(name)])
    if column:
        raise ValueError(f'{type_name} has no {", ".join(column)}')
    return np.array(listed, np.int64)
