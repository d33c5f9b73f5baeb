# SPDX-License-Identifier: Apache-2.0
"""
What a reader must know before any figure of a run.

A record of which little could be used gives no error, and often no coastdown;
why, and what to do about it, is said here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import EndedCoastdown, Event, Reset
from shipdrag_ros.messages import Unreadable
from shipdrag_ros.replay import InputCounts, ReplayResult, words
from shipdrag_ros.samples import ALL_MOTION, MOTION_INPUTS

_USED_ENOUGH = 0.5  # of the messages of an input; below it the cause is named
_RESETS_SHOWN = 3
_UNEXPLAINED = 0.05  # of the records that were explained less well; below it, it is said
_SURPLUS = Unreadable.SURPLUS_JOINT.value
_CAUSE = {
    'type': 'of a type that this input is not accepted in; `shipdrag info` lists the types',
    'malformed': 'bytes that are no such message; check the driver and the recorder',
    'no_joint': 'without a joint of that name, or without its value; name it in the driver',
    'surplus_joint': 'joints beyond the four shafts and four pitches that are read; name those to '
    'be read shaft_1 to shaft_4 and pitch_1 to pitch_4',
    'duplicate': 'with the stamp of the message before; does the driver stamp each message?',
    'out_of_order': 'stamped before the message before; check the driver',
    'late': 'stamped long before the newest stamp of any input; set the clocks of the sensors '
    'alike, or raise late_s',
    'future': 'stamped more than 2 s after their arrival; set the clocks of sensor and recorder '
    'alike',
    'nan': 'without a value, as GNSS without a fix or a rotation of zeros; check the sensor',
    'infinite': 'with an infinite value; check the sensor',
    'absurd': 'faster than 40 m/s, or no place on Earth; check the unit',
    'frozen': 'unchanged for longer than frozen_s, or than this sensor ever is; check the sensor',
    'outlier': 'impossible beside the readings before and after, as drop-outs to 0, spikes and '
    'jumps are; check the sensor',
}


def run_warnings(result: ReplayResult) -> tuple[str, ...]:
    """
    Return what is wrong with a run, a sentence each.
    """
    return (
        *result.run.warnings,
        *(f'{name}: {text}' for name, text in result.contradictions.items()),
        *_inputs(result.inputs),
        *_resets(result.events),
        *_unexplained(result.events),
    )


def _unexplained(events: Sequence[Event]) -> Iterator[str]:
    for event in events:
        if not isinstance(event, EndedCoastdown) or event.regimes is None:
            continue
        if event.regimes.explained < _UNEXPLAINED:
            yield (
                f'the record about {display.utc(event.start_ns)} is explained only '
                f'{words.explained(event.regimes)}: she may have done what the model of regimes '
                'does not know, or a sensor was wrong; look at the picture of what she did'
            )


def _inputs(inputs: Mapping[str, InputCounts]) -> Iterator[str]:
    for name, counts in inputs.items():
        rejected = dict(counts.rejected)
        if surplus := rejected.pop(_SURPLUS, 0):
            yield f'{name}: {surplus} readings left out: {_CAUSE[_SURPLUS]}'
        readings = max(counts.messages, counts.used + sum(rejected.values()))
        if counts.used >= _USED_ENOUGH * readings or not rejected:
            continue
        reason, number = max(rejected.items(), key=lambda item: item[1])
        what = 'messages' if readings == counts.messages else 'readings'
        yield (
            f'{name}: {readings - counts.used} of {readings} {what} not used; '
            f'{number} {reason}: {_CAUSE[reason]}'
        )
    if not any(inputs[name].used for name in ALL_MOTION if name in inputs):
        yield (
            f'no message of {", ".join(MOTION_INPUTS)} was used, one of which is needed; '
            'where it has another name give --remap FROM:=TO'
        )


def _resets(events: Sequence[Event]) -> Iterator[str]:
    resets = [event for event in events if isinstance(event, Reset)]
    for reset in resets[:_RESETS_SHOWN]:
        yield f'at {display.utc(reset.receive_ns)} everything before was dropped: {reset.reason}'
    if len(resets) > _RESETS_SHOWN:
        yield f'and {len(resets) - _RESETS_SHOWN} more times'
