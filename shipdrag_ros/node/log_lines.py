# SPDX-License-Identifier: Apache-2.0
"""What the monitor reports, as the lines that the log and the console show."""

from __future__ import annotations

from typing import NamedTuple

from shipdrag_ros.coastdown.events import (
    EndedBy,
    EndedCoastdown,
    Event,
    NoEstimate,
    NotCoastdown,
    Onset,
    Reset,
)
from shipdrag_ros.display import duration, plus_minus, utc
from shipdrag_ros.estimation.result import Estimate

_NS = 1e-9
_ENDED_BY = {
    EndedBy.SPEED: 'the minimum speed is reached',
    EndedBy.TURN: 'the ship turned',
    EndedBy.ENGINE: 'the engine drives again, or the speed settled',
    EndedBy.BRAKE: 'something but the water stopped the ship',
    EndedBy.ASTERN: 'the propeller was reversed',
    EndedBy.DATA_STOP: 'the speed fell silent',
    EndedBy.SILENCE: 'all sources of speed fell silent',
    EndedBy.RESET: 'the memory was reset',
    EndedBy.RECORD_END: 'the node stops',
    EndedBy.GIVEN: 'given',
}


class LogLine(NamedTuple):
    """A line of the log, and whether somebody should look at it."""

    text: str
    warning: bool = False


def line_of(event: Event) -> LogLine | None:
    """
    Return the line of an event; None where it is one of many.
    """
    match event:
        case Onset(start_ns, detected_ns):
            seen_s = (detected_ns - start_ns) * _NS
            return LogLine(
                f'a coastdown began at {utc(start_ns)}, confirmed {seen_s:.0f} s later: '
                'hold rudder and engine'
            )
        case EndedCoastdown():
            return _ended(event)
        case NotCoastdown():
            return LogLine(f'nearly a coastdown: {event.text}')
        case Reset(_, reason):
            return LogLine(f'all memory is dropped: {reason}', warning=True)
        case NoEstimate() | _:
            return None


def _ended(event: EndedCoastdown) -> LogLine:
    seconds = (event.end_ns - event.start_ns) * _NS
    why = f'{event.ended_by.value}: {_ENDED_BY[event.ended_by]}'
    if event.withdrawn:
        return LogLine(f'a coastdown is refused after {duration(seconds)}: {event.failure}', True)
    text = f'a coastdown has ended after {duration(seconds)} ({why})'
    if event.estimate is None:
        return LogLine(f'{text}; no estimate: {event.failure}', True)
    return LogLine(f'{text}: {figure(event.estimate)}')


def figure(estimate: Estimate) -> str:
    """
    Return the resistance in the middle of the range where it may be used.
    """
    curve = estimate.valid_curve
    if not len(curve):
        return 'no speed at which the resistance may be used'
    middle = len(curve) // 2
    value = plus_minus(
        float(curve.resistance_m_s2[middle]) * 1e3, float(curve.sigma_m_s2[middle]) * 1e3
    )
    return (
        f'r = ({value}) mm/s^2 at {curve.speed_m_s[middle]:.2f} m/s, valid from '
        f'{curve.speed_m_s[0]:.2f} to {curve.speed_m_s[-1]:.2f} m/s'
    )
