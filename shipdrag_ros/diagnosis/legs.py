# SPDX-License-Identifier: Apache-2.0
"""
A sailing record as legs: means over short stretches on one course; and what zeros of its log say.

Neither baseline nor ship is needed to compare a log with the way made good over ground. The slope
of a line through places is a mean of the velocity, with weights that fall to 0 at both ends; the
log is averaged with the same weights, so that both are of the same motion however it changes.
Where samples are missing, or the vessel turns or stops, it is left out and counted.

Readings of exactly 0 while the ship moves show a speed below which a log stands still. Zeros that
come at any speed are drop-outs; a ship that drifts with the water has a log that rightly reads 0,
and one way over ground.
"""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln, expit, logsumexp

from shipdrag_ros.diagnosis.result import EffectEstimate, Where
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.rows import MAD_TO_SD, OUTLIER
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.effects import EffectWay, ways_of
from shipdrag_ros.samples import GEODETIC, Block, Channel, Float64, Int64
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation.effect import WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY

_Values = NDArray[np.float64] | NDArray[np.complex128]
LEAST_LEGS = 8
_LEG_S, _MOST_LEGS = 60.0, 300  # a record longer than so many legs has longer ones
_SAMPLES = 6  # of the slower input in a leg; a leg is as long as that needs
_SHARE = 0.5  # of the samples that a leg should hold, below which it has a dropout
_YAW_SD_RAD = 0.1  # of the heading within a leg: at 0.1 the way made good is 0.5 % short
_STRAIGHT = 0.994  # velocity over the speeds of both halves, where there is no heading: no shorter
_NEAR_S = 10.0  # of a turn the flow at the log is not that of a straight course
_ZEROS = 0.05  # of the readings of a leg, from where its mean is no speed
_STOPPED = 0.25  # of the usual speed


class Left(StrEnum):
    """Why a stretch is left out."""

    DROPOUT = 'dropout'
    TURN = 'turn'
    STOP = 'stop'
    ZERO = 'log at 0'


class Direction(StrEnum):
    """How the direction of a leg is known."""

    TRACK = 'track over ground'
    HEADING = 'heading'
    UNKNOWN = 'unknown'


@dataclass(frozen=True)
class SailingRecord:
    """
    A record of any sailing.

    Attributes
    ----------
    name
        For the user.
    block
        Accepted samples in arrival order.
    units_checked
        Whether it is known that its units are right, so that nothing is asked.
    """

    name: str
    block: Block
    units_checked: bool = False


@dataclass(frozen=True)
class Legs:
    """
    Legs of one or several records, in ascending time within each.

    Attributes
    ----------
    record : (n,)
        Number of the record of each leg.
    time_s : (n,)
        Middle of each, from the start of its record.
    log_m_s, ground_m_s : (n,)
        Mean speed by the log, and over ground.
    acceleration_m_s2 : (n,)
        Mean change of the log in a second.
    direction_rad : (n,)
        From east, anticlockwise; 0 where unknown.
    direction
        How it is known.
    length_s
        Of the longest leg.
    geodetic
        Whether all ways over ground are from latitude and longitude.
    left_out
        Stretches that are not legs, by reason.
    notes
        What was not used of the records, a sentence each.
    """

    record: Int64
    time_s: Float64
    log_m_s: Float64
    ground_m_s: Float64
    acceleration_m_s2: Float64
    direction_rad: Float64
    direction: Direction
    length_s: float
    geodetic: bool
    left_out: Mapping[Left, int]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.time_s)

    @classmethod
    def of(cls, records: Sequence[SailingRecord], parameters: Parameters) -> Legs:
        """
        Cut records into legs.

        Parameters
        ----------
        records
            Of the same vessel.
        parameters
            For the convention of the heading.

        Returns
        -------
        Legs
            Of even sailing alone.

        Raises
        ------
        DiagnosisError
            If they have no log, nothing over ground, or too few even stretches.
        """
        cut = _cutters(records, parameters)
        stretches = [(j, one.leg(float(at_s))) for j, one in cut for at_s in one.edges]
        found = [(j, leg) for j, leg in stretches if isinstance(leg, _Leg)]
        left = Counter(dict.fromkeys(Left, 0))
        left.update(why for _, why in stretches if isinstance(why, Left))
        usual = float(np.median([leg.ground_m_s for _, leg in found])) if found else 0.0
        slowest = _STOPPED * usual
        kept = [(j, leg) for j, leg in found if min(leg.ground_m_s, leg.log_m_s) > slowest]
        moving = [leg for _, leg in kept]
        left[Left.STOP] += len(found) - len(moving)
        if len(moving) < LEAST_LEGS:
            names = ', '.join(repr(record.name) for record in records)
            raise DiagnosisError(
                f'{names}: {len(moving)} stretches of even sailing (left out: {left_text(left)}), '
                f'at least {LEAST_LEGS} of {_LEG_S:.0f} s are needed to hold the log against '
                'the way over ground: give a longer record'
            )
        known = {leg.direction for leg in moving}
        columns: dict[str, Any] = {
            name: np.array([getattr(leg, name) for leg in moving]) for name in _Leg._fields[:-1]
        }
        return cls(
            record=np.array([j for j, _ in kept]),
            **columns,
            direction=known.pop() if len(known) == 1 else Direction.HEADING,
            length_s=max(one.length_s for _, one in cut),
            geodetic=all(one.geodetic for _, one in cut),
            left_out={why: count for why, count in left.items() if count},
            notes=tuple(dict.fromkeys(note for _, one in cut for note in one.notes)),
        )

    def __getitem__(self, part: Int64) -> Legs:
        parts: dict[str, Any] = {
            name: each[part] for name, each in vars(self).items() if isinstance(each, np.ndarray)
        }
        return replace(self, **parts)

    def through_water(self, current_m_s: tuple[float, float]) -> Float64:
        """
        Return the speed through water [m/s] that a current east, north leaves, (n,).

        Parameters
        ----------
        current_m_s
            Velocity of the water to the east and to the north [m/s].

        Returns
        -------
        (n,)
            Speed along the heading [m/s].
        """
        east, north = current_m_s
        cos, sin = np.cos(self.direction_rad), np.sin(self.direction_rad)
        ahead, to_port = east * cos + north * sin, north * cos - east * sin
        if self.direction is Direction.TRACK:
            return np.hypot(self.ground_m_s - ahead, to_port)
        # the vessel points where it heads, and its track is set to the side
        return np.sqrt(np.maximum(self.ground_m_s**2 - to_port**2, 0.0)) - ahead


def left_text(left_out: Mapping[Left, int]) -> str:
    """
    Return what is left out, in words.

    Parameters
    ----------
    left_out
        Stretches by reason.

    Returns
    -------
    str
        'nothing' where there are none.
    """
    return ', '.join(f'{why} {count}' for why, count in left_out.items() if count) or 'nothing'


@dataclass(frozen=True)
class Stretches:
    """
    Stretches of records in which the log may read exactly 0.

    Attributes
    ----------
    way_m_s : (n,)
        Velocity over ground, east + 1j north; without positions the speed alone.
    zero : (n,)
        Whether most readings are exactly 0.
    by_place
        Whether the direction of the way is known.
    length_s
        Of the longest record.
    """

    way_m_s: NDArray[np.complex128]
    zero: NDArray[np.bool_]
    by_place: bool
    length_s: float

    @classmethod
    def of(cls, records: Sequence[SailingRecord], parameters: Parameters) -> Stretches:
        """
        Cut records into stretches, whatever was done in them.

        Parameters
        ----------
        records, parameters
            As of `Legs.of`.

        Raises
        ------
        DiagnosisError
            If they have no log, or nothing over ground.
        """
        cut = [one for _, one in _cutters(records, parameters)]
        every = [one.stretch(float(at_s)) for one in cut for at_s in one.edges]
        found = [each for each in every if each is not None]
        return cls(
            np.array([way for way, _ in found], np.complex128),
            np.array([zero for _, zero in found], np.bool_),
            all(one.by_place for one in cut),
            max(float(one.edges[-1]) + one.length_s for one in cut),
        )


@dataclass(frozen=True)
class _Timed:
    """Values at times from the start of the record [s]; places are complex."""

    time_s: Float64
    value: _Values

    @classmethod
    def of(cls, series: Series, start_ns: int) -> _Timed:
        """Count the times of a series from a start [ns since the epoch]."""
        value = series.value
        flat = value if value.ndim == 1 else value[:, 0] + 1j * value[:, 1]
        return cls(np.asarray((series.time_ns - start_ns) * 1e-9, np.float64), flat)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """The usual time between samples."""
        return max(float(np.median(np.diff(self.time_s))), 1e-3)

    def part(self, start_s: float, end_s: float) -> _Timed:
        """Return the samples between two times."""
        first, last = np.searchsorted(self.time_s, (start_s, end_s))
        return _Timed(self.time_s[first:last], self.value[first:last])

    def near_median(self) -> _Timed:
        """Return the samples near the median: a log reads 0 now and then, and spikes."""
        middle = float(np.median(np.asarray(self.value, np.float64)))
        return self._near(np.abs(self.value - middle), 0.05 * abs(middle))

    def near_line(self) -> _Timed:
        """Return the samples near a line through all."""
        found = self
        for _ in range(2):
            slope = _Weights.of(found.time_s).slope_of(found.value)
            off = found.value - slope * found.time_s
            found = found._near(np.abs(off - off.mean()), 1e-9)
        return found

    def _near(self, away: Float64, least: float) -> _Timed:
        keep = away <= OUTLIER * MAD_TO_SD * np.median(away) + least
        return _Timed(self.time_s[keep], self.value[keep])


class _Weights(NamedTuple):
    """
    How a line through values at some times has its slope [1/s].

    A slope of places is a mean of the velocity, in which each instant weighs as much as all
    weights after it.
    """

    time_s: Float64
    of_slope: Float64

    @classmethod
    def of(cls, time_s: Float64) -> _Weights:
        """Return those of a least-squares line."""
        away = time_s - time_s.mean()
        return cls(time_s, away / (away @ away))

    def slope_of(self, value: _Values) -> complex:
        """Return the slope of values at the times."""
        return complex(self.of_slope @ value)

    def mean_of(self, timed: _Timed) -> complex:
        """Return the mean of a velocity at times of its own."""
        after = np.append(np.cumsum(self.of_slope[::-1])[::-1], 0.0)
        # what is read at a time of a place stands for both sides of it
        weight = after[np.searchsorted(self.time_s, timed.time_s)]
        weight += after[np.searchsorted(self.time_s, timed.time_s, side='right')]
        return complex(weight @ timed.value / weight.sum())


class _Leg(NamedTuple):
    """As `Legs` has them."""

    time_s: float
    log_m_s: float
    ground_m_s: float
    acceleration_m_s2: float
    direction_rad: float
    direction: Direction


def _cutters(
    records: Sequence[SailingRecord], parameters: Parameters
) -> list[tuple[int, _LegCutter]]:
    """Return the number of each record with each part of it in which the stamps ascend."""
    found: list[tuple[int, _LegCutter]] = []
    for j, record in enumerate(records):
        if len(record.block) == 0:
            raise DiagnosisError(f'{record.name!r} has no accepted sample: give another record')
        parts, failed = _ascending(record.block), list[DiagnosisError]()
        for part in parts:
            try:
                found.append((j, _LegCutter(record, part, parameters)))
            except DiagnosisError as error:
                failed.append(error)
        if len(failed) == len(parts):
            raise failed[0]
        if len(parts) > 1:
            found[-1][1].notes += (
                f'{record.name}: stamps go back within it (a clock was set, or rows came late): '
                'what is before and what is after is compared apart',
            )
    return found


def _ascending(block: Block) -> list[Block]:
    """Cut a block where the stamps of a channel go back."""
    cuts = {0, len(block)}
    for channel in np.unique(block.channel):
        rows = np.flatnonzero(block.channel == channel)
        cuts.update(rows[1:][np.diff(block.stamp_ns[rows]) <= 0].tolist())
    return [block[first:end] for first, end in pairwise(sorted(cuts))]


class _LegCutter:
    """One record, or a part of it, on its way to legs."""

    def __init__(self, record: SailingRecord, block: Block, parameters: Parameters) -> None:
        start_ns = int(record.block.stamp_ns.min())
        first_ns, end_ns = int(block.stamp_ns.min()), int(block.stamp_ns.max())
        window = Window.from_block(block, first_ns, end_ns).one_of_each()
        window = window.by_rep103(parameters.heading_convention)
        by_place = len(window.position) >= min(_SAMPLES, 1 + len(window.speed_over_ground))
        ground = window.position if by_place else window.speed_over_ground
        if len(window.speed_through_water) < _SAMPLES or len(ground) < _SAMPLES:
            raise DiagnosisError(
                f'{record.name!r} has {len(window.speed_through_water)} '
                f'speeds through water beside {len(ground)} positions or speeds over ground: '
                'give a coastdown (engine stopped after steady sailing), say with --window where '
                'it is, or give a record of sailing with both a log and positions'
            )
        sent = np.bincount(block.channel, minlength=len(Channel))
        first = next((each for each in GEODETIC if sent[[each, GEODETIC[each]]].any()), None)
        self.geodetic = by_place and first is not None and sent[GEODETIC[first]] > sent[first]
        self.notes = tuple(f'{record.name}: {note}' for note in window.notes)
        self.by_place = by_place
        self.log = _Timed.of(window.speed_through_water, start_ns)
        self.ground = _Timed.of(ground, start_ns)
        self.heading = _Timed.of(window.heading, start_ns)
        first_s, end_s = (first_ns - start_ns) * 1e-9, (end_ns - start_ns) * 1e-9
        step_s = max(self.log.step_s, self.ground.step_s)
        self.length_s = max(_LEG_S, (end_s - first_s) / _MOST_LEGS, _SAMPLES * step_s)
        self.edges = np.arange(first_s, end_s, self.length_s)

    def leg(self, start_s: float) -> _Leg | Left:
        """Return the leg that begins at a time, or why there is none."""
        middle, end_s = start_s + 0.5 * self.length_s, start_s + self.length_s
        log, ground = self.log.part(start_s, end_s), self.ground.part(start_s, end_s)
        for part, whole in ((log, self.log), (ground, self.ground)):
            if len(part) < max(_SHARE * self.length_s / whole.step_s, 0.5 * _SAMPLES):
                return Left.DROPOUT
        zeros = float(np.mean(np.asarray(log.value) == 0.0))
        ground, log = self._sound(ground), log.near_median()
        halves = ground.part(start_s, middle), ground.part(middle, end_s)
        beside = log.part(float(ground.time_s[0]), float(ground.time_s[-1]))
        if min(map(len, (beside, *halves))) < 2:
            return Left.DROPOUT
        turned = np.exp(1j * self.heading.part(start_s - _NEAR_S, end_s + _NEAR_S).value)
        yaw = complex(turned.mean()) if len(turned) else 1.0 + 0.0j
        if abs(yaw) < math.exp(-0.5 * _YAW_SD_RAD**2):
            return Left.TURN
        if zeros > _ZEROS:
            return Left.ZERO
        weights = _Weights.of(ground.time_s)
        through = weights.mean_of(log).real
        if through <= 0.0:
            return Left.STOP
        faster = weights.slope_of(np.interp(weights.time_s, log.time_s, log.value)).real
        if not self.by_place:
            known = Direction.HEADING if len(turned) else Direction.UNKNOWN
            over = weights.mean_of(ground).real
            return _Leg(middle, through, over, faster, cmath.phase(yaw), known)
        ways = [_Weights.of(half.time_s).slope_of(half.value) for half in halves]
        if not len(turned) and abs(sum(ways)) < _STRAIGHT * sum(map(abs, ways)):
            return Left.TURN
        way = weights.slope_of(ground.value)
        return _Leg(middle, through, abs(way), faster, cmath.phase(way), Direction.TRACK)

    def stretch(self, start_s: float) -> tuple[complex, bool] | None:
        """Return velocity over ground, and whether the log reads 0; None without readings."""
        end_s = start_s + self.length_s
        log, ground = self.log.part(start_s, end_s), self.ground.part(start_s, end_s)
        if min(len(log), len(ground)) < 0.5 * _SAMPLES:
            return None
        ground = self._sound(ground)
        weights = _Weights.of(ground.time_s)
        way = weights.slope_of(ground.value) if self.by_place else weights.mean_of(ground)
        return way, float(np.mean(np.asarray(log.value) == 0.0)) > 0.5

    def _sound(self, ground: _Timed) -> _Timed:
        return ground.near_line() if self.by_place else ground.near_median()


# what log and track show acts alike on all ships, so that any will do
ANY_SHIP = Ship(
    length_m=10.0, displaced_volume_m3=10.0, added_mass=ConstantAddedMass(value=0.07, sd=0.0)
)
_MOVES_M_S = 0.1  # slower is at rest, as positions show it
_SCATTER_M_S = 0.08  # of the way over ground while the log reads 0, that no drift explains
_APART = 3.0  # stretches in which a wheel sticks once: neighbours are no new evidence
_LAPSES = (0.01, 0.05)  # readings that are otherwise than the speed says
_WIDTHS = (0.02, 0.05, 0.1)  # of the speed at which a wheel begins to turn, relative
_Z = np.linspace(-5.0, 5.0, 401)  # of that speed


@dataclass(frozen=True)
class StandingLog:
    """
    What zeros say of a log that stands still below some speed.

    Attributes
    ----------
    way
        The dead band.
    log_factor
        Logarithm of its Bayes factor over zeros that come at any speed.
    z, sd
        Of the speed.
    at_m_s : (k,)
        Speeds over ground of the stretches in which the log reads 0.
    share
        Of the stretches below that speed, in which it does.
    length_s
        Of the longest record.
    """

    way: EffectWay
    log_factor: float
    z: float
    sd: float
    at_m_s: Float64
    share: float
    length_s: float

    @classmethod
    def of(cls, records: Sequence[SailingRecord], parameters: Parameters) -> StandingLog | None:
        """
        Look at the zeros of a log; None where there are none, or the water may move the ship.

        Parameters
        ----------
        records
            With frozen readings of 0.
        parameters
            For the convention of the heading.

        Raises
        ------
        DiagnosisError
            If there is no log, or nothing over ground.
        """
        stretches = Stretches.of(records, parameters)
        moving = np.abs(stretches.way_m_s) > _MOVES_M_S
        way, zero = stretches.way_m_s[moving], stretches.zero[moving]
        speed = np.abs(way)
        if not zero.any() or zero.all() or _drifts(way[zero], stretches.by_place):
            return None
        (effect,) = (e for e in LIBRARY.values() if WithoutBaseline.ZEROS in e.without_baseline)
        (band,) = effect.parameters
        bands = np.array([band.prior.at(z) for z in _Z.tolist()])
        weight = np.exp(-0.5 * _Z**2)
        each = np.log(weight / weight.sum()) + _log_likelihood(bands, speed, zero) / _APART
        n, k = len(zero), int(zero.sum())
        at_any_speed = float(betaln(k / _APART + 1.0, (n - k) / _APART + 1.0))
        weight = np.exp(each - logsumexp(each))
        z = float(weight @ _Z)
        below = speed < band.prior.at(z)
        return cls(
            next(ways_of(effect, ANY_SHIP, 0.0, 1)),
            float(logsumexp(each)) - at_any_speed,
            z,
            math.sqrt(float(weight @ (_Z - z) ** 2)),
            speed[zero],
            float(zero[below].mean()) if below.any() else 0.0,
            stretches.length_s,
        )

    @property
    def named(self) -> EffectEstimate:
        """The dead band, as probable as the zeros alone make it, whatever else there is."""
        (band,) = self.way.unknowns
        size = Parameter(band.prior.at(self.z), band.prior.slope(self.z) * self.sd)
        probability = float(expit(self.log_factor + self.way.log_odds))
        return EffectEstimate(self.way.effect.name, probability, {band.name: size})

    @property
    def note(self) -> str:
        """For the reader."""
        band = self.way.unknowns[0].prior.at(self.z)
        return (
            f'the log reads exactly 0 in {len(self.at_m_s)} stretches in which she moved over '
            f'ground, at {self.at_m_s.min():.2f} to {self.at_m_s.max():.2f} m/s: in '
            f'{100.0 * self.share:.0f} % of all below {band:.2f} m/s'
        )

    @property
    def where(self) -> Where:
        """Where it shows."""
        span = float(self.at_m_s.min()), float(self.at_m_s.max())
        return Where('log', (0.0, self.length_s), span)


def _drifts(way: NDArray[np.complex128], by_place: bool) -> bool:
    """Say whether one velocity of the water may be all that moves the ship."""
    if not by_place:
        way = np.abs(way).astype(np.complex128)
    return float(np.sqrt(np.mean(np.abs(way - way.mean()) ** 2))) < _SCATTER_M_S


def _log_likelihood(bands: Float64, speed: Float64, zero: NDArray[np.bool_]) -> Float64:
    """Return that of zeros below each band, averaged over lapses and widths, (bands,)."""
    found = []
    for lapse in _LAPSES:
        for width in _WIDTHS:
            below = expit((1.0 - speed / bands[:, None]) / width)
            chance = lapse + (1.0 - 2.0 * lapse) * below
            found.append(np.log(np.where(zero, chance, 1.0 - chance)).sum(axis=1))
    return np.asarray(logsumexp(np.array(found), axis=0) - np.log(len(found)), np.float64)
