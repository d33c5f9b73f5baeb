# SPDX-License-Identifier: Apache-2.0
"""
What the bridge sees: all that was heard, as parts of a page.

Plain figures in SI units; the page turns them into knots, kN and kW.
"""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shipdrag_ros.display import printable
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live import figures, headline, outputs
from shipdrag_ros.messages import EventKind, MalformedMessage, read_event, topics, types
from shipdrag_ros.samples import ALL_MOTION, MOTION_INPUTS, SECOND_NS, SHAFTS, Channel, kind_of
from shipdrag_ros.ship import Ship

_OPTION = re.compile(r' \(--fact [^)]*\)')  # of the command line, which a bridge has not
_SETS_SIZED = 3  # candidates whose sizes are shown
_OTHERWISE = {'none': 'nothing is missing', 'unknown': 'something without a name'}


def verdict_part(found: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return what the page shows of the document of a diagnosis, of a node's topic or of a bag.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        If it is none of this package.
    """
    sized = [(effect['name'], effect) for effect in found['effects']]
    if not sized:  # a set: what each would have
        sized = [
            (
                ' + '.join(each['names']) + (f', {effect["name"]}' if each['names'][1:] else ''),
                effect,
            )
            for each in found['candidates'][:_SETS_SIZED]
            for effect in each['effects']
        ]
        sized = [(f'if {name}', effect) for name, effect in sized]
    named = [(' + '.join(each['names']), each['probability']) for each in found['candidates']]
    return {
        'state': 'done',
        'sentence': ' '.join(filter(None, [found['sentence'], found.get('caveat', '')])),
        'sizes': [
            f'{name}, {size["text"]}'.replace('_', ' ')
            for name, effect in sized
            for size in effect['parameters'].values()
        ],
        'probabilities': [[_OTHERWISE.get(name, name), float(share)] for name, share in named],
        'decide': [_OPTION.sub('', each['text']) for each in found['advice']],
    }


PAST_RUNS = 50  # that are listed
_MESSAGES = 20
_COURSE_S = 300
_OLD_S = 5.0  # a speed that is older is not that of now
_SPEEDS = (
    ('speed_through_water', 'through water'),
    ('speed_over_ground', 'over ground'),
)  # with the columns of the trace
_CHECKED = {
    'Wind': 'wind_apparent',
    'Depth': 'depth',
    'Rudder': 'rudder',
    'Course': 'heading',
    'Shaft': 'shaft',
}


@dataclass(frozen=True)
class SpeedNow:
    """The ship's speed, what kind of speed it is, and how old [s; None: not known]."""

    value_m_s: float
    kind: str
    age_s: float | None


class Bridge:
    """
    All that was heard, by one thread.

    Parameters
    ----------
    ship
        Before the node names its own.
    bag
        Name of what is played; '' of a node that runs.

    Attributes
    ----------
    ship
        None while she is not known.
    resistance
        The latest r [m/s^2].
    """

    def __init__(self, ship: Ship | None = None, *, bag: str = '') -> None:
        self._bag = bag
        self.trace = figures.Trace()
        self.past: list[outputs.PastRun] = []
        self.ship = ship
        self.problem = ''  # why the bag is not read
        self._heard_s: float | None = None
        self._health = topics.Health(())
        self._recent = headline.Recent()
        self._courses: deque[tuple[int, float]] = deque()
        self._course_at_stop: float | None = None
        self._lead_at_stop: float | None = None
        self._coast_ns: int | None = None
        self._sailed = True  # steadily, since the last coastdown
        self._bands: list[tuple[float, float]] = []
        self._speed: outputs.Figure | None = None
        self.resistance: outputs.Figure | None = None
        self._curve: outputs.Curve | None = None
        self._ahead = figures.Ahead()
        self._verdict: figures.PagePart = {'state': '', 'sentence': ''}  # as the health says it
        self._found: figures.PagePart | None = None  # the last diagnosis
        self._would_show = ''  # by the next coastdown
        self._notes: deque[tuple[int, str]] = deque(maxlen=_MESSAGES)
        self._noted: EventKind | None = None
        self._unread: set[str] = set()

    # heard

    def hear(self, heard: topics.Heard, now_s: float) -> None:
        """
        Take what was heard at a time [s, steady clock].
        """
        match heard:
            case topics.Samples(block):
                before_s = self._now_s
                self.trace.add(block)
                if self._now_s < before_s:  # time went back: the rest is of another one
                    self._recent, self._ahead = headline.Recent(), figures.Ahead()
                    self._courses.clear()
                self._recent.add(block)
                self._ahead.add(block)
                self._note_course()
            case topics.Health():
                self._heard_s = now_s
                self._take_health(heard)
            case topics.NodeMessage(name, payload):
                try:
                    self._take_output(name, payload)
                except Exception as error:  # whatever a peer sends, the page goes on
                    self._note_unread(name, error)
            case topics.ShipFile(text):
                try:
                    self.ship = Ship.from_yaml(text, subject="the node's ship file")
                except ShipdragError as error:
                    self._notes.append((self.now_ns, str(error)))

    def _note_unread(self, name: str, error: Exception) -> None:
        """Say of each topic once that it brings what is not understood."""
        if name not in self._unread:
            self._unread.add(name)
            why = f'{type(error).__name__}: {printable(str(error))}'
            text = f'~/{name} brings what is not understood ({why}); find who publishes it'
            self._notes.append((self.now_ns, text))

    def keep_alive(self, now_s: float) -> None:
        """
        Note that whoever sends is still there; a bag that is paused says nothing.
        """
        if self._heard_s is not None:
            self._heard_s = now_s

    def show_verdict(self, state: str, sentence: str, ahead: str = '') -> None:
        """
        Show how far the diagnosis is, and why there is none; `done`: the last one is shown.

        Until its document is there, its sentence is shown alone. `ahead`: what the next coastdown
        would show.
        """
        self._would_show = ahead
        rest: dict[str, list[Any]] = {'sizes': [], 'probabilities': [], 'decide': []}
        self._verdict = {'state': state, 'sentence': sentence, **rest}

    def take_diagnosis(self, found: Mapping[str, Any]) -> None:
        """
        Take the document of a diagnosis.

        Raises
        ------
        MalformedMessage
            If it is none of this package.
        """
        try:
            self._found = verdict_part(found)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise MalformedMessage(f'no document of a diagnosis: {error!r}') from error

    def add_past(self, run: outputs.PastRun) -> None:
        """
        Take a coastdown that has ended; one that is known already is not taken twice.
        """
        if all((run.start_ns, run.bag) != (known.start_ns, known.bag) for known in self.past):
            self.past.append(run)
            self.past.sort(key=lambda each: each.start_ns)

    @property
    def now_ns(self) -> int:
        """The ship's time: the latest stamp, 0 before the first [ns]."""
        return self.trace.newest_s * SECOND_NS

    def speed(self, now_s: float) -> SpeedNow | None:
        """
        Return the ship's speed: estimated while she coasts, else as measured.

        Parameters
        ----------
        now_s
            On the clock of `hear`.
        """
        measured = [
            SpeedNow(value, kind, self._age_s(now_s, name))
            for column, (name, kind) in enumerate(_SPEEDS)
            if (value := self.trace.newest(column)) is not None
        ]
        if self._coast_ns is not None and self._speed is not None:
            age_s = self._age_s(now_s, *MOTION_INPUTS)
            return SpeedNow(self._speed.value, 'through water, estimated', age_s)
        return min(measured, key=lambda each: max(each.age_s or 0.0, _OLD_S), default=None)

    def _age_s(self, now_s: float, *kinds: str) -> float | None:
        """Return how long ago the node received any of some kinds; None if that is not known."""
        names = [name for name in ALL_MOTION if kind_of(name) in kinds]
        ages = [self._health.of(f'input {name}').number('age') for name in names]
        age_s = min((age for age in ages if age is not None), default=None)
        if age_s is None or self._heard_s is None:
            return None
        return age_s + now_s - self._heard_s

    def _note_course(self) -> None:
        second, course = self._now_s, self._recent.direction(self._now_s)
        if course is not None and (not self._courses or self._courses[-1][0] != second):
            self._courses.append((second, course))
            while self._courses[0][0] < second - _COURSE_S:
                self._courses.popleft()

    def _take_health(self, health: topics.Health) -> None:
        self._health = health
        state = health.of('state')
        since, lead_s = state.number('coastdown since'), state.number('steady lead')
        coasting = state.values.get('monitor') == 'coastdown'
        self._sailed = not coasting and (self._sailed or state.values.get('monitor') == 'steady')
        if lead_s and not coasting:
            self._lead_at_stop = lead_s
        if coasting and self._coast_ns is None and since:
            self._begin(int(since))  # heard from the middle on
        elif not coasting:
            self._coast_ns = None
        found = health.of('diagnosis')
        if found.values:
            word = found.values.get('state', '')
            ahead = found.values.get(topics.AHEAD, '')
            self.show_verdict(word, found.message.removeprefix(f'{word}: '), ahead)

    def _take_output(self, name: str, payload: bytes) -> None:
        if name == 'speed':
            self._speed = outputs.read_figure(topics.SPEED, payload)
            self.trace.add_estimate(self._speed.stamp_ns, self._speed.value)
        elif name == 'resistance':
            self.resistance = outputs.read_figure(topics.RESISTANCE, payload)
        elif name == 'resistance_curve':
            curve = outputs.read_curve(payload)
            if curve is not None:
                self._curve = curve
                if self._coast_ns is not None and curve.stamp_ns > self._coast_ns:
                    age_s = (curve.stamp_ns - self._coast_ns) * 1e-9
                    self._bands.append((age_s, curve.band(self.ship)))
        elif name == 'forecast':
            coming = outputs.read_forecast(payload)
            self._ahead.take(coming, self.ship, self._speed, self._coast_ns)
        elif name == 'forecast_path':
            self._ahead.take_path(outputs.read_path(payload), self._coast_ns)
        elif name == 'events':
            self._take_event(payload)
        elif name == 'diagnosis':
            self.take_diagnosis(json.loads(types.deserialize(types.STRING, payload).data))

    def _take_event(self, payload: bytes) -> None:
        note = read_event(payload)
        if note.kind is EventKind.NO_ESTIMATE is self._noted and self._notes:
            self._notes.pop()  # the same again at every update; it would hide all the rest
        self._noted = note.kind
        self._notes.append((note.stamp_ns, note.text))
        if note.kind is EventKind.ONSET:
            self._begin(outputs.time_ns(note.values['start_ns']))
        elif note.kind is EventKind.COASTDOWN:
            run = outputs.PastRun.of(note, self._curve, bag=self._bag)
            self.add_past(run)
            if run.curve is None:
                self._curve = None  # what was drawn of it is no result
            self._ahead.end(run.ended_by)
            self._coast_ns = None
        elif note.kind is EventKind.RESET:
            self._coast_ns = None

    def _begin(self, start_ns: int) -> None:
        self._coast_ns, self._bands = start_ns, []
        self._curve = self.resistance = self._speed = None
        self._ahead.begin()
        before = [course for second, course in self._courses if second * 10**9 <= start_ns]
        self._course_at_stop = before[-1] if before else self._recent.direction(self._now_s)

    # shown

    @property
    def _now_s(self) -> int:
        return self.trace.newest_s

    def parts(self, now_s: float) -> dict[str, Any]:
        """
        Return every part of the page but the traces.

        Parameters
        ----------
        now_s
            On the clock of `hear`.
        """
        now = self._situation(now_s)
        of_run = now.coast_s is not None or now.just_ended is not None
        return {
            'headline': headline.headline(now)._asdict(),
            'ship': figures.ship_part(self.ship),
            'figures': self._figures(now_s),
            'curve': figures.curve_part(self._curve),
            'forecast': self._ahead.forecast if of_run else None,
            'if_stopped': None if of_run else self._if_stopped(now_s),
            'track': self._ahead.track,
            'inputs': self._inputs(now.silent_s or 0.0),
            'checks': self._checks(now, now_s),
            'verdict': self._verdict_now,
            'past': [figures.past_part(run, self.ship) for run in self.past[-PAST_RUNS:]],
            'notes': [[stamp // SECOND_NS, text] for stamp, text in self._notes],
        }

    def _if_stopped(self, now_s: float) -> figures.PagePart:
        speed = self.speed(now_s)
        read = speed is not None and (speed.age_s or 0.0) <= _OLD_S
        value = speed.value_m_s if speed is not None and read else None
        return self._ahead.if_stopped(self.ship, value, self._last_run, self._now_s)

    @property
    def _last_run(self) -> outputs.PastRun | None:
        """The last coastdown that gave a curve."""
        return next((run for run in reversed(self.past) if run.curve is not None), None)

    @property
    def _verdict_now(self) -> figures.PagePart:
        done = self._found if self._verdict['state'] == 'done' else None
        ahead = self._would_show if self._coast_ns is None else ''
        return {**(done or self._verdict), 'ahead': ahead}

    def _situation(self, now_s: float) -> headline.Situation:
        state = self._health.of('state')
        coast_s = None
        if self._coast_ns is not None and self._now_s:
            coast_s = max(self._now_s - self._coast_ns * 1e-9, 0.0)
        lead_s, ready_s = self._health.lead
        return headline.Situation(
            bag=self._bag,
            silent_s=None if self._heard_s is None else now_s - self._heard_s,
            lifecycle=state.values.get('lifecycle', ''),
            monitor=state.values.get('monitor', ''),
            trouble=self._trouble(state),
            doubt=self._doubt(),
            lead_s=lead_s,
            ready_s=ready_s,
            coast_s=coast_s,
            band=self._bands[-1][1] if self._bands else None,
            to_go_s=figures.to_go_s(self._bands, headline.GOAL),
            ended=self._ended(),
            sailed=self._sailed,
            steer_deg=self._steer_deg(),
            paired=self._is_paired,
        )

    def _trouble(self, state: topics.Status) -> str:
        if self._heard_s is None:
            return self.problem
        return state.message if state.level >= topics.ERROR else ''

    def _doubt(self) -> str:
        """Say which sources of the motion are not well; '' where all are."""
        return '; '.join(
            f'{status.input.replace("_", " ")}: {status.message}'
            for status in self._health.inputs
            if status.input in ALL_MOTION
            and status.level != topics.OK
            and status.number('messages')
        )

    def _ended(self) -> headline.Ended | None:
        own = [run for run in self.past if run.bag == self._bag]
        if not own or not self._now_s:
            return None
        last = own[-1]
        return headline.Ended(
            by=last.ended_by,
            ago_s=self._now_s - last.end_ns * 1e-9,
            band=None if last.curve is None else last.curve.band(self.ship),
            why_not=last.why_not,
        )

    @property
    def _is_paired(self) -> bool:
        return bool(self.past) and any(self.past[-1].is_paired_with(run) for run in self.past)

    def _steer_deg(self) -> float | None:
        if not self.past or self._is_paired or self.past[-1].curve is None:
            return None
        if self._now_s - self.past[-1].end_ns * 1e-9 > outputs.ONE_DAY_S:
            return None  # another day, another current
        return self.past[-1].reciprocal_deg

    def _figures(self, now_s: float) -> figures.PagePart:
        speed = self.speed(now_s)
        shown: dict[str, Any] = {'speed_m_s': None}
        if speed is not None:
            old = speed.age_s is not None and speed.age_s > _OLD_S
            shown = {
                'speed_m_s': speed.value_m_s,
                'speed_kind': speed.kind,
                'speed_old_s': int(speed.age_s or 0.0) if old else None,
            }
        if self.resistance is not None:
            shown |= {'r': self.resistance.value, 'r_sigma': self.resistance.sigma}
        estimate = self._health.of('estimate')
        if topics.OF_CONDITIONS in estimate.values:
            shown['r_of'] = estimate.values[topics.OF_CONDITIONS]
        last = self._last_run if self._coast_ns is None else None
        curve = last.curve if self._curve is None and last is not None else self._curve
        if curve is not None:
            shown['usual'] = figures.at_usual_speed(curve, self.ship)
            if last is not None:
                shown['usual']['run_s'] = last.start_ns // SECOND_NS  # not of now
        return shown

    def _inputs(self, silent_s: float) -> list[figures.PagePart]:
        silent = silent_s > headline.SILENT_S  # what the node said last is no health of now
        since_s = silent_s if silent else 0.0
        others = ('nmea ', 'recording')  # a sentence that is not used shows in no input
        besides = (each for each in self._health.statuses if each.part.startswith(others))
        rows = []
        for status in (*self._health.inputs, *besides):
            age_s = status.number('age')
            rejected = {
                key.removeprefix('rejected '): int(count)
                for key in status.values
                if key.startswith('rejected ') and (count := status.number(key))
            }
            rows.append(
                {
                    'name': status.part.removeprefix('input ').replace('_', ' '),
                    'level': topics.STALE if silent else status.level,
                    'text': f'not known, the node is silent; its last word: {status.message}'
                    if silent
                    else status.message,
                    'rate_hz': None if silent else status.number('rate'),
                    'age_s': None if age_s is None else age_s + since_s,
                    'rejected': rejected,
                }
            )
        return rows

    def _checks(self, now: headline.Situation, now_s: float) -> list[figures.PagePart]:
        speed = self.speed(now_s)
        speed_m_s = None if speed is None else speed.value_m_s
        second, coasting = self._now_s, now.coast_s is not None
        began = now.monitor == 'candidate' or coasting or now.just_ended is not None
        lead_s = self._lead_at_stop if began else None if now.trouble else now.lead_s
        course = self._recent.direction(second)
        before = self._course_at_stop if coasting else None
        if before is None and self._courses:
            before = self._courses[0][1]
        turned = None if course is None or before is None else course - before
        depth = self._recent.mean(Channel.DEPTH, second)
        rudder = self._recent.mean(Channel.RUDDER, second)
        shafts = [self._recent.mean(channel, second) for channel in SHAFTS]
        checks = [
            headline.lead_check(lead_s, now.ready_s),
            headline.wind_check(self._recent.mean(Channel.WIND_APPARENT, second), speed_m_s),
            headline.depth_check(depth and depth[0], speed_m_s, self.ship),
            headline.rudder_check(rudder and rudder[0]),
            headline.shaft_check(
                min((each[0] for each in shafts if each is not None), default=None)
            ),
            headline.course_check(turned, coasting=coasting),
            headline.reciprocal_check(now.steer_deg, paired=now.paired, coasting=coasting),
        ]
        return [self._unless_silent(check)._asdict() for check in checks]

    def _unless_silent(self, check: headline.Check) -> headline.Check:
        status = self._health.of(f'input {_CHECKED.get(check.name)}')
        if status.level != topics.STALE:
            return check
        return check._replace(held=headline.Held.SILENT, text=status.message)
