# SPDX-License-Identifier: Apache-2.0
"""
What bags gave, in sentences, the same in the terminal and on the page.

A record of which little could be used gives no error, and often no coastdown;
why, and what to do about it, is said here too, and what was cut of a stretch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from shipdrag_ros import __version__
from shipdrag_ros.coastdown.events import (
    ENDED_BY,
    EndedBy,
    EndedCoastdown,
    Event,
    InputCounts,
    NotCoastdown,
    Regimes,
    Reset,
)
from shipdrag_ros.display import duration, plus_minus, utc
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.messages import Unreadable
from shipdrag_ros.replay import Recorded, ReplayResult
from shipdrag_ros.replay.coasts import slows_at_first
from shipdrag_ros.samples import ALL_MOTION, MOTION_INPUTS, SECOND_NS, Channel
from shipdrag_ros.ship import Ship

StretchSpan = tuple[int, int]

_AROUND_NS = 60_000_000_000  # that clocks of sensors and recorder may be apart
_ROUNDING = 1e-6  # of a figure; what is larger has another cause
_USED_ENOUGH = 0.5  # of the messages of an input; below it the cause is named
_USED_TO_FIND = 0.9  # the same where no coastdown was found
_RESETS_SHOWN = 3
_FOLLOWED_NS = 3600 * SECOND_NS  # after a gap
_OF_MOTION = [channel for channel in Channel if channel.input in ALL_MOTION]
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


def explained(regimes: Regimes) -> str:
    """
    Say how well the model of what she did explains the record, beside those it was learnt on.
    """
    return f'as well as {regimes.explained:.0%} of those that it was learnt on'


def ended(coastdown: EndedCoastdown) -> str:
    """
    Say what ended a coastdown, and how likely that is, where the regimes alone tell.
    """
    text, regimes = coastdown.why, coastdown.regimes
    chances = {} if regimes is None else regimes.ends(coastdown.end_ns)
    chance = f'{chances.get(coastdown.ended_by, 0.0):.2f}'
    sure = chance == '0.00' or text != ENDED_BY[coastdown.ended_by]
    return text if sure else f'{text} (P {chance})'


def recorded_sentence(recorded: Recorded) -> str:
    """
    Say whether the replayed outputs are those in the bag.
    """
    if not recorded.compared:
        return (
            'No outputs of the bag were compared: it holds none, or was replayed with another '
            'ship file, other parameters, a window or a stop.'
        )
    if recorded.identical == recorded.compared:
        return f'All {recorded.compared} outputs in the bag are identical to the replayed ones.'
    if recorded.largest_difference < _ROUNDING:
        size = (
            f'no figure differs by more than {recorded.largest_difference:.1g} of its value, '
            'which is the rounding of another machine or library'
        )
    else:
        size = f'first difference: {recorded.first_difference}'
    if recorded.by not in (None, __version__):
        versions = f'version {recorded.by} recorded it and this is {__version__}'
        size = f'{versions}{_apart(recorded)}; {size}'
    return (
        f'{recorded.identical} of {recorded.compared} outputs in the bag are identical to the '
        f'replayed ones; {size}.'
    )


def _apart(recorded: Recorded) -> str:
    """Say by how much the estimates differ that both the bag and the replay have."""
    both, beside = recorded.beside, recorded.compared - recorded.beside
    parts = []
    if both:
        most = recorded.largest_difference_sigma
        parts.append(
            f'of {both} in both the estimates differ by {most:.2g} standard deviations at most'
        )
    if beside:
        parts.append(f'{beside} are in the bag or the replay alone, and nothing is beside them')
    return ''.join(f'; {part}' for part in parts)


def no_coastdown_sentence(steady_lead_s: float | None, dismissed: int, why: str = '') -> str:
    """
    Say that no coastdown was found, and what was looked at.

    Parameters
    ----------
    steady_lead_s
        The longest that the ship was steady [s]; None where that was not looked for.
    dismissed
        How many stretches were looked at and dismissed.
    why
        What the speed did instead, where nothing was dismissed.
    """
    known = [] if steady_lead_s is None else [f'longest steady sailing {duration(steady_lead_s)}']
    if dismissed:
        stretches = 'one stretch was' if dismissed == 1 else f'{dismissed} stretches were'
        known.append(f'{stretches} looked at and dismissed, see below')
    else:
        known.append(why or 'nothing in it looked like one')
    return f'No coastdown found: {"; ".join(known)}.'


def summary(coastdown: EndedCoastdown, ship: Ship | None = None) -> tuple[str, ...]:
    """
    Say what a coastdown gave, or why it gave nothing.

    Parameters
    ----------
    coastdown
    ship
        For force, power and the clean hull; None: without them.
    """
    if coastdown.estimate is None:
        return (f'No resistance could be estimated: {coastdown.failure or "no reason given"}.',)
    return estimate_words.summary(coastdown.estimate, ship)


def combined_notes(combined: Combined) -> tuple[str, ...]:
    """
    Say what several coastdowns together can and cannot show, a sentence each.
    """
    if combined.current_m_s is None or combined.current_sigma_m_s is None:
        current = (
            'These runs do not show a current: none is taken out. Runs on opposite headings would.'
        )
    else:
        value = plus_minus(combined.current_m_s, 2.0 * combined.current_sigma_m_s)
        current = (
            f'The current along the heading of the first run is {value} m/s (two standard '
            'deviations); it is taken out.'
        )
    return (
        'It is of the ship in calm deep water: what each run shows of its wind and depth is out.',
        current,
        'Run to run is the standard deviation of one run about the mean, - where one run alone '
        'is; where it is larger than the runs themselves state, sigma is widened.',
    )


def cut_lines(coastdown: EndedCoastdown, span_ns: StretchSpan | None) -> tuple[str, ...]:
    """
    Say what was cut off a stretch, a sentence each.

    Parameters
    ----------
    coastdown
    span_ns
        Of the record, from whose start times are counted.
    """
    if not coastdown.cuts:
        return ()
    start_ns, end_ns = stretch(coastdown)
    whole = f'{_moment(start_ns, span_ns)} to {_moment(end_ns, span_ns)}'
    kept = f'{_moment(coastdown.start_ns, span_ns)} to {_moment(coastdown.end_ns, span_ns)}'
    first = (
        f'Nothing of {whole} is taken for a coastdown:'
        if coastdown.withdrawn
        else f'Of {whole} only {kept} is taken for a coastdown; the rest was cut:'
    )
    return (first, *(cut_line(cut, span_ns) for cut in coastdown.cuts))


def cut_line(cut: NotCoastdown, span_ns: StretchSpan | None) -> str:
    """
    Say when and why a stretch is no coastdown.
    """
    start, end = _moment(cut.start_ns, span_ns), _moment(cut.end_ns, span_ns)
    return f'{start} to {end}, {cut.reason.value.replace("_", "-")}: {cut.text}'


def stretch(coastdown: EndedCoastdown) -> StretchSpan:
    """Return the bounds of what was examined."""
    every: list[EndedCoastdown | NotCoastdown] = [coastdown, *coastdown.cuts]
    return min(each.start_ns for each in every), max(each.end_ns for each in every)


def inside(time_ns: int, span_ns: StretchSpan | None) -> bool:
    return span_ns is not None and (span_ns[0] - _AROUND_NS <= time_ns <= span_ns[1] + _AROUND_NS)


def _moment(time_ns: int, span_ns: StretchSpan | None) -> str:
    """Return a time in s from the start of the record, or of day where clocks are apart."""
    if span_ns is None or not inside(time_ns, span_ns):
        return utc(time_ns)
    return f'{(time_ns - span_ns[0]) * 1e-9:.1f} s'


def run_warnings(result: ReplayResult) -> tuple[str, ...]:
    """
    Return what is wrong with a run, a sentence each.
    """
    return (
        *result.run.warnings,
        *(f'{name}: {text}' for name, text in result.contradictions.items()),
        *_inputs(result.inputs, _USED_ENOUGH if result.coastdowns else _USED_TO_FIND),
        *_resets(result.events),
        *_unexplained(result.events),
        *_not_found_again(result),
    )


def _not_found_again(result: ReplayResult) -> Iterator[str]:
    """Say of which glides the readings ceased, and no rest was found once they were back."""
    told = [each for each in result.events if isinstance(each, EndedCoastdown) and each.stands]
    followed = {cut.start_ns for each in told for cut in each.cuts}
    for one in told:
        if one.ended_by not in (EndedBy.DATA_STOP, EndedBy.SILENCE) or one.end_ns in followed:
            continue
        span_ns = result.run.span_ns
        assert span_ns is not None  # it was read
        later = result.samples(one.end_ns + 1, one.end_ns + _FOLLOWED_NS, 0)
        speeds = np.isin(later.channel, _OF_MOTION) & (later.stamp_ns > one.end_ns)
        if not speeds.any():
            continue
        first = int(np.flatnonzero(speeds)[0])
        silent_s = (int(later.stamp_ns[first]) - one.end_ns) / SECOND_NS
        at = _moment(one.end_ns, span_ns)
        said = (
            f'the readings of speed ceased for {silent_s:.0f} s at {at}: the coastdown ends '
            'there, and no rest of it was found'
        )
        slows_s = slows_at_first(later[np.flatnonzero(speeds)], result.parameters.slope_window_s)
        if slows_s is not None:
            again_s = (int(later.receive_ns[first]) - span_ns[0]) / SECOND_NS
            last_s = min(again_s + slows_s, (span_ns[1] - span_ns[0]) / SECOND_NS)
            said += (
                f'; if she went on without thrust, say so with --window {again_s:.0f} {last_s:.0f}'
            )
        yield said


def _unexplained(events: Sequence[Event]) -> Iterator[str]:
    for event in events:
        if not isinstance(event, EndedCoastdown) or event.regimes is None:
            continue
        if event.regimes.explained < _UNEXPLAINED:
            yield (
                f'the record about {utc(event.start_ns)} is explained only '
                f'{explained(event.regimes)}: she may have done what the model of regimes '
                'does not know, or a sensor was wrong; look at the picture of what she did'
            )


def _inputs(inputs: Mapping[str, InputCounts], enough: float) -> Iterator[str]:
    for name, counts in inputs.items():
        rejected = dict(counts.rejected)
        if surplus := rejected.pop(_SURPLUS, 0):
            yield f'{name}: {surplus} readings left out: {_CAUSE[_SURPLUS]}'
        readings = max(counts.messages, counts.used + sum(rejected.values()))
        if counts.used >= enough * readings or not rejected:
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
        yield f'at {utc(reset.receive_ns)} everything before was dropped: {reset.reason}'
    if len(resets) > _RESETS_SHOWN:
        yield f'and {len(resets) - _RESETS_SHOWN} more times'
