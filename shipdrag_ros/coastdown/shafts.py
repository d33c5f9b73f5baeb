# SPDX-License-Identifier: Apache-2.0
"""
What shafts and pitches say about thrust: evidence, never a veto on the speed.

The drive of a propeller is its shaft speed times its pitch, as a fraction of what it
was while the ship was steady. A propeller that stands, or whose pitch is zero, does not
drive. One that windmills follows the ship: its speed falls in proportion to the ship's.
One that is driven at reduced power keeps its speed while the ship slows down. A shaft
that turns on as before says nothing where no pitch is known: the propeller may be a
controllable one at zero pitch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from shipdrag_ros.coastdown.bins import (
    COUNT,
    PER_UNIT,
    PITCH_LEAST,
    TURNING_RAD_S,
    A,
    Bins,
    mean_turning,
    newest_bin,
    speeds,
)
from shipdrag_ros.samples import PITCHES, SHAFTS, Float64

SHAFT_S = 3  # averaged over this long, so that one bad reading engages no engine
FELL = 0.9  # of its steady drive, below which a propeller has slowed down
_ASTERN = -0.1  # of the steady drive: beyond what an idle propeller creeps
_ENGAGED = 0.12  # rise of the drive above its lowest that only an engine makes
_SILENT_S = 60  # a reading is taken to hold for this long
_FOLLOWS = 0.6  # d ln n / d ln v: 1 windmilling, 0 to 0.4 under a governor
_WINDMILLS_BELOW = 0.85  # turns per way, of the steady ones
_SIGMAS = 2.0
_DRIVE_SD = 0.01  # of the logarithm of a drive averaged over some seconds
_KNEE = 0.8  # of the drive before the last fall: where it stopped, ...
_GONE = 0.3  # ... and of the largest: where it is over
_BEFORE_S = 90  # the drive before the last fall is the upper fifth of this long
_RUN_DOWN_S = 12  # a fall that takes longer may have been ordered so
_EVEN = 0.52  # of the plateau, half-way down: an even fall has 0.55, one by itself 0.49
_PUSHES = 0.65  # of its steady speed, about where a propeller gives no thrust any more


class Thrust(Enum):
    """What the propellers do."""

    UNKNOWN = 'unknown'
    STANDS = 'stands'  # all that drove stand, or are at zero pitch
    WINDMILLS = 'windmills'  # all that drove stand or follow the ship
    REDUCED = 'reduced'  # one that slowed down holds its speed: less power, or less pitch
    ON = 'on'  # one turns on as before
    ASTERN = 'astern'


@dataclass(frozen=True)
class Drive:
    """
    The steady drive that others are compared with, one of each of `SHAFTS`.

    Attributes
    ----------
    turning
        Rate of turn [rad/s]; NaN where none drove, or none is known.
    pitch
        As sent; NaN where none is stated.
    """

    turning: tuple[float, ...] = (math.nan,) * len(SHAFTS)
    pitch: tuple[float, ...] = (math.nan,) * len(SHAFTS)

    @property
    def known(self) -> int:
        """How many shafts drove by their own reading."""
        return sum(not math.isnan(turning) for turning in self.turning)


@dataclass(frozen=True)
class SpeedEvidence:
    """
    What the speed shows.

    Attributes
    ----------
    source
        Of the speed.
    start
        First bin of what may be a coastdown, as far as is known.
    slope_sd
        Standard deviation of a slope over a slope window [m/s^2].
    """

    source: int
    start: int
    slope_sd: float


@dataclass(frozen=True)
class ShaftEvidence:
    """
    What the propellers did about a candidate.

    Attributes
    ----------
    thrust
        What they do now.
    stop
        First bin in which none drove as before; None where that is not known.
    drive
        Of the propeller that counts, as a fraction of its steady one; NaN where unknown.
    """

    thrust: Thrust
    stop: int | None = None
    drive: float = math.nan

    @property
    def text(self) -> str:
        """The drive in words."""
        return f'at {self.drive:.0%} of its steady drive'


UNKNOWN_THRUST = ShaftEvidence(Thrust.UNKNOWN)


def steady_drive(bins: Bins, last: int, width: int) -> Drive:
    """
    Return the mean drive over the bins last - width + 1 .. last.

    A propeller that turns against its mean over all that is kept brakes the ship: it is
    left out, and the end of a crash stop is no stop of the engine.
    """
    turning, pitch = [], []
    for shaft, blade in zip(SHAFTS, PITCHES, strict=True):
        turns, count = mean_turning(bins, int(shaft), last, width)
        usual, _ = mean_turning(bins, int(shaft), last, bins.places.shape[1])
        drives = count >= 3 and abs(turns) >= TURNING_RAD_S and turns * usual > 0.0
        turning.append(turns if drives else math.nan)
        angle, count = mean_turning(bins, int(blade), last, width)
        pitch.append(angle if count >= 3 and abs(angle) > PITCH_LEAST else math.nan)
    return Drive(tuple(turning), tuple(pitch))


def drives(bins: Bins, steady: Drive, first: int, last: int) -> Float64:
    """
    Return the drive of each shaft in each bin, a fraction of the steady one.

    Returns
    -------
    (shafts that drove, last - first + 1)
        NaN where nothing is stated.
    """
    rows = []
    for shaft, blade, turning, pitch in zip(
        SHAFTS, PITCHES, steady.turning, steady.pitch, strict=True
    ):
        if math.isnan(turning):
            continue
        row = _each(bins, int(shaft), first, last) / turning
        if not math.isnan(pitch):
            row = row * (_each(bins, int(blade), first, last) / pitch)
        rows.append(row)
    return np.array(rows).reshape(-1, last - first + 1)


def _each(bins: Bins, channel: int, first: int, last: int) -> Float64:
    """Return the readings of the bins first .. last; each holds until the next."""
    places = bins.places[channel]
    newest = int(bins.closed[channel])
    oldest = newest - len(places) + 2
    numbers = np.arange(first - _SILENT_S, last + 1)
    inside = np.clip(numbers, oldest, newest)
    total = places[inside & (len(places) - 1)]
    below = places[(inside - 1) & (len(places) - 1)]
    there = (inside == numbers) & (total[:, COUNT] != below[:, COUNT])
    place = np.arange(len(numbers))
    held = np.maximum.accumulate(np.where(there, place, -1))
    known = (held >= 0) & (place - held <= _SILENT_S)
    values = (total[:, A] - below[:, A]) / PER_UNIT
    found: Float64 = np.where(known, values[held], np.nan)[_SILENT_S:]
    return found


def propulsion(
    bins: Bins, steady: Drive, seen: SpeedEvidence, number: int, *, width: int, stands: float
) -> ShaftEvidence:
    """
    Say what the propellers do at bin `number`, and when the last of them stopped.

    Parameters
    ----------
    steady
        Their drive before.
    seen
        The speed that they are compared with.
    width
        Length of a slope window.
    stands
        Fraction of the steady drive below which a propeller counts as standing.
    """
    if not steady.known or not _heard(bins, number):
        return UNKNOWN_THRUST
    first = seen.start - 3 * width
    rows = drives(bins, steady, first, number)
    rows = rows[~np.isnan(rows[:, -1])]
    # one that repeats to the last bit is stuck, unless it stands
    moves = np.array([np.ptp(row[-width:]) > 0.0 for row in rows], bool)
    now = np.nanmean(rows[:, -SHAFT_S:], axis=1)  # the last one is known
    if np.any(now < _ASTERN):
        return ShaftEvidence(Thrust.ASTERN, None, float(now.min()))
    fell = now < FELL
    if not fell.any():
        pitched = not any(
            math.isnan(pitch) and not math.isnan(turning)
            for turning, pitch in zip(steady.turning, steady.pitch, strict=True)
        )
        if pitched and moves.any():
            return ShaftEvidence(Thrust.ON, None, float(now.max()))
        return UNKNOWN_THRUST
    if np.any(~fell & moves):
        return ShaftEvidence(Thrust.ON, None, float(now.max()))
    stops = [first + _knee(row) for row in rows[fell]]
    found = [
        Thrust.STANDS
        if drive < stands
        else _follows(bins, seen, row[stop - first :], stop, number, width)
        for row, stop, drive in zip(rows[fell], stops, now[fell], strict=True)
    ]
    # what followed the ship before is not what stopped
    dated = [stop for stop, one in zip(stops, found, strict=True) if one is not Thrust.ON]
    for worst in (Thrust.REDUCED, Thrust.UNKNOWN, Thrust.WINDMILLS, Thrust.STANDS):
        if worst in found:
            return ShaftEvidence(worst, max(dated), float(now[fell].max()))
    return ShaftEvidence(Thrust.ON, None, float(now.max()))


def _heard(bins: Bins, number: int) -> bool:
    return any(newest_bin(bins, int(shaft)) >= number - _SILENT_S for shaft in SHAFTS)


def _follows(
    bins: Bins, seen: SpeedEvidence, row: Float64, stop: int, number: int, width: int
) -> Thrust:
    """Say whether a propeller that slowed down at `stop` follows the ship, or drives it."""
    # after the run-down: a third of the time since, but not less than two thirds of a window
    settled = max((number - stop) // 3, 2 * width // 3)
    third = (number - stop - settled) // 3
    if third < max(2, width // 4):
        return Thrust.UNKNOWN
    spans = (
        (stop - width, stop - 1),
        (stop + settled, stop + settled + third),
        (
            number - third,
            number,
        ),
    )
    ways = [speeds(bins, seen.source, a, b)[1] for a, b in spans]
    if min(len(way) for way in ways) < 2:
        return Thrust.UNKNOWN
    before, early, late = (float(way.mean()) for way in ways)
    first, last = (float(np.nanmean(part)) for part in (row[settled:][: third + 1], row[-third:]))
    if not min(before, early, late, first, last) > 0.0:
        return Thrust.UNKNOWN
    sd = _FOLLOWS * 0.7 * seen.slope_sd * width / late + _DRIVE_SD
    excess = math.log(last / first) - _FOLLOWS * math.log(late / early)
    if excess > _SIGMAS * sd:
        return Thrust.REDUCED
    if excess < -_SIGMAS * sd:
        # as many turns per way as before: driven still, or not driven before
        return Thrust.WINDMILLS if last * before / late < _WINDMILLS_BELOW else Thrust.ON
    return Thrust.UNKNOWN


def _knee(row: Float64) -> int:
    """Return the place at which a drive began its last fall to what it is now."""
    low = float(np.nanmean(row[-SHAFT_S:]))
    above = np.nan_to_num(row, nan=low) - low
    high = float(above.max())
    driving = np.flatnonzero(above > _GONE * high)
    if not high > 0.0 or not len(driving):
        return len(row) - 1
    gone = int(driving[-1])
    # what it fell from: a slow-down may have come before
    plateau = float(np.quantile(above[max(0, gone - _BEFORE_S) : gone + 1], 0.8))
    knee = int(np.flatnonzero(above[: gone + 1] >= _KNEE * plateau)[-1])
    # a shaft that runs down by itself does so ever more slowly, from the stop on; one that is
    # taken back evenly drives until the water alone turns it as fast
    middle = (knee + gone) // 2
    if gone - knee < _RUN_DOWN_S or above[middle - 1 : middle + 2].mean() < _EVEN * plateau:
        return knee + 1
    drives = np.flatnonzero(row[knee : gone + 1] >= _PUSHES * (plateau + low))
    return knee + 1 + int(drives[-1] if len(drives) else 0)


def engaged_at(bins: Bins, steady: Drive, start: int, number: int) -> tuple[Thrust, int] | None:
    """
    Say whether a propeller that stood or windmilled is driven again.

    Returns
    -------
    (thrust, last) or None
        `ON` or `ASTERN`, and the last bin before it.
    """
    if not steady.known or not _heard(bins, number) or number - start < SHAFT_S:
        return None
    first = max(start, number - 600)
    for row in drives(bins, steady, first, number):
        now = row[-SHAFT_S:].mean()
        if now < _ASTERN:
            before = np.flatnonzero(row > 0.5 * _ASTERN)
            return Thrust.ASTERN, first + int(before[-1]) if len(before) else first
        mean = np.convolve(row, np.full(SHAFT_S, 1.0 / SHAFT_S), 'valid')
        if np.isnan(mean).all():
            continue
        low = float(np.nanmin(mean))
        if low < FELL and now > low + _ENGAGED:
            still = np.flatnonzero(row <= low + 0.3 * _ENGAGED)
            return Thrust.ON, first + int(still[-1]) if len(still) else first
    return None


def all_stand(bins: Bins, steady: Drive, number: int, stands: float) -> bool:
    """
    Say whether all propellers that drove are seen to stand.
    """
    if not steady.known:
        return False
    now = drives(bins, steady, number - SHAFT_S + 1, number).mean(axis=1)
    return bool(np.all(np.abs(now) < stands))
