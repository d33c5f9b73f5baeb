# SPDX-License-Identifier: Apache-2.0
"""What the monitor reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from shipdrag_ros.display import short_repr
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.result import Forecast, PathAhead
from shipdrag_ros.samples import Float64, Int64

BRAKED = (
    'something but the water slows her in a part of it, and no instrument shows what; r(v) is '
    'from the rest alone'
)
"""What is said of a coastdown that is `braked`."""
TURNED = 'the ship turned in a part of it; r(v) is from the rest alone'
"""What is said of a coastdown that is `turned`."""
NOT_ALL = (
    'she was without thrust for longer, and probably not in one glide: something but the water '
    'may have slowed her there; r(v) is from the coastdown alone'
)
"""What is said of a coastdown that is part of a `WholeGlide`, and in which nothing acted."""


@dataclass(frozen=True)
class InputCounts:
    """
    What became of the messages of an input, up to a moment or over some time.

    Attributes
    ----------
    messages
        Heard.
    used, rejected
        Readings that were used, and those that were not by reason. A message holds one
        reading, but of shafts and pitches one a joint; one that cannot be read counts
        as a reading rejected.
    lost
        Messages sent and not heard.
    unstamped
        Readings whose header holds no time.
    """

    messages: int = 0
    used: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)
    lost: int = 0
    unstamped: int = 0

    @property
    def readings(self) -> int:
        """Used and rejected."""
        return self.used + sum(self.rejected.values())

    def since(self, before: InputCounts) -> InputCounts:
        """
        Return what was added since an earlier moment.
        """
        return InputCounts(
            self.messages - before.messages,
            self.used - before.used,
            Counter(self.rejected) - Counter(before.rejected),  # without what is not above 0
            self.lost - before.lost,
            self.unstamped - before.unstamped,
        )


@dataclass(frozen=True)
class MonitorProgress:
    """
    How far the monitor is.

    Attributes
    ----------
    steady_s
        Since when the ship is steady; 0 where she is not.
    used_s
        The longest steady record that is of use.
    coastdown_since_ns
        Stamp of the stop; None where no coastdown runs.
    probability
        Of each regime now, by its name; empty while they sleep, in steady sailing.
    """

    steady_s: float
    used_s: float
    coastdown_since_ns: int | None
    probability: Mapping[str, float] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, str]:
        """The same as texts by key, the unit in the key."""
        figures = {
            'steady lead [s]': f'{self.steady_s:.0f}',
            'steady lead used at most [s]': f'{self.used_s:.0f}',
        }
        if self.coastdown_since_ns is not None:
            figures['coastdown since [ns]'] = str(self.coastdown_since_ns)
        for name, share in self.probability.items():
            figures[f'probability of {name.replace("_", " ")} [1]'] = f'{share:.2f}'
        return figures


class State(Enum):
    """Where the monitor stands."""

    WAITING = 'waiting'  # not enough record to know what steady is
    STEADY = 'steady'  # watching for an onset
    CANDIDATE = 'candidate'  # probably not under even power
    COASTDOWN = 'coastdown'  # confirmed, estimating


class EndedBy(Enum):
    """Why a coastdown ended."""

    SPEED = 'speed'
    TURN = 'turn'
    ENGINE = 'engine'  # re-engaged, or the speed settled or rose
    BRAKE = 'brake'
    ASTERN = 'astern'
    DATA_STOP = 'data_stop'
    SILENCE = 'silence'  # all sources were silent by wall time
    RESET = 'reset'
    RECORD_END = 'record_end'
    GIVEN = 'given'


ENDED_BY = {
    EndedBy.SPEED: 'the minimum speed was reached',
    EndedBy.TURN: 'the ship turned',
    EndedBy.ENGINE: 'the engine drove the ship again',
    EndedBy.BRAKE: 'something but the water stopped the ship',
    EndedBy.ASTERN: 'the propeller was reversed',
    EndedBy.DATA_STOP: 'the data stopped',
    EndedBy.SILENCE: 'all sources of speed fell silent',
    EndedBy.RESET: 'the memory was reset',
    EndedBy.RECORD_END: 'the record ended',
    EndedBy.GIVEN: 'the window was given by hand',
}

_BY_REGIME = {
    EndedBy.ENGINE: ('driven', 're_engaged'),
    EndedBy.BRAKE: ('braked',),
    EndedBy.TURN: ('turning',),
}
_SOON = 12  # bins after an end, which is dated to some of them


class Dismissal(Enum):
    """Why a stretch of record is not, or no longer, taken for a coastdown."""

    LEAD_IN = 'lead_in'  # too little steady sailing before it
    THRUST = 'thrust'  # the propeller drives, or the speed settles as if it did
    BRAKE = 'brake'  # slowed by something but the water
    ASTERN = 'astern'  # the propeller is reversed, or the ship goes astern
    TURN = 'turn'
    RUDDER = 'rudder'
    PLATEAU = 'plateau'  # the ship no longer slows
    SETTLED = 'settled'  # a new steady speed after a small loss: power reduced
    SLOW = 'slow'  # below the minimum speed
    GAP = 'gap'  # the data stopped before it could be confirmed
    OTHER = 'other'


BY_SPEED = frozenset({Dismissal.BRAKE, Dismissal.SETTLED, Dismissal.THRUST})
"""For these a stretch is dismissed by its speed; a turn and a gap are causes."""


@dataclass(frozen=True)
class Regimes:
    """
    What she did, as far as the record up to its end shows it.

    Attributes
    ----------
    time_ns : (n,)
        Middle of each bin [ns].
    speed_m_s : (n,)
        Mean speed in it.
    probability
        Of each regime, by its name, (n,) each.
    excess
        Mean log density of a reading, over what the model expects of it [nats].
    explained
        Share of the records that the model was learnt on which it explains less well.
    """

    __repr__ = short_repr

    time_ns: Int64
    speed_m_s: Float64
    probability: Mapping[str, Float64]
    excess: float
    explained: float

    def ends(self, end_ns: int) -> dict[EndedBy, float]:
        """
        Return the probability, soon after a glide, of each regime that may have ended it.
        """
        soon = np.flatnonzero(self.time_ns > end_ns)[:_SOON]
        found = {}
        for ended_by, names in _BY_REGIME.items():
            chance = np.sum([self.probability[name] for name in names], axis=0)
            found[ended_by] = float(np.max(chance[soon], initial=0.0))
        return found

    def ended_by(self, said: EndedBy, end_ns: int) -> EndedBy:
        """
        Return what is said to have ended a glide, or the regime that did so more probably.
        """
        chances = self.ends(end_ns)
        if said not in chances:
            return said
        return max(chances, key=lambda each: (chances[each], each is said))


@dataclass(frozen=True)
class NotCoastdown:
    """
    A slowing down that was none, or a part of a window that was cut.

    `text` says in one sentence, with figures, what spoke against it.
    """

    start_ns: int
    end_ns: int
    reason: Dismissal
    text: str


@dataclass(frozen=True)
class Onset:
    """A coastdown was confirmed; it began at `start_ns`."""

    start_ns: int
    detected_ns: int


@dataclass(frozen=True)
class Update:
    """
    An estimate during a coastdown, of all samples from its start to `stamp_ns`.

    `forecast` is the rest of the glide, None where nothing is left to foretell; `path` the
    positions to come, None without positions.
    """

    stamp_ns: int
    estimate: Estimate
    forecast: Forecast | None = None
    path: PathAhead | None = None


@dataclass(frozen=True)
class NoEstimate:
    """No estimate was possible at `stamp_ns`."""

    stamp_ns: int
    reason: str


@dataclass(frozen=True)
class EndedCoastdown:
    """
    A coastdown that has ended.

    `estimate` is None where none was possible; `failure` then says why.
    `onset_detected_ns` is None where the window was given; `heading_rad` (yaw, REP-103, at the
    start) where there is no heading. One that was `withdrawn` turned out to be none: a
    `NotCoastdown` says why. `cuts` are parts of the stretch as it was found or given that are no
    coastdown, before `start_ns` and after `end_ns`; or all of what speaks against one that was
    withdrawn. The thrust began to fall at `stop_ns`, not after `start_ns`; None where the window
    was given, and what comes before it is not known to be steady sailing: `regimes` is None then,
    and where there are cuts, `stretch` shows the whole of it: times [ns] and mean speeds [m/s].
    A person told a stop at `told_ns`.
    """

    __repr__ = short_repr

    start_ns: int
    end_ns: int
    onset_detected_ns: int | None
    ended_by: EndedBy
    estimate: Estimate | None
    failure: str | None = None
    heading_rad: float | None = None
    withdrawn: bool = False
    cuts: tuple[NotCoastdown, ...] = ()
    stretch: tuple[tuple[int, float], ...] = ()
    stop_ns: int | None = None
    told_ns: int | None = None
    regimes: Regimes | None = field(default=None, repr=False)

    @property
    def stands(self) -> bool:
        """Whether it ended as a coastdown: neither withdrawn nor cut short by a reset."""
        return not self.withdrawn and self.ended_by is not EndedBy.RESET

    @property
    def why(self) -> str:
        """What ended it, a clause."""
        return ENDED_BY[self.ended_by]

    @property
    def braked(self) -> bool:
        """Whether something but the water slowed her in a part of it, as `BRAKED` says."""
        return self.ended_by is EndedBy.BRAKE or any(
            cut.reason is Dismissal.BRAKE for cut in self.cuts
        )

    @property
    def turned(self) -> bool:
        """Whether a turn ended it, or was cut from it."""
        turns = (Dismissal.TURN, Dismissal.RUDDER)
        return self.ended_by is EndedBy.TURN or any(cut.reason in turns for cut in self.cuts)

    @property
    def disturbed(self) -> str:
        """What but the water acted in a part of it, a clause; '' where nothing did."""
        return BRAKED if self.braked else TURNED if self.turned else ''


@dataclass(frozen=True)
class WholeGlide:
    """
    A stretch without thrust that is probably not one glide.

    Something but the water may have acted. It is more than the coastdown in it, or holds none.
    """

    start_ns: int
    end_ns: int


@dataclass(frozen=True)
class Reset:
    """All memory was dropped, at arrival time `receive_ns`."""

    receive_ns: int
    reason: str


Event = Onset | Update | NoEstimate | NotCoastdown | EndedCoastdown | WholeGlide | Reset
OnCoastdown = Callable[[EndedCoastdown, Window], None]
"""Called with a coastdown that has ended and its window."""


class Dismissals:
    """
    What was nearly a coastdown, said without flooding the log.

    A rough sea, or a ship that manoeuvres, may give many dismissals. Of each reason one is
    said in each span of absolute time; the rest of the span is counted and stated as one.

    Parameters
    ----------
    span_ns
        Length of a span [ns].
    """

    def __init__(self, span_ns: int) -> None:
        self._span_ns = span_ns
        self._said: dict[Dismissal, int] = {}
        self._more: dict[Dismissal, tuple[int, NotCoastdown]] = {}  # not said: count, all as one

    def take(self, dismissed: NotCoastdown) -> list[Event]:
        """
        Take a dismissal and return what is to be said now.
        """
        span = dismissed.end_ns // self._span_ns
        if self._said.get(dismissed.reason) != span:
            self._said[dismissed.reason] = span
            return [*self._flush(dismissed.reason), dismissed]
        count, as_one = self._more.get(dismissed.reason, (0, dismissed))
        self._more[dismissed.reason] = count + 1, replace(dismissed, start_ns=as_one.start_ns)
        return []

    def flush(self) -> list[Event]:
        """
        Return what was counted and not said, and forget everything.
        """
        events = [event for reason in list(self._more) for event in self._flush(reason)]
        self._said.clear()
        return events

    def _flush(self, reason: Dismissal) -> list[Event]:
        if reason not in self._more:
            return []
        count, one = self._more.pop(reason)
        text = one.text if count == 1 else f'{count} times, the last: {one.text}'
        return [replace(one, text=text)]
