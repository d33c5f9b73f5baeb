# SPDX-License-Identifier: Apache-2.0
"""
What stands in large letters, the state and what to do now, and the checklist of a run.

The checklist holds what must be so for the figures of a run to be worth something. What is not
measured is said to be unknown; it is no refusal.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.estimation.run_down import STANDS_RAD_S
from shipdrag_ros.messages.topics import READY_S
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Block, Channel
from shipdrag_ros.ship import Ship

WIND_M_S = 5.4  # true wind, Beaufort 3: above it air drag is no small correction
RUDDER_RAD = math.radians(5.0)  # a mean angle above it is steering, and slows the ship
COURSE_RAD = 0.35  # the parameter `turn_rad` as it is set at first
_RECENT_S = 60
_CONTEXT = (Channel.RUDDER, Channel.HEADING, Channel.WIND_APPARENT, Channel.DEPTH, *SHAFTS)
_GRAVITY_M_S2 = 9.81


class Held(StrEnum):
    """Whether a condition holds."""

    YES = 'yes'
    NO = 'no'
    WAIT = 'wait'
    UNKNOWN = 'unknown'
    SILENT = 'silent'


class Check(NamedTuple):
    """A line of the checklist."""

    name: str
    held: Held
    text: str


class Recent:
    """
    Means of what context inputs read in the last minute.
    """

    def __init__(self) -> None:
        self._seconds: dict[Channel, deque[tuple[int, float, float]]] = {
            channel: deque() for channel in _CONTEXT
        }

    def add(self, block: Block) -> None:
        """
        Take readings.
        """
        for channel, kept in self._seconds.items():
            for row in np.flatnonzero(block.channel == channel).tolist():
                second = int(block.stamp_ns[row]) // SECOND_NS
                first, other = block.value[row].tolist()
                if not (math.isfinite(first) and math.isfinite(other)):
                    continue
                if kept and kept[-1][0] == second:
                    continue  # one a second is enough
                kept.append((second, first, other))
                while kept[0][0] < second - _RECENT_S:
                    kept.popleft()

    def mean(self, channel: Channel, now_s: int) -> tuple[float, float] | None:
        """
        Return the mean of both columns; None where nothing was read in the last minute.
        """
        rows = [row[1:] for row in self._seconds[channel] if abs(now_s - row[0]) <= _RECENT_S]
        if not rows:
            return None
        first, other = np.array(rows).T
        return float(first.mean()), float(other.mean())

    def direction(self, now_s: int) -> float | None:
        """
        Return the mean heading as sent [rad].
        """
        rows = [row[1] for row in self._seconds[Channel.HEADING] if abs(now_s - row[0]) <= 5]
        if not rows:
            return None
        return math.atan2(float(np.sin(rows).mean()), float(np.cos(rows).mean()))


def lead_check(lead_s: float | None, ready_s: float | None) -> Check:
    """
    Say whether there was enough steady sailing.
    """
    name = 'Steady lead'
    if lead_s is None or ready_s is None:
        return Check(name, Held.UNKNOWN, 'no speed, or the node does not say')
    if lead_s >= ready_s:
        return Check(name, Held.YES, f'{clock(lead_s)}, at least {clock(ready_s)}')
    return Check(name, Held.WAIT, f'{clock(lead_s)} of {clock(ready_s)}')


def wind_check(apparent: tuple[float, float] | None, speed_m_s: float | None) -> Check:
    """
    Say whether the true wind is light; from the apparent wind and the ship's speed [m/s].
    """
    name = 'Wind'
    if apparent is None or speed_m_s is None:
        return Check(name, Held.UNKNOWN, 'look at the sea')
    true = math.hypot(apparent[0] + speed_m_s, apparent[1])
    light = true <= WIND_M_S
    limit = WIND_M_S / M_S_PER_KNOT
    text = f'{true / M_S_PER_KNOT:.0f} kn true, {"at most" if light else "over"} {limit:.0f} kn'
    return Check(name, Held.YES if light else Held.NO, text)


def depth_check(depth_m: float | None, speed_m_s: float | None, ship: Ship | None) -> Check:
    """
    Say whether the water is deep enough for the hull not to feel the ground.

    Notes
    -----
    ITTC 7.5-04-01-01.1: h > 3 sqrt(B T) and h > 2.75 v^2 / g.
    """
    name = 'Depth'
    if depth_m is None:
        return Check(name, Held.UNKNOWN, 'look at the chart')
    needed = 2.75 * (speed_m_s or 0.0) ** 2 / _GRAVITY_M_S2
    if ship is not None and ship.breadth_m and ship.draught_m:
        needed = max(needed, 3.0 * math.sqrt(ship.breadth_m * ship.draught_m))
    deep = depth_m >= needed
    text = f'{depth_m:.0f} m, {"at least" if deep else "less than"} {needed:.0f} m'
    return Check(name, Held.YES if deep else Held.NO, text)


def rudder_check(angle_rad: float | None) -> Check:
    """
    Say whether the rudder is amidships, by its mean of the last minute.
    """
    name = 'Rudder'
    if angle_rad is None:
        return Check(name, Held.UNKNOWN, 'keep it amidships')
    held = abs(angle_rad) <= RUDDER_RAD
    text = f'{math.degrees(abs(angle_rad)):.0f}° mean of the last minute'
    return Check(name, Held.YES if held else Held.NO, text if held else f'{text}: amidships')


def shaft_check(rate_rad_s: float | None) -> Check:
    """
    Say how fast a shaft turned in the last minute; one astern makes r too large.

    Parameters
    ----------
    rate_rad_s
        Of the one that turns ahead the least.
    """
    name = 'Shaft'
    if rate_rad_s is None:
        return Check(name, Held.UNKNOWN, 'see that it is not astern')
    text = f'{rate_rad_s * 30.0 / math.pi:z.0f} rpm mean of the last minute'  # z: no -0
    astern = rate_rad_s < -STANDS_RAD_S
    return Check(name, Held.NO if astern else Held.YES, f'{text}: astern' if astern else text)


def course_check(turned_rad: float | None, *, coasting: bool) -> Check:
    """
    Say whether the course is held; by the heading against that at the stop, or a while ago.
    """
    name = 'Course'
    if turned_rad is None:
        return Check(name, Held.UNKNOWN, 'keep the heading')
    swung = abs(math.degrees(math.remainder(turned_rad, 2.0 * math.pi)))
    held = swung < math.degrees(COURSE_RAD)
    since = 'from the stop' if coasting else 'in 5 min'
    text = f'{swung:.0f}° {since}, at most {math.degrees(COURSE_RAD):.0f}°'
    return Check(name, Held.YES if held else Held.NO, text)


def reciprocal_check(steer_deg: float | None, *, paired: bool, coasting: bool = False) -> Check:
    """
    Say whether the run on the other heading is made.

    Parameters
    ----------
    steer_deg
        The heading that it needs; None where there is no first run.
    paired
        Whether it is made.
    coasting
        Whether a run is under way.
    """
    name = 'Reciprocal run'
    if paired:
        return Check(name, Held.YES, 'done: current and log are separated')
    if steer_deg is None:
        return Check(name, Held.WAIT, 'after the first run')
    if coasting:
        return Check(name, Held.WAIT, f'this run, if on {heading(steer_deg)}')
    return Check(name, Held.WAIT, f'still to do: steer {heading(steer_deg)}')


GOAL = 0.05  # two standard deviations over r that a run is worth
ENDED_S = 600.0  # a run that has ended is the headline for so long
SILENT_S = 5.0  # the node speaks every second

_ENDED = {
    EndedBy.SPEED.value: 'COASTDOWN COMPLETE',
    EndedBy.TURN.value: 'TURNED: this run ends here',
    EndedBy.ENGINE.value: 'ENGINE AHEAD: this run ends here',
    EndedBy.BRAKE.value: 'BRAKED: this run ends here',
    EndedBy.ASTERN.value: 'ASTERN: this run ends here',
    EndedBy.DATA_STOP.value: 'SPEED LOST: this run ends here',
    EndedBy.SILENCE.value: 'ALL INPUTS SILENT: this run ends here',
    EndedBy.RESET.value: 'RESET: this run is lost',
    EndedBy.RECORD_END.value: 'RECORD ENDS: this run ends here',
}


class Tone(StrEnum):
    """How urgent; the page has a sign and a word for each, beside a colour."""

    GOOD = 'good'
    ACT = 'act'
    WATCH = 'watch'
    BAD = 'bad'


class Headline(NamedTuple):
    """The state in large letters, and the next action."""

    tone: Tone
    text: str
    action: str


@dataclass(frozen=True, kw_only=True)
class Ended:
    """
    A coastdown that has ended.

    Attributes
    ----------
    by
        As the event names it.
    ago_s
    band
        Two standard deviations over r at the usual speed; None without an estimate.
    why_not
        Why there is no estimate.
    """

    by: str
    ago_s: float
    band: float | None
    why_not: str = ''


@dataclass(frozen=True, kw_only=True)
class Situation:
    """
    Where the ship and the node stand.

    Attributes
    ----------
    bag
        Name of what is played; '' of a node that runs.
    silent_s
        Since the node was last heard; None: never.
    lifecycle, monitor
        States as the node names them.
    trouble
        What keeps the node from estimating; '' for nothing.
    doubt
        What is not well, and does not keep it; '' for nothing.
    lead_s, ready_s
        Steady sailing so far, and from when the record is ready; None where it is not known.
    coast_s
        Since the stop; None without a coastdown.
    band
        Two standard deviations over r at the usual speed, so far.
    to_go_s
        Until `band` is `GOAL`; None where it cannot be foreseen.
    ended
        The last coastdown, None before the first.
    sailed
        Whether she has sailed steadily since.
    steer_deg
        Compass heading of the reciprocal run that is still to be made.
    paired
        Whether the last run has its reciprocal.
    """

    bag: str = ''
    silent_s: float | None = None
    lifecycle: str = ''
    monitor: str = ''
    trouble: str = ''
    doubt: str = ''
    lead_s: float | None = None
    ready_s: float | None = None
    coast_s: float | None = None
    band: float | None = None
    to_go_s: float | None = None
    ended: Ended | None = None
    sailed: bool = False
    steer_deg: float | None = None
    paired: bool = False

    @property
    def just_ended(self) -> Ended | None:
        """The last coastdown where it is the headline still."""
        return self.ended if self.ended is not None and self.ended.ago_s < ENDED_S else None


def headline(now: Situation) -> Headline:
    """
    Say where things stand and what to do.
    """
    if now.silent_s is None and now.bag and now.trouble:
        return Headline(Tone.BAD, 'BAG NOT READ', _sentence(now.trouble))
    if now.silent_s is None and now.bag:
        return Headline(Tone.WATCH, 'READING', f'{now.bag} is read from its beginning.')
    if now.silent_s is None:
        return Headline(
            Tone.BAD,
            'NO NODE HEARD',
            'Start it: shipdrag node --ship FILE --out DIR. If it runs: same machine, same '
            'ROS_DOMAIN_ID?',
        )
    if now.silent_s > SILENT_S:
        return Headline(
            Tone.BAD,
            f'NODE SILENT for {clock(now.silent_s)}',
            'Figures below are old. Is the node still running? It is taken up again by itself.',
        )
    if now.lifecycle != 'active':
        return Headline(
            Tone.BAD, f'NODE {now.lifecycle.upper()}', 'It estimates nothing until it is active.'
        )
    if now.trouble:
        coasting = '' if now.coast_s is None else f' at {clock(now.coast_s)} of a coastdown'
        return Headline(Tone.BAD, f'NO SPEED{coasting}', _sentence(now.trouble))
    found = _sailing(now)
    if not now.doubt:
        return found
    tone = Tone.WATCH if found.tone is Tone.GOOD else found.tone
    return Headline(tone, found.text, f'Look first: {now.doubt.rstrip(".")}. {found.action}')


def _sailing(now: Situation) -> Headline:
    if now.monitor == 'coastdown' and now.coast_s is not None:
        return _coasting(now)
    # what follows the end at once, an engine ahead or astern, is no other stop
    if now.monitor == 'candidate' and (now.just_ended is None or now.sailed):
        return Headline(
            Tone.ACT,
            'SLOWING: coastdown?',
            'If the engine is stopped: leave it, rudder amidships. The answer takes two minutes.',
        )
    if now.just_ended is not None:
        return _ended(now, now.just_ended)
    return _before(now)


def clock(seconds: float) -> str:
    """
    Return a length of time as minutes and seconds.

    Examples
    --------
    >>> clock(400.0)
    '6:40'
    """
    whole = max(int(seconds), 0)
    if whole >= 3600:
        return f'{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}'
    return f'{whole // 60}:{whole % 60:02d}'


def _coasting(now: Situation) -> Headline:
    assert now.coast_s is not None
    text = f'COASTDOWN {clock(now.coast_s)}'
    hold = 'Hold the rudder'
    if now.band is None or not math.isfinite(now.band):
        return Headline(Tone.ACT, text, f'{hold}. The first figures come within minutes.')
    text += f', ±{percent(now.band)}'
    if now.band <= GOAL:
        return Headline(
            Tone.GOOD, text, f'Good enough (±{percent(GOAL)}). {hold}: longer is better.'
        )
    if now.to_go_s is None:
        return Headline(Tone.ACT, text, f'{hold}. Longer is better.')
    more = max(1, math.ceil(now.to_go_s / 60.0))
    minutes = 'minute' if more == 1 else 'minutes'
    return Headline(Tone.ACT, text, f'{hold}: {more} more {minutes} to ±{percent(GOAL)}.')


def _ended(now: Situation, ended: Ended) -> Headline:
    text = _ENDED.get(ended.by, f'RUN ENDED: {ended.by}')
    if ended.band is None:
        why = ended.why_not or 'no estimate was possible'
        return Headline(Tone.BAD, 'RUN NOT USABLE', f'{_sentence(why)} {_then(now)}')
    tone = Tone.GOOD if ended.band <= 2.0 * GOAL else Tone.WATCH
    return Headline(tone, f'{text} (±{percent(ended.band)})', _then(now))


def _then(now: Situation) -> str:
    if now.paired:
        return 'Both runs of the pair are made. The engine may be started.'
    if now.steer_deg is None:
        return 'Sail on steadily.'
    ready_s = READY_S if now.ready_s is None else now.ready_s
    return (
        f'Now the reciprocal: steer {heading(now.steer_deg)}, then at least '
        f'{ready_s / 60.0:.0f} min steady, up to 30.'
    )


def _before(now: Situation) -> Headline:
    hold = 'Hold course and revolutions.'
    if now.steer_deg is not None:
        hold = f'Steer {heading(now.steer_deg)} (reciprocal) and hold it and the revolutions.'
    if now.lead_s is None or now.ready_s is None:
        return Headline(Tone.WATCH, 'STEADY' if now.monitor == 'steady' else 'WAITING', hold)
    if now.monitor != 'steady' or now.lead_s <= 0.0:
        return Headline(Tone.WATCH, 'NOT STEADY YET', hold)
    minutes, needed = math.floor(now.lead_s / 60.0), round(now.ready_s / 60.0)
    if now.lead_s < now.ready_s:
        more = math.ceil((now.ready_s - now.lead_s) / 60.0)
        return Headline(
            Tone.WATCH, f'STEADY {minutes} of {needed} min', f'{hold} Ready in {more} min.'
        )
    course = 'course' if now.steer_deg is None else f'{heading(now.steer_deg)} (reciprocal)'
    action = f'The engine may be stopped, if the master decides so. Until then hold {course}.'
    return Headline(Tone.GOOD, f'STEADY {minutes} min: record ready', action)


def percent(share: float) -> str:
    """
    Return a share in percent, one digit below 3 %.
    """
    value = 100.0 * share
    return f'{value:.1f} %' if value < 2.95 else f'{value:.0f} %'


def heading(degrees: float) -> str:
    """
    Return a compass heading in three digits.
    """
    return f'{round(degrees) % 360:03d}'


def _sentence(text: str) -> str:
    text = text.strip()
    return f'{text[:1].upper()}{text[1:]}' + ('' if text.endswith('.') else '.')
