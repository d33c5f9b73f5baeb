# SPDX-License-Identifier: Apache-2.0
"""
The figures of the page: the ship, a curve, a run that has ended, what is to come, traces.

Plain numbers in SI units. Traces are of the last two days: means over 1 s of late, over 10 s
before. Memory is bounded, whatever the rates of the sensors.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import islice, repeat
from typing import Any, TypeVar

import numpy as np

from shipdrag_ros.coastdown.events import ENDED_BY
from shipdrag_ros.coastdown.running import speed_at_rest
from shipdrag_ros.display import LIGHT_KG, M_S_PER_KNOT
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.force import clean_hull
from shipdrag_ros.forecast.foretell import HullNow, if_stopped
from shipdrag_ros.forecast.result import NO_WAY, places
from shipdrag_ros.live.outputs import ComingGlide, ComingPath, Curve, Figure, PastRun
from shipdrag_ros.samples import GEODETIC, KIND, SECOND_NS, Block, Channel, Float64
from shipdrag_ros.ship import Ship

_PLACES = 7200  # kept, one a second at most
_STEP_S = 10  # of the ship's time, between two answers to "if she were stopped now"
_POSITIONS = [*GEODETIC, *GEODETIC.values()]
_NOTHING_LEFT = 'she may no longer glide, or nothing is left to foretell'


class Ahead:
    """
    The glide as the node foretells it, her track, and if she were stopped now; by one thread.

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
        self._places: dict[int, deque[tuple[int, int, int, float, float]]] = {
            channel: deque(maxlen=_PLACES) for channel in _POSITIONS
        }
        self._answered: tuple[object, ...] = ()
        self._answer: PagePart | None = None

    def add(self, block: Block) -> None:
        """
        Take positions among readings, the first of each second of an instrument.
        """
        for row in np.flatnonzero(np.isin(block.channel, _POSITIONS)).tolist():
            stamp_ns, (x, y) = int(block.stamp_ns[row]), block.value[row].tolist()
            channel = int(block.channel[row])
            kept = self._places[channel]
            if not kept or stamp_ns // SECOND_NS > kept[-1][1] // SECOND_NS:
                kept.append((channel, stamp_ns, stamp_ns, x, y))

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
        shown = path or _half_way(self._paths, coast_ns, self._paths[-1].stamp_ns)
        kept = [place for each in self._places.values() for place in each if place[1] >= coast_ns]
        if kept:
            end_ns = max(place[1] for place in kept)
            # two antennas or frames do not mix: that which the path goes on from
            heard = places(Window.from_block(Block.of_samples(kept), coast_ns, end_ns))
            if heard is not None:
                self.track = track_part(heard.value, shown, glide, time_s)

    def end(self, ended_by: str) -> None:
        """
        Say why a forecast was withdrawn, once the coastdown has ended.
        """
        if self.forecast is not None and 'withdrawn' in self.forecast:
            known = {each.value: text for each, text in ENDED_BY.items()}
            self.forecast['withdrawn'] = known.get(ended_by, ended_by)

    def if_stopped(
        self, ship: Ship | None, speed_m_s: float | None, run: PastRun | None, now_s: int
    ) -> PagePart:
        """
        Return the glide that would begin now, from the hull as last known, or why it is not said.

        Parameters
        ----------
        ship
        speed_m_s
            None where none is read now.
        run
            The last coastdown that gave a curve.
        now_s
            The ship's time.
        """
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
            known = run.curve.speed_m_s, run.curve.resistance_m_s2, run.curve.sigma_m_s2
            hull = HullNow.of_run(*known, run.start_ns)
        else:
            hull = HullNow.of_file(ship)
        now_ns = now_s * SECOND_NS
        found = if_stopped(hull, ship, speed_m_s, now_ns, rest_m_s=speed_at_rest(ship))
    except ShipdragError as error:
        return {'why': str(error)}
    if not found.targets_m_s:
        return {'why': NO_WAY}
    part = forecast_part(ComingGlide(found.made_ns, found.in_time()), ship)
    return {**part, 'rows': [], 'hull': hull.source}


_Foretold = TypeVar('_Foretold', ComingGlide, ComingPath)


def _half_way(made: Sequence[_Foretold], start_ns: int, end_ns: int) -> _Foretold:
    """Return the first that was made after the half of a time, or the last."""
    half_ns = (start_ns + end_ns) // 2
    return next((each for each in made if each.stamp_ns >= half_ns), made[-1])


_CLEAN_POINTS = 60
_CURVE_POINTS = 60
_PAST_POINTS = 24
_TRACK_POINTS = 60
_SPOKEN_OF_M_S = 2.0 * M_S_PER_KNOT

PagePart = dict[str, Any]
_TO_GO_S = 3600.0  # a time to go beyond it is not shown
_LEAST_POINTS = 4
_LEAST_SLOPE = 0.2  # of log band over log time; flatter is no promise


def ship_part(ship: Ship | None) -> PagePart | None:
    """
    Return the ship's name, mass and clean hull; None where she is not known.
    """
    if ship is None:
        return None
    part: PagePart = {'name': ship.name, 'mass_kg': ship.mass_kg, 'clean': None}
    if ship.baseline is not None:
        low, high = ship.baseline_range_m_s
        speed = np.linspace(max(low, 0.02 * high), high, _CLEAN_POINTS)
        part['clean'] = {
            'speed_m_s': _rounded(speed),
            'resistance_n': _rounded(ship.resistance_n(speed)),
        }
    return part


def at_usual_speed(curve: Curve, ship: Ship | None) -> PagePart:
    """
    Return r at the speed at which figures are stated, and its share over the clean hull.

    Parameters
    ----------
    curve
        Of a run.
    ship
        None where she is not known: no share is given.
    """
    at = curve.usual_m_s(ship)
    r, sigma = curve.at(at)
    part: PagePart = {'speed_m_s': at, 'r': r, 'r_sigma': sigma}
    if ship is not None:
        (clean,), (clean_sd,) = clean_hull(ship, np.array([at]))
        if np.isfinite(clean):
            ratio = r * ship.mass_kg / float(clean)
            spread = ratio * float(np.hypot(sigma / r, clean_sd / clean)) if r > 0.0 else np.inf
            part |= {'over_clean': ratio - 1.0, 'over_clean_sd': spread}
    return part


def past_part(run: PastRun, ship: Ship | None) -> PagePart:
    """
    Return a run that has ended, for the list and for the chart.
    """
    part: PagePart = {
        'start_s': run.start_ns // SECOND_NS,
        'length_s': (run.end_ns - run.start_ns) * 1e-9,
        'heading_deg': run.compass_deg,
        'ended_by': run.ended_by,
        'why_not': run.why_not,
        'bag': run.bag,
    }
    if run.curve is not None:
        part |= at_usual_speed(run.curve, ship)
        part['curve'] = curve_part(run.curve, points=_PAST_POINTS)
    return part


def curve_part(curve: Curve | None, *, points: int = _CURVE_POINTS) -> PagePart | None:
    """
    Return a curve by a few points; None where there is none.
    """
    if curve is None:
        return None
    speed = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], points)
    return {
        'speed_m_s': _rounded(speed),
        'r': _rounded(np.interp(speed, curve.speed_m_s, curve.resistance_m_s2)),
        'r_sigma': _rounded(np.interp(speed, curve.speed_m_s, curve.sigma_m_s2)),
    }


def forecast_part(coming: ComingGlide, ship: Ship | None) -> PagePart:
    """
    Return the rest of the glide: one speed in figures, and the curve to come.

    The speed is 2 knots; of a model ship, or where the end of its band is beyond what is foretold,
    half of the present one.
    """
    speed = coming.points[:, 1]
    light = ship is not None and ship.mass_kg < LIGHT_KG
    wanted = 0.5 * float(speed[0]) if light else _SPOKEN_OF_M_S
    if not wanted < speed[0] or coming.time_s(wanted)[2] is None:
        wanted = max(0.5 * float(speed[0]), float(speed[-1]))
    time_s, low_s, high_s = coming.time_s(wanted)
    return {
        'made_s': coming.stamp_ns // SECOND_NS,
        'speed_m_s': wanted,
        'time_s': [time_s, low_s, high_s],
        'way_m': None if time_s is None else coming.way_m(time_s),
        'rows': [_rounded(row[:4]) for row in coming.points],
    }


def checked_part(made: Sequence[ComingGlide], last: Figure, start_ns: int) -> PagePart:
    """
    Return what was foretold half-way, beside what was: when she had her last speed.
    """
    then = _half_way(made, start_ns, last.stamp_ns)
    foretold_s, low_s, high_s = then.time_s(last.value)
    return {
        'speed_m_s': last.value,
        'foretold_s': [foretold_s, low_s, high_s],
        'was_s': (last.stamp_ns - then.stamp_ns) * 1e-9,
    }


def track_part(
    heard_m: Float64, path: ComingPath, coming: ComingGlide | None, time_s: float | None
) -> PagePart:
    """
    Return the track since the stop and the one to come, about the last position heard.

    Parameters
    ----------
    heard_m : (n, 2)
        Positions since the stop.
    path
        Those to come.
    coming
        The forecast that they belong to; None where it is over.
    time_s
        At which a mark is set on the track to come, with the band of the way through water; None:
        there is none.
    """
    here = heard_m[-1]
    part: PagePart = {
        'was': _thinned(heard_m - here),
        'ahead': _thinned(path.place_m - here),
        'mark': None,
        'over': coming is None,
    }
    if coming is not None and time_s is not None:
        mark = np.array([np.interp(time_s, path.time_s, axis) for axis in path.place_m.T])
        ways = coming.points.T[4:]
        far = np.array([np.interp(time_s, coming.points[:, 0], each) for each in ways])
        way = path.place_m[-1] - path.place_m[0]
        beside = np.outer(far - far[0], way / max(float(np.hypot(*way)), 1e-9))
        part['mark'] = np.round(mark + beside - here, 2).tolist()
    return part


def _thinned(place_m: Float64) -> list[list[float]]:
    few = np.unique(np.linspace(0, len(place_m) - 1, _TRACK_POINTS).round().astype(int))
    return [[round(float(x), 2), round(float(y), 2)] for x, y in place_m[few]]


def _rounded(values: Any) -> list[float]:
    return [float(f'{value:.5g}') for value in np.asarray(values).tolist()]


def to_go_s(bands: Sequence[tuple[float, float]], goal: float) -> float | None:
    """
    Foresee when the band is narrow enough, by the power law of its latest half.

    Parameters
    ----------
    bands
        Time since the stop [s], ascending, and two standard deviations over r then.
    goal
        The same, as wanted.

    Returns
    -------
    float or None
        Seconds from the last time on, 0 where it is there; None where it cannot be foreseen.
    """
    if not bands:
        return None
    last_s, last = bands[-1]
    if last <= goal:
        return 0.0
    recent = [
        (math.log(t), math.log(band))
        for t, band in bands
        if t >= 0.5 * last_s and t > 0.0 and 0.0 < band < math.inf
    ]
    if len(recent) < _LEAST_POINTS:
        return None
    x, y = np.array(recent).T
    slope = float(np.polyfit(x, y, 1)[0])
    if slope > -_LEAST_SLOPE:
        return None
    left = last_s * ((last / goal) ** (-1.0 / slope) - 1.0)
    return left if left <= _TO_GO_S else None


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
            second = block.stamp_ns[rows[known]] // SECOND_NS
            seconds, place, counts = np.unique(second, return_inverse=True, return_counts=True)
            totals = np.bincount(place, weights=value[known], minlength=len(seconds))
            instrument = 0 if column == _SHAFT else code
            kept = (seconds.tolist(), repeat(column), totals.tolist(), counts.tolist())
            sums += zip(*kept, repeat(instrument))
        for each in sorted(sums):  # by time, all inputs abreast
            self._bin(*each)

    def add_estimate(self, stamp_ns: int, speed_m_s: float) -> None:
        """
        Take an estimated speed.
        """
        self._bin(stamp_ns // SECOND_NS, _ESTIMATE, speed_m_s, 1)

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
        for kept in (self._open, self._fine, self._coarse, self._thinning):
            kept.clear()
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
