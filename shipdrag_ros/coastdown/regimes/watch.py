# SPDX-License-Identifier: Apache-2.0
"""The bank awake: fed from the bins of the monitor, asked what she does."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.bins import SOURCES, Bins, mean_place
from shipdrag_ros.coastdown.events import BY_SPEED, Dismissal, EndedBy, NotCoastdown, Regimes
from shipdrag_ros.coastdown.past import FIRST_TRACK
from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.bank import (
    FIT,
    OUT,
    P_EVEN,
    P_GLIDING,
    P_RUN_DOWN,
    SPEED,
    Bank,
    step,
)
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.observe import observe
from shipdrag_ros.coastdown.regimes.read_out import (
    SmoothedGlide,
    Spans,
    glides,
    slowed_by,
    smoothed,
    spans_of,
    unpowered,
)
from shipdrag_ros.coastdown.regimes.state import BankSetting
from shipdrag_ros.samples import KIND, SECOND_NS, SHAFTS, Float64
from shipdrag_ros.ship import Ship

LEAD_S = 900  # of record before what woke it
LATE_S = 2  # seconds that other inputs may be behind
_ASLEEP_S = 300.0  # of even power after which it sleeps again
_FULL_S = 6 * 3600.0  # of record that it remembers
_ASKED_EVERY = 60  # bins
_EVEN = 0.95
_DOUBTED = 0.5
_UNKNOWN = 12  # bins from which on it is known what drove her
_RAN_DOWN_S = 40.0  # a run-down that is worth a word
_ASTERN = -0.05  # of the steady revs times pitch
_ASTERN_S = 30.0  # about the end of a glide
_TRACKS = [track for track in SOURCES.tolist() if KIND[track] >= FIRST_TRACK]
_FIXES_S = 60  # over which fixes are counted
_FIXES = 2.0  # in a bin: a way is from one to the next

_ENDED = {
    s.LEVEL: EndedBy.ENGINE,
    s.AMID: EndedBy.ENGINE,
    s.BRAKE: EndedBy.BRAKE,
    s.TURN: EndedBy.TURN,
    s.GLIDE_TURN: EndedBy.TURN,
}
_WHY = {
    s.LEVEL: (Dismissal.SETTLED, 'power was reduced, not cut'),
    s.AMID: (Dismissal.THRUST, 'she was driven by a power that varied'),
    s.BRAKE: (Dismissal.BRAKE, 'something but the water slowed her'),
    s.TURN: (Dismissal.TURN, 'she turned under power'),
    s.GLIDE_TURN: (Dismissal.TURN, 'she turned'),
    s.GLIDE: (Dismissal.PLATEAU, 'she glided on, but slowed too little to show what slows her'),
}
_AGAIN = Dismissal.THRUST, 'she slowed less than water alone slows her, as if driven again'
_REVERSED = Dismissal.ASTERN, 'a propeller was reversed'
_UNSEEN = (
    Dismissal.LEAD_IN,
    'no steady sailing is seen before it, so nothing shows what slowed her',
)


class Dated(NamedTuple):
    """
    A glide in seconds since the epoch.

    Attributes
    ----------
    stop_s, start_s, begin_s, end_s
        When the thrust began to fall, the date, when it was gone, and the end. The date is where
        a shaft shows the thrust gone, or an abrupt stop would have cost as much speed.
    ended_by
        What followed; None where she glides on.
    cuts
        What just before it is no part of it: something but the water that slowed her, a long
        run-down, a gap. The record before these teaches nothing of her steady sailing.
    """

    stop_s: float
    start_s: float
    begin_s: float
    end_s: float
    ended_by: EndedBy | None
    cuts: tuple[NotCoastdown, ...] = ()

    def since(self, begin_s: float, unread_s: float = math.nan) -> Dated:
        """
        Return the part of it after its begin, or after a gap in which nothing was read.
        """
        text = 'nothing was read in it, so what she did is not known'
        gap = () if math.isnan(unread_s) else (_cut(unread_s, begin_s, Dismissal.GAP, text),)
        return self._replace(stop_s=begin_s, start_s=begin_s, begin_s=begin_s, cuts=gap)


def _of_fixes_s(bins: Bins, second: int) -> float:
    """Return the length of a bin in which fixes show a way; 0 where there are none [s]."""
    counts = [mean_place(bins, track, second, _FIXES_S)[3] for track in _TRACKS]
    least = min((count for count in counts if count > 0), default=np.inf)
    return float(min(_FIXES * _FIXES_S / least, n.BIN_S))


def _cut(first_s: float, last_s: float, reason: Dismissal, text: str) -> NotCoastdown:
    return NotCoastdown(round(first_s * SECOND_NS), round(last_s * SECOND_NS), reason, text)


class RegimeFilter:
    """
    A bank that follows the bins of the monitor.

    Parameters
    ----------
    ship
        Its length and volume.
    bins
        Of the monitor: which shafts are read.
    woken
        Second in which it is woken; the record before it is taken too.
    lead_s
        How much of it.
    """

    def __init__(self, ship: Ship, bins: Bins, woken: int, lead_s: int = LEAD_S) -> None:
        first = woken - lead_s
        shafts = sum(int(bins.filling[each]) > first for each in SHAFTS)
        hull = HullPrior.of(ship)
        self._width = max(1, round(max(hull.bin_s, _of_fixes_s(bins, woken))))
        self._setting = BankSetting.of(hull, float(self._width), shafts=shafts)
        self._bank = Bank.fresh()
        self._next = first // self._width + 1
        self._first = self._next
        self._woken = woken
        self._out: list[Float64] = []
        self._low: list[float] = []
        self._read: list[int] = []  # readings of motion in each bin
        self._even_s = 0.0

    def advance(self, bins: Bins, number: int) -> bool:
        """
        Take the next bin that is whole by second `number`; False where none is.
        """
        last = (self._next + 1) * self._width - 1
        if last > number - LATE_S:
            return False
        observe(bins, last, self._width, self._setting.step_s, self._bank.said)
        step(self._bank, self._setting)
        self._next += 1
        if not self._bank.histories.used[0]:  # nothing was said yet, or no history bears it
            told_s, self._first = self.told_s, self._next
            self.tell(told_s)
            if self._bank.histories.clock[0] > 0:
                self._bank, self._out, self._low, self._read = Bank.fresh(), [], [], []
            return True
        self._out.append(self._bank.out.copy())
        self._low.append(float(self._bank.said[s.LOW]))
        motion = self._bank.said[[s.LOG, s.GROUND, s.ADVANCE]]
        self._read.append(int(np.count_nonzero(~np.isnan(motion))))
        even = self._bank.out[P_EVEN] > _EVEN
        self._even_s = self._even_s + self._width if even else 0.0
        return True

    def tell(self, stop_s: float) -> None:
        """
        Take it from a person that the engine was stopped [s since the epoch].
        """
        self._setting = self._setting._replace(told_s=stop_s - self.begun_s)

    @property
    def told_s(self) -> float:
        """The stop that a person told [s since the epoch]; NaN where nobody did."""
        return self._setting.told_s + self.begun_s

    @property
    def told_ns(self) -> int | None:
        """The same [ns]; None where nobody did."""
        return None if math.isnan(self.told_s) else round(self.told_s * SECOND_NS)

    @property
    def taken_s(self) -> int:
        """Second since the epoch up to which the record has been taken."""
        return self._next * self._width

    @property
    def caught_up(self) -> bool:
        """Whether the record before it was woken has been taken."""
        return self.taken_s > self._woken

    @property
    def begun_s(self) -> int:
        """Second since the epoch from which on motion was read."""
        return self._first * self._width

    @property
    def probability(self) -> dict[str, float]:
        """The probability of each regime now."""
        return {name: float(self._bank.out[k]) for k, name in enumerate(OUT)}

    @property
    def gliding(self) -> float:
        """P(gliding) now, the run-down with it."""
        out = self._bank.out
        return float(out[P_RUN_DOWN] + out[P_GLIDING])

    @property
    def hears_shafts(self) -> bool:
        """Whether any shaft was read when it was woken."""
        return self._setting.shafts > 0

    @property
    def shafts_lie(self) -> float:
        """Probability that the shafts say nothing true; NaN where none is heard."""
        if not self.hears_shafts:
            return math.nan
        all_ = self._bank.histories
        row = all_.row[: int(all_.used[0])]
        return float(np.exp(row['weight'][row['liar'] == s.THE_SHAFTS]).sum())

    def gliding_since(self, second: float) -> float:
        """
        Return the probability of a glide that began before a second [s since the epoch].
        """
        all_ = self._bank.histories
        used = int(all_.used[0])
        each, last = np.arange(used), all_.row['count'][:used] - 1
        switched = all_.switched[each, last]
        glides = (last >= 0) & (switched['what'] == s.GLIDE)
        before = self.begun_s + switched['at'] <= second
        return float(np.exp(all_.row['weight'][:used])[glides & before].sum())

    def slow_since(self, speed_m_s: float) -> float | None:
        """
        Return since when she is below a speed [s since the epoch]; None where she may not be.

        It has to be as sure as the end of a glide, of which nothing is taken back either.
        """
        if not self._out or float(self._bank.out[SPEED]) >= speed_m_s:
            return None
        from scipy.special import ndtr  # slow to import

        all_ = self._bank.histories
        used = int(all_.used[0])
        over = all_.mean[:used, s.LN_U] - math.log(speed_m_s)
        over /= np.sqrt(all_.spread[:used, s.LN_U, s.LN_U])
        faster = float(np.exp(all_.row['weight'][:used]) @ ndtr(over))
        if faster > n.ANNOUNCE[1]:
            return None
        slow = np.cumsum(self._speed[::-1] >= speed_m_s) == 0
        return float(self.begun_s + (len(slow) - int(slow.sum()) + 1) * self._width)

    def read_after(self, second: float) -> float:
        """
        Return the begin of the first bin after a second in which motion was read [s].
        """
        since = max(math.ceil((second - self.begun_s) / self._width), 0)
        gap = np.cumsum(self._read[since:]) == 0
        return float(self.begun_s + (since + int(gap.sum())) * self._width)

    def unread_about(self, second: float) -> tuple[float, float]:
        """
        Return begin and end of the time about a second in which no motion was read [s].
        """
        at = min(max(int((second - self.begun_s) // self._width), 0), len(self._read) - 1)
        read = np.flatnonzero(self._read)
        before, after = np.split(read, [int(np.searchsorted(read, at))])
        first = int(before[-1]) + 1 if len(before) else 0
        last = int(after[0]) if len(after) else len(self._read)
        return self.begun_s + first * self._width, self.begun_s + last * self._width

    @property
    def even(self) -> bool:
        """Whether she is likelier under even power than not."""
        return not self._out or float(self._bank.out[P_EVEN]) >= _DOUBTED

    @property
    def asleep(self) -> bool:
        """Whether she has been under even power for long."""
        awake_s = self.taken_s - self._woken
        return min(self._even_s, awake_s) > _ASLEEP_S

    @property
    def full(self) -> bool:
        """Whether it remembers so much that it should begin anew."""
        return len(self._out) * self._width > _FULL_S

    @property
    def due(self) -> bool:
        """Whether it should be asked for glides that were over before anybody noticed."""
        return len(self._out) % _ASKED_EVERY == 0

    def glides(self, since_s: float) -> list[Dated]:
        """
        Return the coastdowns so far, in order.

        None claims anything of the time before the end of the last, or before what was told.
        """
        found = list[Dated]()
        for each in glides(self._spans, self._setting, len(self._out)):
            found.append(self._dated(each, since_s))
            since_s = max(since_s, found[-1].end_s)
        return found

    @property
    def _spans(self) -> Spans:
        return spans_of(self._bank, self._setting)

    @property
    def _speed(self) -> Float64:
        return np.array([out[SPEED] for out in self._out])

    def _dated(self, glide: SmoothedGlide, since_s: float) -> Dated:
        *past, begin, end = (self.begun_s + each for each in glide[:5])
        ran_down = not self._setting.shafts and begin - past[1] > _RAN_DOWN_S
        before, stop, start = (min(max(each, since_s), begin) for each in past)
        cuts: list[NotCoastdown] = []
        if glide.before in (s.BRAKE, s.GLIDE_TURN):  # nothing drove her before it
            cuts.append(_cut(before, stop, *_WHY[glide.before]))
        if ran_down:
            how = 'ran down' if stop == past[1] else 'may have been left'
            text = (
                f'the thrust {how} for {begin - stop:.0f} s, and was gone at the end of that, '
                f'± {glide.begin_sd_s:.0f} s'
            )
            cuts.append(_cut(stop, begin, Dismissal.THRUST, text))
        date = begin if cuts else start
        said = tuple(cut for cut in cuts if cut.end_ns > cut.start_ns)
        return Dated(stop, date, begin, end, self._ended_by(glide), said)

    def _ended_by(self, glide: SmoothedGlide) -> EndedBy | None:
        if glide.after < 0:
            return None
        first, last = (
            max(round((glide.end_s + off) / self._width), 0) for off in (-_ASTERN_S, _ASTERN_S)
        )
        if any(low < _ASTERN for low in self._low[first : last + 1]):
            return EndedBy.ASTERN
        return _ENDED.get(glide.after)

    def dismissal(self, since_s: float) -> NotCoastdown | None:
        """
        Say what it was that was no coastdown.

        None where even power was never unlikely, or nothing slowed her.

        Parameters
        ----------
        since_s
            From when on it was not said yet [s since the epoch].
        """
        if not self._out:
            return None
        since = math.ceil(max((since_s - self.begun_s) / self._width, 0.0))
        table = np.array(self._out)
        doubted = since + np.flatnonzero(table[since:, P_EVEN] < _DOUBTED)
        if not len(doubted) or table[doubted, SPEED].argmin() == 0:
            return None
        first, last = int(doubted[0]), int(doubted[-1]) + 1
        by = slowed_by(self._spans, table[:, SPEED], first, self._width)
        if by is None:
            return None
        reason, text = _AGAIN if by.what == s.LEVEL and by.again else _WHY[by.what]
        astern = np.array(self._low[first : first + len(by.lost_m_s)]) < _ASTERN
        if by.lost_m_s[astern].sum() > 0.5 * by.lost_m_s.sum():
            reason, text = _REVERSED
        elif reason in BY_SPEED and by.begin_s < _UNKNOWN * self._width:
            reason, text = _UNSEEN
        most = float((table[first:last, P_RUN_DOWN] + table[first:last, P_GLIDING]).max())
        start_ns, end_ns = (
            round((self.begun_s + k * self._width) * SECOND_NS) for k in (first, last)
        )
        said = f'{text}: P(gliding) was {most:.2f} at most'
        return NotCoastdown(start_ns, end_ns, reason, said)

    def whole_glides(self) -> list[tuple[float, float]]:
        """
        Return the stretches without thrust in which more than one glide is likely [s].
        """
        zero = self.begun_s
        found = unpowered(self._spans, len(self._out), self._setting)
        return [(zero + first_s, zero + last_s) for first_s, last_s in found]

    def regimes(self) -> Regimes | None:
        """
        Return the probability of each regime over time, given all that came.
        """
        if not self._out:
            return None
        middle_s = self.begun_s + (np.arange(len(self._out)) + 0.5) * self._width
        probability = smoothed(self._spans, len(self._out), self._setting.step_s)
        time_ns = np.round(middle_s * SECOND_NS).astype(np.int64)
        excess = sum(float(out[FIT]) for out in self._out) / max(sum(self._read), 1)
        explained = float(np.interp(excess, n.EXPLAINED, n.EXPLAINED_SHARE))
        return Regimes(time_ns, self._speed, probability, excess, explained)
