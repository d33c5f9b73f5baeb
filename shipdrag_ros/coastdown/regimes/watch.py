# SPDX-License-Identifier: Apache-2.0
"""The bank awake: fed from the bins of the monitor, asked what she does."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.bins import Bins, newest_bin
from shipdrag_ros.coastdown.events import Dismissal, EndedBy
from shipdrag_ros.coastdown.regimes.bank import (
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
from shipdrag_ros.coastdown.regimes.read_out import SmoothedGlide, glides, other_regime
from shipdrag_ros.coastdown.regimes.state import BRAKE, GLIDE_TURN, LEVEL, LOW, TURN, BankSetting
from shipdrag_ros.samples import SHAFTS, Float64
from shipdrag_ros.ship import Ship

_LEAD_S = 900  # of record before what woke it
_LATE = 2  # seconds that other inputs may be behind
_ASLEEP_S = 300.0  # of even power after which it sleeps again
_EVEN = 0.95
_BINS_OF_WINDOW = 12  # bins in a slope window: smaller craft have shorter ones
_RAN_DOWN_S = 40.0  # a run-down that no shaft shows and that is no part of the glide

_ENDED = {
    LEVEL: EndedBy.ENGINE,
    BRAKE: EndedBy.BRAKE,
    TURN: EndedBy.TURN,
    GLIDE_TURN: EndedBy.TURN,
}
_WHY = {
    LEVEL: (Dismissal.SETTLED, 'power was reduced, not cut'),
    BRAKE: (Dismissal.BRAKE, 'something but the water slowed her'),
    TURN: (Dismissal.TURN, 'she turned under power'),
    GLIDE_TURN: (Dismissal.TURN, 'she turned'),
}


class Dated(NamedTuple):
    """
    A glide in seconds since the epoch; `slow_s` is how long its thrust ran down before it.
    """

    begin_s: float
    end_s: float
    begin_sd_s: float
    slow_s: float
    probability: float
    after: int


class RegimeFilter:
    """
    A bank that follows the bins of the monitor.

    Parameters
    ----------
    bins
        Of the monitor.
    ship, width
        Its length and volume; seconds in a bin of the bank.
    number
        The second that woke it; the record before it is taken too.
    """

    def __init__(self, bins: Bins, ship: Ship, width: int, number: int) -> None:
        shafts = sum(newest_bin(bins, int(each)) > number - _LEAD_S for each in SHAFTS)
        self._setting = BankSetting.of(HullPrior.of(ship), float(width), shafts=shafts)
        self._bank = Bank.fresh()
        self._width = width
        self._next = (number - _LEAD_S) // width + 1
        self._first = self._next
        self._woken = number
        self._out: list[Float64] = []
        self._even_s = 0.0
        self._astern = False

    @staticmethod
    def width(slope_window_s: float) -> int:
        """
        Return the seconds in a bin: fewer for smaller craft, whose slope window is shorter.
        """
        return max(1, round(slope_window_s / _BINS_OF_WINDOW))

    def advance(self, bins: Bins, number: int) -> bool:
        """
        Take the next bin that is whole by second `number`; False where none is.
        """
        last = (self._next + 1) * self._width - 1
        if last > number - _LATE:
            return False
        observe(bins, last, self._width, self._setting.step_s, self._bank.said)
        step(self._bank, self._setting)
        self._next += 1
        if self._bank.histories.clock[0] == 0:
            self._first = self._next
            return True
        self._out.append(self._bank.out.copy())
        even = self._bank.out[P_EVEN] > _EVEN
        self._even_s = self._even_s + self._width if even else 0.0
        low = self._bank.said[LOW]
        self._astern = not math.isnan(low) and low < -0.05
        return True

    def tell(self, stop_s: float) -> None:
        """
        Take it from a person that the engine was stopped [s since the epoch].
        """
        self._setting = self._setting._replace(told_s=stop_s - self._first * self._width)

    @property
    def gliding(self) -> float:
        """P(gliding) now, the run-down with it."""
        out = self._bank.out
        return float(out[P_RUN_DOWN] + out[P_GLIDING])

    @property
    def slow(self) -> float:
        """Mean speed now [m/s]; infinite before the first."""
        return float(self._bank.out[SPEED]) if self._out else math.inf

    @property
    def asleep(self) -> bool:
        """Whether she has been under even power for long."""
        awake_s = self._next * self._width - self._woken
        return min(self._even_s, awake_s) > _ASLEEP_S * self._setting.pace

    @property
    def doubted(self) -> bool:
        """Whether even power was ever unlikely since it woke."""
        return any(float(out[P_EVEN]) < 0.5 for out in self._out)

    def glides(self) -> list[Dated]:
        """
        Return the coastdowns so far, in order.
        """
        if not self._out:
            return []
        speed = np.array([out[SPEED] for out in self._out])
        return [self._dated(each) for each in glides(self._bank, self._setting, speed)]

    def _dated(self, glide: SmoothedGlide) -> Dated:
        zero = self._first * self._width
        slow_s = glide.begin_s - glide.stop_s
        slow = not self._setting.shafts and slow_s > _RAN_DOWN_S * self._setting.pace
        return Dated(
            zero + (glide.begin_s if slow else glide.date_s),
            zero + glide.end_s,
            glide.begin_sd_s,
            slow_s if slow else 0.0,
            glide.probability,
            glide.after,
        )

    def ended_by(self, after: int) -> EndedBy:
        """
        Return why a glide ended, by the regime after it, or else by that of now.
        """
        if self._astern:
            return EndedBy.ASTERN
        return _ENDED[after if after in _ENDED else other_regime(self._bank)]

    def dismissal(self) -> tuple[Dismissal, str]:
        """
        Return why what is going on is no coastdown, with a text.
        """
        if self._astern:
            return Dismissal.ASTERN, 'a propeller was reversed'
        reason, text = _WHY[other_regime(self._bank)]
        most = max(float(out[P_RUN_DOWN] + out[P_GLIDING]) for out in self._out)
        return reason, f'{text}: P(gliding) was never above {most:.2f}'

    def probabilities(self) -> tuple[Float64, dict[str, Float64]]:
        """
        Return times since the epoch [s] and the probability of each regime at each.
        """
        table = np.array(self._out).reshape(len(self._out), -1)
        time_s = np.asarray((self._first + 1.0 + np.arange(len(table))) * self._width, np.float64)
        return time_s, {name: table[:, k] for k, name in enumerate(OUT)} if len(table) else {}
