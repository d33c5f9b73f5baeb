# SPDX-License-Identifier: Apache-2.0
"""
The monitor: samples in, events out, the same live and in replay.

It knows no ROS and no clock but the stamps. What comes out depends on the
sequence of samples alone, not on how it is cut into blocks, and not on what was
before the last `history_ns` of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shipdrag_ros.coastdown.bins import SOURCES, forget_speeds
from shipdrag_ros.coastdown.direction import heading_doubt
from shipdrag_ros.coastdown.dismissals import Dismissals
from shipdrag_ros.coastdown.driving import start_of
from shipdrag_ros.coastdown.ending import End, cut_short, end_of, withdrawn
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    NotCoastdown,
    Onset,
    Reset,
    State,
)
from shipdrag_ros.coastdown.health import InputHealth, MonitorProgress, input_health
from shipdrag_ros.coastdown.kernel import WalkEvent, walk
from shipdrag_ros.coastdown.memory import ALWAYS, RECENT, InputTally, Memory, Tuning
from shipdrag_ros.coastdown.onset import Doubt, OnsetCandidate, OnsetDecision, judge, propose
from shipdrag_ros.coastdown.regimes import numbers
from shipdrag_ros.coastdown.ring import CAPACITY, make_room, since
from shipdrag_ros.coastdown.running import Chosen, RunningCoastdown
from shipdrag_ros.coastdown.shafts import Drive
from shipdrag_ros.coastdown.steadiness import Slopes
from shipdrag_ros.coastdown.tracking import HEADING_BEFORE_S, mean_heading
from shipdrag_ros.coastdown.validate import NEVER, Limits, alive_ns, clock_set
from shipdrag_ros.coastdown.vouching import LOOK_S, Craft, Vouching
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.doubted import averaged
from shipdrag_ros.estimation.estimator import WindowEstimator
from shipdrag_ros.estimation.shield import shielded
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Reason
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from shipdrag_ros.coastdown.regimes.watch import Dated, RegimeFilter


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
            Limits.of(parameters),
            slopes,
            round(parameters.data_stop_s * SECOND_NS),
            float(ship.speed(parameters.froude_min)),
            parameters.regimes == 'filter',
        )
        self._seconds = (
            round(parameters.steady_s + 4 * parameters.confirm_s) + 16 * slopes.width + 64
        )
        self._memory = self._fresh(InputTally.fresh())
        self._history_ns = round(parameters.window_s * SECOND_NS) + self._seconds * SECOND_NS
        self._craft = Craft(ship.length_m, self._tuning.speed_min)
        self._vouching = Vouching(self._craft)
        self._candidate: OnsetCandidate | None = None
        self._running: RunningCoastdown | None = None
        self._regimes: RegimeFilter | None = None
        self._reported_s = -np.inf  # until when glides were reported
        self._dismissals = Dismissals(round(parameters.steady_s * SECOND_NS))

    @property
    def steady_lead_s(self) -> float:
        """
        The longest that the ship was steady since the start or the last reset [s].

        An onset needs `slope_window_s` of it.
        """
        lead = int(self._memory.watch.lead[1])
        # the first slope is that of what came before, two thirds of a window at least
        return float(lead + 2 * self._tuning.slopes.width // 3) if lead else 0.0

    @property
    def progress(self) -> MonitorProgress:
        """How long the ship has been steady by now, and since when she coasts."""
        watch = self._memory.watch
        used_s = self._parameters.steady_s
        steady_s = 0.0
        if int(watch.lead[0]) != NEVER and self._running is None:
            seconds = int(watch.seen[0]) - int(watch.lead[0]) + 2 * self._tuning.slopes.width // 3
            steady_s = min(float(seconds), used_s)
        since_ns = None if self._running is None else self._running.onset.start_ns
        return MonitorProgress(steady_s, used_s, since_ns)

    @property
    def state(self) -> State:
        """Where the monitor stands."""
        if self._running is not None:
            return State.COASTDOWN
        if self._candidate is not None:
            return State.CANDIDATE
        source = int(self._memory.watch.seen_source[0])
        if source == NEVER or np.isnan(self._memory.steadiness.limit[source, 0]):
            return State.WAITING
        return State.STEADY

    @property
    def history_ns(self) -> int:
        """
        Length of record that decides what comes out [ns].

        A monitor that has seen this much of a sequence says the same from then
        on as one that has seen all of it, unless a coastdown longer than
        `window_s`, or a sensor that froze longer ago, reaches back beyond it.
        """
        return self._history_ns

    def doubts(self) -> dict[str, str]:
        """
        Say which inputs contradict each other: a speed another speed, a heading its course.
        """
        bins = self._memory.bins
        heading = heading_doubt(bins, self._parameters.heading_convention)
        found = self._vouching.texts
        return found | ({'heading': heading} if heading else {})

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

    def health(self) -> dict[str, InputHealth]:
        """
        Say how every input is doing, by its name.
        """
        return input_health(self._memory.tally)

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
                events += self._vouching.explained(self._judge())
            elif stop == WalkEvent.LOOK:
                self._vouch(int(stamp_ns[at]))
            elif stop == WalkEvent.SILENCE:
                if not self._fall_back(int(stamp_ns[at])):
                    events += self._stop_at_last_sample(EndedBy.DATA_STOP)
            elif stop == WalkEvent.SLOPE:
                source = int(channel[at])
                self._propose(source, int(self._memory.bins.closed[source]), noticed=True)
            elif stop == WalkEvent.SHAFT:
                source = int(self._memory.watch.seen_source[0])
                number = int(self._memory.bins.filling[channel[at]])
                self._propose(source, number, noticed=False)
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
        self._memory, self._reported_s = self._fresh(self._memory.tally), -np.inf
        self._vouching = Vouching(self._craft)
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
        source, tally = int(self._memory.watch.seen_source[0]), self._memory.tally
        if self._parameters.regimes != 'filter':
            return 'the rules judge, which weigh no such thing: set the parameter regimes: filter'
        if source == NEVER:
            return 'no speed was read yet, so there is nothing to weigh the stop with'
        if self._regimes is None:
            self._propose(source, int(self._memory.watch.seen[0]), noticed=True)
        assert self._regimes is not None
        last = (int(tally.reasons[source, Reason.ACCEPTED]) - 1) % RECENT
        clock_ns = int(tally.stamp_ns[source, last] - tally.arrival_ns[source, last])
        self._regimes.tell((receive_ns + clock_ns) / SECOND_NS)
        return ''

    def fall_silent(self) -> list[Event]:
        """
        End a coastdown, or a candidate, at the last sample of its speed source.

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
        start_ns, steady = start_of(ended, self._ship)
        before_ns = round(self._parameters.steady_s * SECOND_NS) if steady else 0
        return self._cut(start_ns, ended.end_ns, start_ns - before_ns)

    def _fresh(self, tally: InputTally) -> Memory:
        return Memory.fresh(self._tuning.slopes, seconds=self._seconds, tally=tally)

    # what the walk stopped for

    def _vouch(self, now_ns: int) -> None:
        """Compare log and track, and go on with one that is sound."""
        watch, number = self._memory.watch, now_ns // SECOND_NS
        watched = int(watch.source[0])
        bins, width = self._memory.bins, self._tuning.slopes.width
        for source in self._vouching.look(bins, number, width, hold=watched != NEVER):
            forget_speeds(bins, source)
            self._memory.steadiness.forget(source)
        watch.look[0] = (number // LOOK_S + 1) * LOOK_S
        watch.doubted[:] = self._vouching.until
        if watched != NEVER and watch.doubted[watched] > number:
            self._fall_back(now_ns)

    def _make_room(self) -> None:
        store = make_room(
            self._memory.store,
            keep_ns=self._history_ns,
            late_ns=self._tuning.limits.late_ns,
            capacity=CAPACITY,
        )
        self._memory = self._memory._replace(store=store)

    def _propose(self, source: int, number: int, *, noticed: bool) -> None:
        watch, bins = self._memory.watch, self._vouching.sound(self._memory.bins)
        watch.source[0] = source
        seen = OnsetCandidate(source, number, Drive(), noticed).knowing(self._memory.steadiness)
        if self._parameters.regimes == 'filter':
            # compiled for whoever asks for it alone: that takes a while
            from shipdrag_ros.coastdown.regimes.watch import RegimeFilter

            width = RegimeFilter.width(self._parameters.slope_window_s)
            self._regimes = RegimeFilter(bins, self._ship, width, number)
            self._candidate = seen
            return
        self._candidate = propose(bins, self._tuning, seen, number)

    def _judge(self) -> list[Event]:
        assert self._candidate is not None
        bins, steadiness = self._vouching.sound(self._memory.bins), self._memory.steadiness
        tuning, parameters = self._tuning, self._parameters
        number = int(bins.filling[self._candidate.source])
        if self._regimes is not None:
            return self._follow(self._regimes, number)
        if self._running is not None:
            end = end_of(self._candidate, bins, tuning, parameters, number)
            return [] if end is None else self._end_at(end, (end.last + 1) * SECOND_NS)
        candidate = self._candidate
        if not candidate.noticed and self._memory.watch.falls[0]:
            # from here on as if the speed alone had made it one
            candidate = replace(
                candidate, noticed=True, start=number, slope_sd=np.nan, trials=0, doubt=None
            )
            candidate = propose(bins, tuning, candidate.knowing(steadiness), number)
        found = judge(candidate.knowing(steadiness), bins, self._ship, tuning, parameters, number)
        self._candidate = found.candidate
        if found.decision is OnsetDecision.DISMISSED:
            return self._dismiss(found.doubt, (number + 1) * SECOND_NS)
        if found.decision is OnsetDecision.CONFIRMED:
            return [self._begin(self._candidate, number)]
        return []

    # the same by the regimes

    def _follow(self, regimes: RegimeFilter, number: int) -> list[Event]:
        """Let the filter take what has come up to a second."""
        events: list[Event] = []
        while self._regimes is regimes and regimes.advance(
            self._vouching.sound(self._memory.bins), number
        ):
            events += self._decide(regimes, number)
        return events

    def _decide(self, regimes: RegimeFilter, number: int) -> list[Event]:
        announce, again = (float(each) for each in numbers.ANNOUNCE)
        slow = regimes.slow < self._tuning.speed_min
        if self._running is not None:
            if not slow and regimes.gliding > again:
                return []
            events = self._end_glide(regimes, EndedBy.SPEED if slow else None)
            return events + (self._rest(regimes, number) if slow else [])
        if slow or regimes.asleep:
            return self._rest(regimes, number)
        if regimes.gliding < announce:
            return []
        dated = self._unreported(regimes)
        if not dated:
            return []
        events = [event for one in dated[:-1] for event in self._all_of(one, regimes, number)]
        return [*events, self._begin_glide(dated[-1], number)]

    def _unreported(self, regimes: RegimeFilter) -> list[Dated]:
        return [each for each in regimes.glides() if each.begin_s >= self._reported_s]

    def _all_of(self, one: Dated, regimes: RegimeFilter, number: int) -> list[Event]:
        """Report a glide that was never announced."""
        begun = self._begin_glide(one, number)
        cause = regimes.ended_by(one.after) if one.after >= 0 else EndedBy.SPEED
        return [begun, *self._end_one(one, cause)]

    def _end_one(self, one: Dated, cause: EndedBy) -> list[Event]:
        assert self._running is not None
        end_ns = round(one.end_s * SECOND_NS)
        events = self._running.end(cause, end_ns, None, self._final_estimator, _chosen(one))
        self._running, self._reported_s = None, one.end_s
        return events

    def _begin_glide(self, dated: Dated, number: int) -> Onset:
        assert self._candidate is not None
        candidate = replace(self._candidate, start=max(int(dated.begin_s), 1))
        return self._begin(candidate, number)

    def _end_glide(self, regimes: RegimeFilter, ended_by: EndedBy | None) -> list[Event]:
        """End the coastdown that runs, as the histories have it now."""
        assert self._running is not None
        start_ns = self._running.onset.start_ns
        after_s = start_ns / SECOND_NS - 0.5 * self._parameters.confirm_s
        dated = [each for each in self._unreported(regimes) if each.end_s > after_s]
        if not dated:
            reason, text = regimes.dismissal()
            end_ns = max(start_ns, int(self._memory.watch.seen[0]) * SECOND_NS)
            events = self._running.end(
                ended_by or EndedBy.ENGINE, end_ns, Doubt(reason, text), self._final_estimator
            )
        else:
            one = dated[0]
            events = self._end_one(one, ended_by or regimes.ended_by(one.after))
            number = int(self._memory.watch.seen[0])
            for other in dated[1:]:
                events += self._all_of(other, regimes, number)
        self._running = None
        self._memory.watch.update_ns[0] = ALWAYS
        return events

    def _rest(self, regimes: RegimeFilter, number: int) -> list[Event]:
        """Report what was never announced, say what it was if nothing, and sleep."""
        assert self._candidate is not None
        events: list[Event] = []
        dated = self._unreported(regimes)
        for one in dated:
            events += self._all_of(one, regimes, number)
        if not dated and self._reported_s < self._candidate.start and regimes.doubted:
            reason, text = regimes.dismissal()
            start_ns, end_ns = self._candidate.start * SECOND_NS, (number + 1) * SECOND_NS
            events += self._dismissals.take(NotCoastdown(start_ns, end_ns, reason, text))
        self._stand_down()
        return events

    def _dismiss(self, doubt: Doubt | None, end_ns: int) -> list[Event]:
        """Give a candidate up and say why."""
        assert self._candidate is not None
        start_ns = self._candidate.start * SECOND_NS
        # the stop may be still to come, and the shafts then show it
        driven = doubt is None or doubt.reason in (Dismissal.THRUST, Dismissal.OTHER)
        self._stand_down(driven=driven)
        if doubt is None:
            return []
        return self._dismissals.take(NotCoastdown(start_ns, end_ns, doubt.reason, doubt.text))

    def _fall_back(self, now_ns: int) -> bool:
        """Go on with another speed source where the one watched is silent, if there is one."""
        assert self._candidate is not None
        steadiness, guard, tuning = self._memory.steadiness, self._memory.guard, self._tuning
        failed = self._candidate.source
        for source in range(SOURCES):
            # by the rule that found the other silent: or both would be tried in turn for ever
            silent = now_ns > alive_ns(guard, tuning.limits, source) + tuning.data_stop_ns
            doubted = self._memory.watch.doubted[source] > now_ns // SECOND_NS
            if source == failed or silent or doubted or np.isnan(steadiness.limit[source, 0]):
                continue
            self._memory.watch.source[0] = source
            other = replace(self._candidate, source=source, slope_sd=np.nan)
            self._candidate = other.knowing(steadiness)
            return True
        return False

    def _begin(self, candidate: OnsetCandidate, number: int) -> Onset:
        onset = Onset(candidate.start * SECOND_NS, (number + 1) * SECOND_NS)
        heading = mean_heading(self._memory.bins, candidate.start - 1, HEADING_BEFORE_S)
        self._running = RunningCoastdown(
            onset, heading, cut=self._cut, ship=self._ship, parameters=self._parameters
        )
        if self._estimator is not None:
            self._memory.watch.update_ns[0] = self._running.due_ns(onset.detected_ns)
        return onset

    def _update(self, next_stamp_ns: int) -> Event:
        assert self._running is not None
        assert self._estimator is not None
        watch = self._memory.watch
        stamp_ns = int(watch.update_ns[0])
        watch.update_ns[0] = self._running.due_ns(next_stamp_ns)
        gliding = self._regimes is None or self._regimes.gliding > 0.5
        return self._running.update(stamp_ns, self._estimator, gliding=gliding)

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
        return replace(window, notes=notes, log_doubt=self._vouching.log_doubt)

    # how a coastdown ends

    def _stop_at_last_sample(self, ended_by: EndedBy) -> list[Event]:
        """End what runs, if anything, at the last sample of its speed source."""
        events: list[Event] = []
        if self._candidate is None:
            self._stand_down()
            return events
        end_ns = int(self._memory.guard.last_ns[self._candidate.source])
        if self._regimes is not None:
            if self._running is not None:
                events += self._end_glide(self._regimes, ended_by)
            events += self._rest(self._regimes, end_ns // SECOND_NS)
        elif self._running is not None:
            events += self._end_at(End(ended_by, end_ns // SECOND_NS - 1), end_ns)
        elif self._candidate.noticed:
            age_s = end_ns // SECOND_NS - self._candidate.start
            events += self._dismiss(cut_short(ended_by, age_s), end_ns)
        self._stand_down()
        return self._vouching.explained(events)

    def _end_at(self, end: End, end_ns: int) -> list[Event]:
        assert self._candidate is not None
        assert self._running is not None
        doubt = None
        if end.ended_by is not EndedBy.RESET:
            bins, number = self._memory.bins, int(self._memory.bins.closed[self._candidate.source])
            doubt = withdrawn(
                self._candidate, end, bins, self._ship, self._tuning, self._parameters, number
            )
        events = self._running.end(end.ended_by, end_ns, doubt, self._final_estimator)
        self._stand_down()
        return events

    def _stand_down(self, *, driven: bool = False) -> None:
        """Watch for an onset again, once the ship has been steady."""
        watch = self._memory.watch
        watch.source[0] = NEVER
        watch.update_ns[0] = ALWAYS
        if self._candidate is not None:
            # what a shaft alone proposed and the speed did not bear out changes nothing for it
            if self._candidate.noticed or self._running is not None:
                watch.armed[0] = 0
                watch.held[:] = self._candidate.limits
            if not driven:
                watch.armed[1] = 0
        self._candidate = self._running = self._regimes = None


def _chosen(dated: Dated) -> Chosen:
    """Return where a glide begins, and the run-down before it if it was a long one."""
    start_ns = round(dated.begin_s * SECOND_NS)
    if not dated.slow_s:
        return Chosen(start_ns, ())
    text = (
        f'the thrust ran down for {dated.slow_s:.0f} s, and was gone at the end of that, '
        f'± {dated.begin_sd_s:.0f} s'
    )
    first_ns = start_ns - round(dated.slow_s * SECOND_NS)
    return Chosen(start_ns, (NotCoastdown(first_ns, start_ns, Dismissal.THRUST, text),))
