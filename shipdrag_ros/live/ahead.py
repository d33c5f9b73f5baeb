# SPDX-License-Identifier: Apache-2.0
"""What is to come: the glide as the node foretells it, her track, and if she were stopped now."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.display import utc
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.forecast.stopped import HullNow, if_stopped
from shipdrag_ros.live.earlier import PastRun
from shipdrag_ros.live.figures import PagePart, checked_part, forecast_part, track_part
from shipdrag_ros.live.outputs import ComingGlide, ComingPath, Figure
from shipdrag_ros.samples import SECOND_NS, Block, Channel
from shipdrag_ros.ship import Ship

_PLACES = 7200  # kept, one a second at most
_STEP_S = 10  # of the ship's time, between two answers to "if she were stopped now"
_POSITIONS = (Channel.POSITION, Channel.POSITION_GEODETIC)
_NOTHING_LEFT = 'she may no longer glide, or nothing is left to foretell'
_ENDED = {
    EndedBy.SPEED: 'she is as slow as a coastdown goes',
    EndedBy.TURN: 'she turned',
    EndedBy.ENGINE: 'she is driven again',
    EndedBy.BRAKE: 'something but the water slows her',
    EndedBy.ASTERN: 'the propeller was reversed',
    EndedBy.DATA_STOP: 'her speed is no longer read',
    EndedBy.SILENCE: 'all inputs are silent',
    EndedBy.RESET: 'the node was reset',
    EndedBy.RECORD_END: 'the record ends',
}


class Ahead:
    """
    What is to come, by one thread.

    Attributes
    ----------
    forecast
        Part of the page: the rest of the glide; or, once it is over, what was foretold half-way
        beside what was. None before the first.
    track
        Positions heard since the stop and those to come; None without positions.
    """

    def __init__(self) -> None:
        self.forecast: PagePart | None = None
        self.track: PagePart | None = None
        self._coming: list[ComingGlide] = []
        self._paths: list[ComingPath] = []
        self._places: deque[tuple[int, int, int, float, float]] = deque(maxlen=_PLACES)
        self._answered: tuple[object, ...] = ()
        self._answer: PagePart | None = None

    def add(self, block: Block) -> None:
        """
        Take positions among readings, the first of each second.
        """
        for row in np.flatnonzero(np.isin(block.channel, _POSITIONS)).tolist():
            stamp_ns, (x, y) = int(block.stamp_ns[row]), block.value[row].tolist()
            if not self._places or stamp_ns // SECOND_NS > self._places[-1][1] // SECOND_NS:
                self._places.append((int(block.channel[row]), stamp_ns, stamp_ns, x, y))

    def begin(self) -> None:
        """
        A coastdown has begun.
        """
        self.forecast = self.track = None
        self._coming, self._paths = [], []

    def take(
        self,
        coming: ComingGlide | None,
        ship: Ship | None,
        last: Figure | None,
        coast_ns: int | None,
    ) -> None:
        """
        Take a forecast, or its withdrawal: what was foretold half-way is then compared.

        Parameters
        ----------
        coming
            None: it is withdrawn.
        ship
        last
            Last estimate of the speed.
        coast_ns
            When the coastdown began.
        """
        if coming is not None:
            self._coming.append(coming)
            self.forecast = forecast_part(coming, ship)
        elif self._coming:
            self.forecast = {'withdrawn': _NOTHING_LEFT}
            if last is not None and coast_ns is not None:
                self.forecast |= checked_part(self._coming, last, coast_ns)

    def take_path(self, path: ComingPath | None, coast_ns: int | None) -> None:
        """
        Take the positions to come, or their withdrawal: those of half-way are shown then.
        """
        if coast_ns is None or (path is None and not self._paths):
            return
        glide, time_s = None, None
        if path is not None:
            self._paths.append(path)
            glide = next((each for each in self._coming if each.stamp_ns == path.stamp_ns), None)
            time_s = (self.forecast or {}).get('time_s', (None,))[0]
        shown = _half_way(self._paths, coast_ns) if path is None else path
        kept = [each for each in self._places if each[1] >= coast_ns]
        if kept:
            block = Block.of_samples(kept)
            heard = Window.from_block(block, kept[0][1], kept[-1][1]).position
            self.track = track_part(heard.value, shown, glide, time_s)

    def end(self, ended_by: str) -> None:
        """
        Say why a forecast was withdrawn, once the coastdown has ended.
        """
        if self.forecast is not None and 'withdrawn' in self.forecast:
            known = {each.value: text for each, text in _ENDED.items()}
            self.forecast['withdrawn'] = known.get(ended_by, ended_by)

    def if_stopped(
        self, ship: Ship | None, speed_m_s: float | None, past: Sequence[PastRun], now_s: int
    ) -> PagePart:
        """
        Return the glide that would begin now, from the hull as last known, or why it is not said.

        Parameters
        ----------
        ship
        speed_m_s
            None where none is read now.
        past
            Coastdowns that ended.
        now_s
            The ship's time.
        """
        run = next((each for each in reversed(past) if each.curve is not None), None)
        asked = (ship, speed_m_s is None, run, now_s // _STEP_S)
        if self._answer is None or asked != self._answered:
            self._answered, self._answer = asked, _if_stopped(ship, speed_m_s, run, now_s)
        return self._answer


def _if_stopped(
    ship: Ship | None, speed_m_s: float | None, run: PastRun | None, now_s: int
) -> PagePart:
    if ship is None:
        return {'why': 'the ship is not known yet'}
    if speed_m_s is None:
        return {'why': 'no speed is read'}
    try:
        if run is not None and run.curve is not None:
            curve = run.curve
            hull = HullNow.of_run(
                curve.speed_m_s,
                curve.resistance_m_s2,
                curve.sigma_m_s2,
                f'the coastdown of {utc(run.start_ns)}',
            )
        else:
            hull = HullNow.of_file(ship)
        found = if_stopped(hull, ship, speed_m_s, now_s * SECOND_NS)
    except ShipdragError as error:
        return {'why': str(error)}
    part = forecast_part(ComingGlide(found.made_ns, found.in_time()), ship)
    return {**part, 'rows': [], 'hull': hull.source}


def _half_way(made: Sequence[ComingPath], coast_ns: int) -> ComingPath:
    """Return the first that was made after the half of the time."""
    half_ns = (coast_ns + made[-1].stamp_ns) // 2
    return next(each for each in made if each.stamp_ns >= half_ns)
