# SPDX-License-Identifier: Apache-2.0
"""
The monitor: samples in, events out, the same live and in replay.

It knows no ROS and no clock but the stamps. What comes out depends on the
sequence of samples alone, not on how it is cut into blocks, and not on what was
before the last `history_ns` of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipdrag_ros.coastdown.bins import SOURCES, forget_speeds
from shipdrag_ros.coastdown.events import (
    ENDED_BY,
    Dismissal,
    Dismissals,
    EndedBy,
    EndedCoastdown,
    Event,
    InputCounts,
    MonitorProgress,
    NotCoastdown,
    Onset,
    Reset,
    State,
    WholeGlide,
)
from shipdrag_ros.coastdown.heading import HEADING_BEFORE_S, heading_doubt, mean_heading
from shipdrag_ros.coastdown.kernel import WalkEvent, walk
from shipdrag_ros.coastdown.memory import (
    ALWAYS,
    CAPACITY,
    InputTally,
    Memory,
    Tuning,
    make_room,
    since,
)
from shipdrag_ros.coastdown.past import NEVER
from shipdrag_ros.coastdown.regimes import numbers
from shipdrag_ros.coastdown.regimes.watch import LATE_S, LEAD_S, Dated, RegimeFilter
from shipdrag_ros.coastdown.running import RunningCoastdown
from shipdrag_ros.coastdown.steadiness import Slopes
from shipdrag_ros.coastdown.validate import Limits, alive_ns, clock_set
from shipdrag_ros.coastdown.vouching import LOOK_S, Craft, Vouching
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.choice import averaged
from shipdrag_ros.estimation.estimators import WindowEstimator, shielded
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block
from shipdrag_ros.ship import Ship

_SILENT = (EndedBy.DATA_STOP, EndedBy.SILENCE)


class Monitor:
    """
    Finds coastdowns in a sequence of samples and estimates while they run.

    Parameters
    ----------
    ship
        For the minimum speed, for what a coastdown should look like, and for the estimates.
    parameters
        All of them matter.
    estimate
        The estimator; what it raises is a failure with words. None: there are no estimates
        while a coastdown runs.
    final
        An estimator of a coastdown that has ended, with the record before it.

    Notes
    -----
    Source: docs/architecture.md, the main job. It raises nothing: what is wrong with a sample
    is a counted rejection.

    Memory is bounded: `history_ns` of samples, at most `ring.CAPACITY` of them.

    Examples
    --------
    >>> from importlib import resources
    >>> from shipdrag_ros.ship import Ship
    >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    >>> from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
    >>> scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
    >>> block = sense(simulate(ship, scenario), standard_sensors(), seed=1)
    >>> from shipdrag_ros.coastdown import Monitor
    >>> from shipdrag_ros.parameters import Parameters
    >>> monitor = Monitor(ship, Parameters())
    >>> events = [*monitor.update(block), *monitor.finish()]
    >>> type(events[0]).__name__, type(events[-1]).__name__
    ('Onset', 'EndedCoastdown')
    """

    def __init__(
        self,
        ship: Ship,
        parameters: Parameters,
        *,
        estimate: WindowEstimator | None = estimate,
        final: WindowEstimator = estimate_final,
    ) -> None:
        self._ship = ship
        self._parameters = parameters
        self._estimator = None if estimate is None else shielded(averaged(estimate))
        self._final_estimator = shielded(averaged(final))
        slopes = Slopes.of(parameters)
        self._tuning = Tuning(
            Limits.of(parameters, ship.length_m),
            slopes,
            round(parameters.data_stop_s * SECOND_NS),
            float(ship.speed(parameters.froude_min)),
        )
        self._seconds = max(round(parameters.steady_s), LEAD_S) + 16 * slopes.width + 64
        self._memory = self._fresh(InputTally.fresh())
        self._history_ns = round(parameters.window_s * SECOND_NS) + self._seconds * SECOND_NS
        self._craft = Craft(ship.length_m, self._tuning.speed_min)
        self._vouching = Vouching(self._craft, parameters.frozen_s)
        self._running: RunningCoastdown | None = None
        self._regimes: RegimeFilter | None = None  # while awake
        self._silent = False  # it goes on unread, as the glide of which the readings ceased may
        # until when glides, whole ones, and what was none were told
        self._reported_s = self._followed_s = self._dismissed_s = -np.inf
        self._ended_by: EndedBy | None = None  # what was told of a glide may not be all of it
        self._dismissals = Dismissals(round(parameters.steady_s * SECOND_NS))

    @property
    def steady_lead_s(self) -> float:
        """
        The longest that the ship was steady since the start or the last reset [s].

        An onset needs `slope_window_s` of it.
        """
        lead = int(self._watch.steady_most)
        # the first slope is that of what came before, two thirds of a window at least
        return float(lead + 2 * self._tuning.slopes.width // 3) if lead else 0.0

    @property
    def progress(self) -> MonitorProgress:
        """How long the ship has been steady by now, and since when she coasts."""
        watch = self._watch
        used_s = self._parameters.steady_s
        steady_s = 0.0
        if int(watch.steady_since) != NEVER and self._running is None:
            seconds = (
                int(watch.seen) - int(watch.steady_since) + 2 * self._tuning.slopes.width // 3
            )
            steady_s = min(float(seconds), used_s)
        since_ns = None if self._running is None else self._running.onset.start_ns
        regimes = None if self._silent else self._regimes
        probability = {} if regimes is None else regimes.probability
        return MonitorProgress(steady_s, used_s, since_ns, probability)

    @property
    def state(self) -> State:
        """Where the monitor stands."""
        if self._running is not None:
            return State.COASTDOWN
        if self._regimes is not None and not self._silent and not self._regimes.even:
            return State.CANDIDATE
        source = int(self._watch.seen_source)
        if source == NEVER or np.isnan(self._memory.steadiness.limit[source, 0]):
            return State.WAITING
        return State.STEADY

    @property
    def history_ns(self) -> int:
        """
        Length of record that decides what comes out [ns].

        A monitor that has seen this much of a sequence says the same from then
        on as one that has seen all of it, unless a coastdown longer than
        `window_s`, a sensor that froze longer ago, or manoeuvres without five
        minutes of even power between them, reach back beyond it.
        """
        return self._history_ns

    def doubts(self) -> dict[str, str]:
        """
        Say which inputs contradict each other: a speed another speed, a heading its course.
        """
        heading = heading_doubt(self._memory.bins, self._parameters.heading_convention)
        return self._vouching.texts | ({'heading': heading} if heading else {})

    def contradictions(self) -> dict[str, str]:
        """
        Say which inputs contradicted another at any time.
        """
        return self._vouching.ever

    def left_out(self) -> dict[str, str]:
        """
        Say which inputs were left out at any time, as another contradicted them.
        """
        return self._vouching.left_out

    def counts(self) -> dict[str, InputCounts]:
        """
        Return what became of the samples of every input, by its name.
        """
        return self._memory.tally.counts()

    def update(self, block: Block) -> list[Event]:
        """
        Take the next samples of the sequence.

        Returns
        -------
        list
            What has come of them, in order.
        """
        channel = np.ascontiguousarray(block.channel)
        stamp_ns = np.ascontiguousarray(block.stamp_ns)
        receive_ns = np.ascontiguousarray(block.receive_ns)
        value, variance = block.value, block.variance
        events: list[Event] = []
        at, stop = 0, int(WalkEvent.FULL)
        while True:
            at, stop = walk(
                self._memory, self._tuning, channel, stamp_ns, receive_ns, value, variance, at
            )
            if stop == WalkEvent.END:
                return events
            if stop == WalkEvent.FULL:
                self._make_room()
            elif stop == WalkEvent.UPDATE:
                events += self._vouching.explained([self._update(int(stamp_ns[at]))])
            elif stop == WalkEvent.BIN:
                events += self._vouching.explained(self._follow())
            elif stop == WalkEvent.LOOK:
                events += self._vouching.explained(self._vouch(int(stamp_ns[at])))
            elif stop == WalkEvent.SILENCE:
                if not self._fall_back(int(stamp_ns[at])):
                    events += self._bear_silence(int(stamp_ns[at]))
            elif stop == WalkEvent.SLOPE:
                source = int(channel[at])
                self._wake(source, int(self._memory.bins.closed[source]))
            elif stop == WalkEvent.SHAFT:
                number = int(self._memory.bins.filling[channel[at]])
                self._wake(int(self._watch.seen_source), number)
            else:
                arrival, guard = int(receive_ns[at]), self._memory.guard
                why = clock_set(guard, stop, int(channel[at]), int(stamp_ns[at]), arrival)
                events += self.reset(arrival, why)

    def reset(self, receive_ns: int, reason: str) -> list[Event]:
        """
        Drop all memory but the counts of `health`.

        Parameters
        ----------
        receive_ns
            Time of arrival at which it happens [ns].
        reason
            For whoever reads the events.
        """
        events = self._stop_at_last_sample(EndedBy.RESET)
        events += self._dismissals.flush()
        self._memory = self._fresh(self._memory.tally)
        self._reported_s = self._followed_s = self._dismissed_s = -np.inf
        self._ended_by = None
        self._vouching = Vouching(self._craft, self._parameters.frozen_s)
        return [*events, Reset(receive_ns, reason)]

    def engine_stopped(self, receive_ns: int) -> str:
        """
        Take it from a person that the engine was stopped, within some seconds.

        It is evidence like the rest, and wakes the regimes.

        Parameters
        ----------
        receive_ns
            Time of arrival of what the person said [ns]; stamps may be of another clock.

        Returns
        -------
        str
            Why it is of no use; '' where it is weighed.
        """
        source, tally = int(self._watch.seen_source), self._memory.tally
        if source == NEVER:
            return 'no speed was read yet, so there is nothing to weigh the stop with'
        if self._regimes is None or self._silent:
            self._wake(source, int(self._watch.seen))
        assert self._regimes is not None
        self._regimes.tell((receive_ns + int(tally.clock_ns[source])) / SECOND_NS)
        return ''

    def fall_silent(self) -> list[Event]:
        """
        End a coastdown, or what may be one, at the last sample of its speed source.

        For whoever has a clock and knows that all sources are silent; the memory stays.
        """
        return self._stop_at_last_sample(EndedBy.SILENCE)

    def finish(self) -> list[Event]:
        """
        End the record, and a coastdown that runs.
        """
        return self._stop_at_last_sample(EndedBy.RECORD_END) + self._dismissals.flush()

    def ended_window(self, ended: EndedCoastdown) -> Window:
        """
        Cut the whole of a coastdown that has just ended, and the record before it.

        What is older than `history_ns` may be missing; after a reset all is.
        """
        start_ns = ended.start_ns if ended.stop_ns is None else ended.stop_ns
        before_ns = round(self._parameters.steady_s * SECOND_NS)
        window = self._cut(start_ns, ended.end_ns, start_ns - before_ns)
        return replace(window, told_ns=ended.told_ns)

    def steady_window(self) -> Window | None:
        """
        Cut the steady record up to now; None while she is not steady.
        """
        steady_s = self.progress.steady_s
        if self.state is not State.STEADY or not steady_s:
            return None
        now_ns = int(self._memory.guard.last_ns[self._watch.seen_source])
        first_ns = now_ns - round(steady_s * SECOND_NS)
        return self._cut(first_ns, now_ns, first_ns)

    @property
    def _watch(self) -> np.record:
        watch: np.record = self._memory.watch[0]
        return watch

    def _fresh(self, tally: InputTally) -> Memory:
        return Memory.fresh(self._tuning.slopes, seconds=self._seconds, tally=tally)

    # what the walk stopped for

    def _vouch(self, now_ns: int) -> list[Event]:
        """Compare log and track, and go on with one that is sound."""
        watch, number = self._watch, now_ns // SECOND_NS
        watched = int(watch.source)
        bins, width = self._memory.bins, self._tuning.slopes.width
        for source in self._vouching.look(bins, number, width, hold=watched != NEVER):
            forget_speeds(bins, source)
            self._memory.steadiness.forget(source)
        watch.look = (number // LOOK_S + 1) * LOOK_S
        lie = math.nan if self._regimes is None or self._silent else self._regimes.shafts_lie
        self._vouching.look_at_shafts(bins, number - LATE_S, lie)
        newly = (self._vouching.until > number) & (watch.doubted <= number)
        watch.doubted[:] = self._vouching.until
        if watched != NEVER and watch.doubted[watched] > number:
            self._fall_back(now_ns)
        return self._judged_anew(number) if watched != NEVER and newly[SOURCES].any() else []

    def _make_room(self) -> None:
        store = make_room(
            self._memory.store,
            keep_ns=self._history_ns,
            late_ns=self._tuning.limits.late_ns,
            capacity=CAPACITY,
        )
        self._memory = self._memory._replace(store=store)

    def _wake(self, source: int, number: int, lead_s: int = LEAD_S) -> RegimeFilter:
        """Let the regimes take the record, from some minutes before a second on."""
        self._watch.source = source
        before, bins = self._regimes, self._vouching.sound(self._memory.bins)
        woken = self._regimes = RegimeFilter(self._ship, bins, number, lead_s)
        self._silent = False
        if before is not None:
            woken.tell(before.told_s)
        return woken

    def _judged_anew(self, number: int) -> list[Event]:
        """Let the record be judged without what is doubted now, and a coastdown with it."""
        source, before = int(self._watch.source), self._regimes
        if self._running is None or before is None:
            self._wake(source, number)
            return []
        onset = self._running.onset.start_ns // SECOND_NS
        lead_s = number - onset + LEAD_S
        if lead_s > self._seconds:  # no longer kept
            return []
        regimes = self._wake(source, number, lead_s)
        bins = self._vouching.sound(self._memory.bins, shafts=regimes.hears_shafts)
        until = int(self._memory.bins.filling[source])
        while regimes.advance(bins, until):
            pass
        # the others were not read then, or the shafts bear out what is doubted and not them
        if regimes.begun_s > onset or regimes.shafts_lie > 0.5 > before.shafts_lie:
            self._regimes = before
            return []
        return self._decide(regimes, until)

    def _follow(self) -> list[Event]:
        """Let the regimes take all bins of the source watched that are whole."""
        if self._regimes is None:
            return []
        number = int(self._memory.bins.filling[self._watch.source])
        return self._judged(number, number)

    def _judged(self, until: int, number: int) -> list[Event]:
        """Let the regimes take all bins that are whole by a second, and decide after each."""
        events: list[Event] = []
        heard = self._regimes is not None and self._regimes.hears_shafts
        bins = self._vouching.sound(self._memory.bins, shafts=heard)
        while (regimes := self._regimes) is not None and regimes.advance(bins, until):
            events += self._decide(regimes, number)
        return events

    def _decide(self, regimes: RegimeFilter, number: int) -> list[Event]:
        announce, again, over = (float(each) for each in numbers.ANNOUNCE)
        slow_s = regimes.slow_since(self._tuning.speed_min)
        slow = slow_s is not None
        if self._running is not None:
            # a glide that is born since is not the one that was announced
            same = regimes.gliding_since(self._running.onset.detected_ns / SECOND_NS)
            glides = regimes.gliding > again or same > over
            if glides and not slow and not regimes.full:
                return []
            why = EndedBy.SPEED if slow else EndedBy.RESET if regimes.full else None
            events = self._end_glide(regimes, number, why, _ns(slow_s))
            return events + (self._rest(regimes, number) if slow else [])
        if slow and not regimes.caught_up:  # long ago: she has sailed since
            return []
        if slow or regimes.asleep or (self._silent and self._lost(regimes)):
            return self._rest(regimes, number)
        if regimes.full:
            return self._anew(regimes, number)
        glides = regimes.gliding > announce
        if not glides and not regimes.due:
            return []
        events = []
        for each in self._unreported(regimes):
            if glides and each.ended_by is None:
                return [*events, self._begin(each, number)]
            if glides or each.end_s < number - LEAD_S:
                events += self._tell([each], regimes, number, None, None)
        return events

    def _tell(
        self,
        dated: Sequence[Dated],
        regimes: RegimeFilter,
        number: int,
        ended_by: EndedBy | None,
        last_ns: int | None,
    ) -> list[Event]:
        """Report glides, the first of which may be announced; the last ends as the record does."""
        events: list[Event] = []
        for one in dated:
            if self._running is None:
                events.append(self._begin(one, number))
            end = (ended_by, last_ns) if one is dated[-1] else (None, None)
            events += self._end(one, regimes, *end)
        return events

    def _unreported(self, regimes: RegimeFilter, last_ns: int | None = None) -> list[Dated]:
        """Return the glides that were not told; of one said to have ended under way, the rest."""
        since_s, found = self._reported_s, []
        last_s = np.inf if last_ns is None else last_ns / SECOND_NS
        silent = self._ended_by in _SILENT
        heard_s = regimes.read_after(since_s) if silent else since_s
        for each in (self._as_read(glide, regimes) for glide in regimes.glides(since_s)):
            if each.begin_s >= heard_s:
                found.append(each)
            elif silent or (self._ended_by is not EndedBy.SPEED and each.ended_by is None):
                rest = each.since(heard_s, since_s) if silent else each.since(since_s)
                if rest.end_s >= rest.begin_s + numbers.SHORTEST_S:
                    found.append(rest)
        return [each for each in found if each.begin_s < min(last_s, each.end_s)]

    def _as_read(self, glide: Dated, regimes: RegimeFilter) -> Dated:
        """Let a glide that ended while nothing was read end with the last reading."""
        first_s, last_s = regimes.unread_about(glide.end_s)
        if glide.ended_by is None or last_s - first_s <= self._parameters.data_stop_s:
            return glide
        return glide._replace(end_s=first_s, ended_by=EndedBy.DATA_STOP)

    def _begin(self, dated: Dated, number: int) -> Onset:
        start = max(int(dated.start_s), 1)
        onset = Onset(start * SECOND_NS, (number + 1) * SECOND_NS)
        heading = mean_heading(self._memory.bins, start - 1, HEADING_BEFORE_S)
        self._running = RunningCoastdown(
            onset, heading, dated, cut=self._cut, ship=self._ship, parameters=self._parameters
        )
        self._silent = False
        if self._estimator is not None:
            self._watch.update_ns = self._running.due_ns(onset.detected_ns)
        return onset

    def _end_glide(
        self,
        regimes: RegimeFilter,
        number: int,
        ended_by: EndedBy | None,
        last_ns: int | None = None,
    ) -> list[Event]:
        """End the coastdown that runs, as the histories have it now, and tell any after it."""
        assert self._running is not None
        onset, dated = self._running.onset, self._unreported(regimes, last_ns)
        more = [each for each in dated if each.end_s > onset.start_ns / SECOND_NS]
        # one that began since is not the one that was announced
        same = more and more[0].stop_s < onset.detected_ns / SECOND_NS
        events = [] if same else self._withdraw(regimes, ended_by)
        return events + self._tell(more, regimes, number, ended_by, last_ns)

    def _withdraw(self, regimes: RegimeFilter, ended_by: EndedBy | None) -> list[Event]:
        """Say that the coastdown that runs was none."""
        assert self._running is not None
        start_ns = self._running.onset.start_ns
        end_ns = max(start_ns, int(self._watch.seen) * SECOND_NS)
        was = regimes.dismissal(start_ns / SECOND_NS)
        self._dismissed_s = (end_ns if was is None else was.end_ns) / SECOND_NS
        events = self._running.withdraw(was, ended_by, end_ns, regimes.regimes())
        self._running = None
        self._watch.update_ns = ALWAYS
        return events

    def _end(
        self,
        dated: Dated,
        regimes: RegimeFilter,
        ended_by: EndedBy | None,
        last_ns: int | None = None,
    ) -> list[Event]:
        """End the coastdown that runs; one that goes on at the last sample ends there."""
        if dated.ended_by is None and last_ns is not None:
            dated = dated._replace(end_s=last_ns / SECOND_NS)
        assert self._running is not None
        events = self._running.end(dated, ended_by, regimes.regimes(), self._final_estimator)
        self._running, self._reported_s = None, dated.end_s
        self._ended_by = dated.ended_by or ended_by
        self._watch.update_ns = ALWAYS
        return events

    def _rest(
        self,
        regimes: RegimeFilter,
        number: int,
        ended_by: EndedBy | None = None,
        last_ns: int | None = None,
    ) -> list[Event]:
        """Report what was never announced, say what it was if nothing, and sleep."""
        since_s = max(self._reported_s, self._dismissed_s)
        slow_s, otherwise = regimes.slow_since(self._tuning.speed_min), ended_by
        if ended_by is None and slow_s is not None:
            otherwise, last_ns = EndedBy.SPEED, _ns(slow_s)
        dated = self._unreported(regimes, last_ns)
        before, events = self._silent, self._tell(dated, regimes, number, otherwise, last_ns)
        if before:  # what was none was said when the readings ceased
            self._stand_down()
            return events
        if not dated:
            was = regimes.dismissal(since_s)
            if was is not None:
                known = regimes.even or was.reason is Dismissal.LEAD_IN
                if ended_by is not None and not known:
                    was = cut_short(was, ended_by, regimes.gliding)
                events += self._dismissals.take(was)
            self._dismissed_s = regimes.taken_s  # the next bank is not asked about it again
        for first_s, last_s in regimes.whole_glides():
            if first_s >= self._followed_s:
                events.append(WholeGlide(round(first_s * SECOND_NS), round(last_s * SECOND_NS)))
                self._followed_s = last_s
        self._stand_down()
        return events

    def _anew(self, regimes: RegimeFilter, number: int) -> list[Event]:
        """Begin again with the last minutes: she may manoeuvre for days."""
        source = int(self._watch.source)
        events = self._rest(regimes, number)
        self._regimes = regimes  # what a person told it stays told
        self._wake(source, number)
        return events

    def _fall_back(self, now_ns: int) -> bool:
        """Go on with another speed source where the one watched is silent, if there is one."""
        steadiness, guard, tuning = self._memory.steadiness, self._memory.guard, self._tuning
        failed = int(self._watch.source)
        for source in SOURCES.tolist():
            # by the rule that found the other silent: or both would be tried in turn for ever
            silent = now_ns > alive_ns(guard, tuning.limits, source) + tuning.data_stop_ns
            doubted = self._watch.doubted[source] > now_ns // SECOND_NS
            if source == failed or silent or doubted or np.isnan(steadiness.limit[source, 0]):
                continue
            self._watch.source = source
            return True
        return False

    def _update(self, next_stamp_ns: int) -> Event:
        assert self._running is not None
        assert self._regimes is not None
        assert self._estimator is not None
        watch = self._watch
        stamp_ns = int(watch.update_ns)
        watch.update_ns = self._running.due_ns(next_stamp_ns)
        gliding = self._regimes.gliding > 0.5
        last = self._unreported(self._regimes)[-1:]
        dated = last[0] if last and last[0].ended_by is None else None
        return self._running.update(stamp_ns, dated, self._estimator, gliding=gliding)

    def _cut(self, start_ns: int, end_ns: int, first_ns: int) -> Window:
        """Cut a window, with the record from `first_ns` on before it."""
        kept = since(
            self._memory.store,
            first_ns,
            late_ns=self._tuning.limits.late_ns,
            capacity=CAPACITY,
        )
        kept = self._vouching.kept(kept)
        window = Window.from_block(
            kept, start_ns, end_ns, before_ns=first_ns if first_ns < start_ns else None
        )
        notes = (*window.notes, *self._vouching.notes(start_ns))
        log, doubt = self._vouching.log_doubt
        told_ns = None if self._regimes is None else self._regimes.told_ns
        return replace(
            window, notes=notes, doubted_log=log, log_doubt=doubt, told_ns=told_ns, found=True
        )

    # how a coastdown ends

    def _bear_silence(self, now_ns: int) -> list[Event]:
        """End what runs once the source watched is silent; what may glide on goes on unread."""
        watch, events = self._watch, list[Event]()
        if not self._silent or self._memory.guard.last_ns[watch.source] > watch.silent_ns:
            events = self._stop_at_last_sample(EndedBy.DATA_STOP)
        watch.silent_ns = now_ns
        number = now_ns // SECOND_NS
        return events + self._vouching.explained(self._judged(number, number))

    def _lost(self, regimes: RegimeFilter) -> bool:
        """Say whether a glide of which the readings ceased has probably ended by now."""
        since_s = self._reported_s
        unread = regimes.read_after(since_s) >= regimes.taken_s
        chance = regimes.gliding_since(since_s) if unread else regimes.gliding
        return chance <= float(numbers.ANNOUNCE[1])

    def _stop_at_last_sample(self, ended_by: EndedBy) -> list[Event]:
        """End what runs, if anything, at the last sample of its speed source."""
        if self._regimes is None:
            return []
        end_ns = int(self._memory.guard.last_ns[self._watch.source])
        number = end_ns // SECOND_NS
        events = self._judged(number + 1, number)  # what came since the last bin that was judged
        regimes = self._regimes
        if regimes is None:
            return self._vouching.explained(events)
        if self._running is not None:
            events += self._end_glide(regimes, number, ended_by, end_ns)
        source, end_s = int(self._watch.source), end_ns / SECOND_NS
        events += self._rest(regimes, number, ended_by, end_ns)
        if ended_by in _SILENT:
            self._reported_s, self._ended_by = end_s, ended_by
            self._watch.silent_ns = end_ns
            if not self._lost(regimes):
                self._regimes, self._watch.source, self._silent = regimes, source, True
        return self._vouching.explained(events)

    def _stand_down(self) -> None:
        """Watch for an onset again, once the ship has been steady."""
        watch = self._watch
        watch.source = NEVER
        watch.update_ns = ALWAYS
        watch.armed = 0
        self._running, self._regimes, self._silent = None, None, False


def _ns(second: float | None) -> int | None:
    return None if second is None else round(second * SECOND_NS)


def cut_short(was: NotCoastdown, ended_by: EndedBy, gliding: float) -> NotCoastdown:
    """
    Say that a record ended before it was clear what a stretch is.
    """
    text = f'{ENDED_BY[ended_by]} before it was clear what it is: P(gliding) was {gliding:.2f}'
    return replace(was, reason=Dismissal.GAP, text=text)
