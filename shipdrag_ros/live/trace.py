# SPDX-License-Identifier: Apache-2.0
"""
Traces of the last two days: means over 1 s of late, over 10 s before.

Memory is bounded, whatever the rates of the sensors.
"""

from __future__ import annotations

from collections import deque
from itertools import islice

import numpy as np

from shipdrag_ros.samples import KIND, Block, Channel

FINE_S = 1800  # of 1 s each
COARSE_S = 10
LONGEST_S = 2 * 86400
LATE_S, JUMP_S = 60, 3600  # a stamp further off than these is strange
_STRANGE = 20  # readings in a row after which the time of all is another
COLUMNS = ('log', 'ground', 'estimate', 'shaft')
"""Speed through water, over ground, as estimated [m/s]; the fastest shaft [rad/s]."""
_ESTIMATE, _SHAFT = 2, 3
_COLUMN_OF = {  # of a kind
    int(Channel.SPEED_THROUGH_WATER): 0,
    int(Channel.SPEED_OVER_GROUND): 1,
    int(Channel.SHAFT): _SHAFT,
}

TraceRow = tuple[int, float | None, float | None, float | None, float | None]


class _Bin(dict[int, tuple[int, float, int]]):
    """Instrument, sum and count of each column over a second, of the first that spoke in it."""

    def add(self, column: int, total: float, count: int, instrument: int = 0) -> None:
        first, before, times = self.get(column, (instrument, 0.0, 0))
        if instrument < first:
            before, times = 0.0, 0
        if instrument <= first:
            self[column] = instrument, before + total, times + count

    def row(self, second: int) -> TraceRow:
        log, ground, estimate, shaft = (
            float(f'{self[column][1] / self[column][2]:.5g}') if column in self else None
            for column in range(len(COLUMNS))
        )
        return second, log, ground, estimate, shaft


class Trace:
    """
    What speeds and shafts did, by second of stamp.

    Attributes
    ----------
    newest_s
        Last second with a reading, 0 before the first.
    restarted
        Whether all was dropped because time went back; for the reader to clear.
    """

    def __init__(self) -> None:
        self.newest_s = 0
        self.restarted = False
        self._strange = 0
        self._open: dict[int, _Bin] = {}
        self._fine: deque[TraceRow] = deque()
        self._coarse: deque[TraceRow] = deque()
        self._thinning: list[TraceRow] = []

    def add(self, block: Block) -> None:
        """
        Take readings; what comes for a second that is closed already is left out.
        """
        sums: list[tuple[int, int, float, int, int]] = []
        for code in np.unique(block.channel).tolist():
            column = _COLUMN_OF.get(int(KIND[code]))
            if column is None:
                continue
            rows = np.flatnonzero(block.channel == code)
            value = block.value[rows, 0]
            if KIND[code] == Channel.SPEED_OVER_GROUND:
                value = np.hypot(value, block.value[rows, 1])
            known = np.isfinite(value) & (np.abs(value) < 1e4)
            second = block.stamp_ns[rows[known]] // 1_000_000_000
            seconds, place, counts = np.unique(second, return_inverse=True, return_counts=True)
            totals = np.bincount(place, weights=value[known], minlength=len(seconds))
            instrument = 0 if column == _SHAFT else code
            sums += [
                (second, column, total, count, instrument)
                for second, total, count in zip(
                    seconds.tolist(), totals.tolist(), counts.tolist(), strict=True
                )
            ]
        for each in sorted(sums):  # by time, all inputs abreast
            self._bin(*each)

    def add_estimate(self, stamp_ns: int, speed_m_s: float) -> None:
        """
        Take an estimated speed.
        """
        self._bin(stamp_ns // 1_000_000_000, _ESTIMATE, speed_m_s, 1)

    def closed(self) -> list[TraceRow]:
        """
        Return the rows that no more reading is waited for, each once.
        """
        ready = sorted(second for second in self._open if second < self.newest_s)
        rows = [self._open.pop(second).row(second) for second in ready]
        for row in rows:
            self._keep(row)
        return rows

    @property
    def current(self) -> TraceRow | None:
        """The newest second as far as it has been read, None before the first reading."""
        found = self._open.get(self.newest_s)
        if found is not None:
            return found.row(self.newest_s)
        return self._fine[-1] if self._fine else None

    def newest(self, column: int) -> float | None:
        """
        Return the last that was read of a column of `COLUMNS`; None where that is long ago.
        """
        rows = [self.current, *islice(reversed(self._fine), LATE_S)]
        return next((row[1 + column] for row in rows if row and row[1 + column] is not None), None)

    def rows(self) -> list[TraceRow]:
        """
        Return all that is kept, oldest first.
        """
        return [*self._coarse, *self._thinning, *self._fine]

    def _bin(
        self, second: int, column: int, total: float, count: int, instrument: int = 0
    ) -> None:
        off_s = second - self.newest_s
        if self.newest_s and not -LATE_S < off_s < JUMP_S:
            self._strange += 1
            if self._strange < _STRANGE:
                return  # one clock that is off is not drawn; the health of its input says so
            if off_s < 0:
                self._start_over()
            self.newest_s = second
        self._strange = 0
        self.newest_s = max(self.newest_s, second)
        if not self._fine or second > self._fine[-1][0]:
            self._open.setdefault(second, _Bin()).add(column, total, count, instrument)

    def _start_over(self) -> None:
        """The time of all went back: a clock was set, or a record is played again."""
        self._open.clear()
        self._fine.clear()
        self._coarse.clear()
        self._thinning.clear()
        self.restarted = True

    def _keep(self, row: TraceRow) -> None:
        self._fine.append(row)
        while self._fine and self._fine[0][0] < row[0] - FINE_S:
            self._thin(self._fine.popleft())
        while self._coarse and self._coarse[0][0] < row[0] - LONGEST_S:
            self._coarse.popleft()

    def _thin(self, row: TraceRow) -> None:
        if self._thinning and self._thinning[0][0] // COARSE_S != row[0] // COARSE_S:
            merged = _Bin()
            for each in self._thinning:
                for column, value in enumerate(each[1:]):
                    if value is not None:
                        merged.add(column, value, 1)
            self._coarse.append(merged.row(self._thinning[0][0]))
            self._thinning = []
        self._thinning.append(row)
