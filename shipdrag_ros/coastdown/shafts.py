# SPDX-License-Identifier: Apache-2.0
"""
Whether the shafts still say something: in steady sailing too, in which no regimes follow them.

A shaft contradicts the motion, as the regimes find; its sensor sticks at a value; or it ceases
to send.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.coastdown.bins import COUNT, A, Bins, mean_turning, unread
from shipdrag_ros.coastdown.past import NEVER
from shipdrag_ros.coastdown.vouching import LOOK_S
from shipdrag_ros.display import utc
from shipdrag_ros.estimation.run_down import STANDS_RAD_S
from shipdrag_ros.samples import PITCHES, SECOND_NS, SHAFTS, Int64

_LOOK_S = 60
_BEFORE_S = 600  # of readings that say whether a sensor repeats by its nature
_WITNESSES = 60
_DISTINCT = 0.9  # of the readings of one that does not: it has no coarse levels
_SAME = 0.02  # of its revs
_REMEDY = 'not used; check the sensor'


class ShaftWatch:
    """
    What is said of the shafts of one monitor.

    Parameters
    ----------
    still_s
        A reading that repeats, or is missing, for longer is no reading.

    Attributes
    ----------
    ever
        The last that was said.
    """

    def __init__(self, still_s: float) -> None:
        self.ever = ''
        self._still_s = round(still_s)
        self._stuck: dict[int, str] = {}
        self._silent: dict[int, str] = {}
        self._lies = ''
        self._level: dict[int, float] = {}  # of those that lie, when that was found
        self._next = NEVER

    @property
    def text(self) -> str:
        """What to say of the shafts; '' where nothing is wrong."""
        return self.doubt or '; '.join(self._silent.values())

    @property
    def doubt(self) -> str:
        """What to say of shafts that are not used."""
        return self._lies or '; '.join(self._stuck.values())

    @property
    def unused(self) -> tuple[int, ...]:
        """Channels that are not used, with their pitch."""
        lie = SHAFTS if self._lies else self._stuck
        return tuple(
            int(each)
            for shaft, pitch in zip(SHAFTS, PITCHES, strict=True)
            if shaft in lie
            for each in (shaft, pitch)
        )

    def sound(self, bins: Bins) -> Bins:
        """Return bins in which the shafts that are not used were never read."""
        unused = list(self.unused)
        return unread(bins, unused) if unused else bins

    def look(self, bins: Bins, last: int, probability: float) -> None:
        """
        Look at the last seconds.

        Parameters
        ----------
        bins
            What the monitor keeps.
        last
            The last of them that all are read in.
        probability
            That the shafts say nothing true, by the regimes; NaN where they do not follow them.
        """
        heard = [int(each) for each in SHAFTS if bins.closed[each] != NEVER]
        if not heard:
            return
        if probability > 0.5:
            self._level = {each: mean_turning(bins, each, last, LOOK_S)[0] for each in heard}
            self._lies = (
                'the motion is not that of a ship whose shafts turn as they say (probability '
                f'{probability:.2f}): they are {_REMEDY}'
            )
        elif self._lies and (
            not np.isnan(probability) or any(self._moved(bins, each, last) for each in heard)
        ):
            self._lies = ''
        if last >= self._next or self._stuck:
            self._next = (last // _LOOK_S + 1) * _LOOK_S
            self._stuck = {
                each: text for each in heard if (text := self._sticks(bins, each, last))
            }
            self._silent = {
                each: f'{_name(each)} ceased at {utc(int(bins.filling[each]) * SECOND_NS)}: '
                'check the sensor'
                for each in heard
                if bins.filling[each] < last - self._still_s
            }
        self.ever = self.text or self.ever

    def _moved(self, bins: Bins, shaft: int, last: int) -> bool:
        """Say whether a shaft that lied turns otherwise now."""
        level = self._level.get(shaft, np.nan)
        now = mean_turning(bins, shaft, last, LOOK_S)[0]
        return abs(now - level) > max(STANDS_RAD_S, _SAME * abs(level))

    def _sticks(self, bins: Bins, shaft: int, last: int) -> str:
        """Say that a sensor repeats itself which does not by its nature; '' where it does not."""
        totals = bins.places[shaft]
        newest, mask = int(bins.closed[shaft]), len(totals) - 1
        until = min(last, newest)

        def read(seconds: int) -> Int64:
            before = max(until - seconds, newest - mask)
            each = np.diff(totals[np.arange(before, until + 1) & mask], axis=0)
            return np.asarray(each[each[:, COUNT] == 1, A])

        still = read(self._still_s)
        if len(still) < 2 or (still != still[-1]).any():
            return ''
        if shaft in self._stuck:
            return self._stuck[shaft]
        turning = mean_turning(bins, shaft, until, self._still_s)[0]
        every = read(mask)
        differs = np.flatnonzero(every != still[-1])
        if abs(turning) < STANDS_RAD_S or not len(differs):
            return ''
        before = every[: differs[-1] + 1][-_BEFORE_S:]
        if len(before) < _WITNESSES or len(np.unique(before)) < _DISTINCT * len(before):
            return ''
        return (
            f'{_name(shaft)} has read {turning:.4g} rad/s to the last digit for '
            f'{self._still_s} s and more, as it never did before: it is {_REMEDY}'
        )


def _name(shaft: int) -> str:
    return f'shaft {[int(each) for each in SHAFTS].index(shaft) + 1}'
