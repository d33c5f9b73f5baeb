# SPDX-License-Identifier: Apache-2.0
"""
Log and track vouch for each other: do all of them still measure the ship?

The last minute of every speed is compared under these hypotheses, by Bayes' rule: some of
the sources measure one ship, and log and ground differ by a current; the others say nothing
about her, or she is in them in a wrong scale, which the whole record shows. Each is a mixture of
Gaussians of fixed covariance, so that an evidence is a sum.

Shafts that the regimes find to contradict the motion, that stick or that cease are told here too:
in steady sailing, in which no regimes follow them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import cache, lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown import numbers as v
from shipdrag_ros.coastdown.bins import (
    COUNT,
    PER_UNIT,
    RANK,
    SOURCES,
    A,
    Bins,
    mean_speeds,
    mean_turning,
    smoothing,
    unread,
)
from shipdrag_ros.coastdown.events import EndedCoastdown, Event, NoEstimate, NotCoastdown
from shipdrag_ros.coastdown.past import FIRST_TRACK, NEVER
from shipdrag_ros.coastdown.regimes.numbers import SHAFT_SD
from shipdrag_ros.coastdown.scales import EDGES, Scaled, log_sum, means, scaled
from shipdrag_ros.compiled import compiled
from shipdrag_ros.display import mistaken_units, utc
from shipdrag_ros.estimation.run_down import STANDS_RAD_S
from shipdrag_ros.samples import (
    KIND,
    PITCHES,
    SECOND_NS,
    SHAFTS,
    Block,
    Channel,
    Float64,
    Int64,
)

LOOK_S = 10  # from one look to the next
_LASTS_S, _HOLD_S = round(v.LASTS_S), round(v.HOLD_S)
_MEAN_S, _MEANS = 5, 10  # a minute
_LATE_S = 3  # that other inputs may be behind
_STUCK_LOOK_S = 60  # from one look for a shaft that sticks to the next
_AGREE_M_S = 0.4  # where all means are as near, the first hypothesis holds: need not be computed
_NOISES = (v.NOISE, v.NOISE, v.TRACK_NOISE)  # each kind has its own
_WRONG_SHARE = (v.WRONG_LOG, *[v.WRONG_FIX] * 3)
_IN_A_SCALE = (v.SCALED_LOG, *[v.SCALED_FIX] * 3)
_FEW, _MOST_WRONG = 4, 2  # of more sources than a few, so many at most say nothing of her

_KIND, _RANK = KIND.tolist(), RANK.tolist()
_LOG, _METRES = int(Channel.SPEED_THROUGH_WATER), int(Channel.POSITION)
_KM = Scaled(_MEANS * math.log(1e3), 1e-3, _MEAN_S * _MEANS)
_SAME, _WHITE = np.ones((_MEANS, _MEANS)), np.eye(_MEANS)
_TIME_S = _MEAN_S * np.arange(_MEANS, dtype=np.float64)
_WALK = np.minimum.outer(_TIME_S, _TIME_S)
_TURN = np.exp(-0.5 * (np.subtract.outer(_TIME_S, _TIME_S) / v.SWING_S) ** 2)
_OWN = v.SLOW**2 * (_SAME + 0.25 * _TURN)  # what an instrument errs by, sound or not
SpeedMixture = tuple[Float64, Float64]  # precisions, and logarithms of their factors


def _mixture(parts: list[tuple[Float64, float]]) -> SpeedMixture:
    """Return a mixture of Gaussians, of a covariance and a weight each."""
    covariance = np.array([each for each, _ in parts])
    size = covariance.shape[-1] * math.log(2.0 * math.pi) + np.linalg.slogdet(covariance)[1]
    return np.linalg.inv(covariance), np.log([weight for _, weight in parts]) - 0.5 * size


@lru_cache
def _nothing() -> SpeedMixture:
    return _mixture(
        [
            (level**2 * _SAME + wander**2 * _WALK + jump**2 * _WHITE + _OWN, a * b * c)
            for (level, a), (wander, b), (jump, c) in product(v.ANYWHERE, v.WANDERS, v.JUMPS)
        ]
    )


@lru_cache
def _own(kind: int) -> SpeedMixture:
    """Return what an instrument of a kind errs by: a log, a speed over ground or a track."""
    return _mixture([(sd**2 * _WHITE + _OWN, 1.0) for sd, _ in _NOISES[kind]])


@lru_cache
def _one_ship(counts: tuple[int, ...], length_m: float) -> SpeedMixture:
    """
    Return what so many logs, speeds over ground and tracks read that measure her.

    Of each kind the sum over the root of its number, the noises of the last kind innermost:
    how far instruments of one kind lie apart says nothing of her but how noisy they are.
    """
    parts, kinds = [], np.flatnonzero(counts)
    root = np.sqrt(np.array(counts)[kinds])
    over_ground = root * (kinds > 0)
    water = ((_SAME, 1.0 - v.TURNS), (_TURN, v.TURNS))
    apart = counts[0] and len(kinds) > 1
    currents = list(product(v.CURRENT, water)) if apart else [((0.0, 1.0), (_SAME, 1.0))]
    drift = v.DRIFTS[-1][0] ** 2 * _WALK * (len(currents) > 1)
    for (level, a), (inertia, b), ((current, c), (kind, d)) in product(
        v.LEVEL, (*v.INERTIA, (v.QUICK_M_M_S / length_m, v.QUICK)), currents
    ):
        shared = np.kron(np.outer(root, root), level**2 * _SAME + inertia**2 * _WALK)
        shared += np.kron(np.outer(over_ground, over_ground), current**2 * kind + drift)
        shared += np.kron(np.eye(len(kinds)), _OWN)
        for noises in product(*(_NOISES[each] for each in kinds)):
            own = np.kron(np.diag([sd**2 for sd, _ in noises]), _WHITE)
            weight = 2.0 * a * b * c * d * math.prod(share for _, share in noises)
            parts.append((shared + own, weight))  # 2: she sails ahead
    return _mixture(parts)


def _in_order(speeds: Mapping[int, Float64]) -> dict[int, Float64]:
    return {source: speeds[source] for source in sorted(speeds, key=_RANK.__getitem__)}


def _evidence(mixture: SpeedMixture, speed: Float64) -> float:
    return log_sum(_log_densities(*mixture, speed))


@compiled('float64[::1](float64[:, :, ::1], float64[::1], float64[::1])')
def _log_densities(precision: Float64, factor: Float64, speed: Float64) -> Float64:
    """Return of each Gaussian of a mixture its share of the density there, as a logarithm."""
    size, each = len(speed), factor.copy()
    for part in range(len(factor)):
        for row in range(size):
            along = 0.5 * precision[part, row, row] * speed[row]
            for column in range(row):
                along += precision[part, row, column] * speed[column]
            each[part] -= along * speed[row]
    return each


def _ahead(speeds: Mapping[int, Float64], craft: Craft) -> float:
    """Return the log evidence that some sources measure one ship, which sails ahead."""
    of_kinds: list[list[Float64]] = [[], [], []]
    for source, speed in speeds.items():
        track = _KIND[source] >= FIRST_TRACK
        of_kinds[0 if _KIND[source] == _LOG else 1 + track].append(speed)
    precision, factor = _one_ship(tuple(map(len, of_kinds)), craft.length_m)
    sums, scatter = [], np.zeros(())
    for kind, read in enumerate(map(np.array, of_kinds)):
        if len(read):
            own, size = _own(kind)
            off = read - read.mean(axis=0)
            apart = (len(read) - 1) * size - 0.5 * np.einsum('ji,nik,jk->n', off, own, off)
            sums.append(read.sum(axis=0) / math.sqrt(len(read)))
            scatter = np.add.outer(scatter, apart)
    factor = (factor.reshape(-1, scatter.size) + scatter.ravel()).ravel()
    return _evidence((precision, factor), np.concatenate(sums))


def _measured(speeds: Mapping[int, Float64], craft: Craft) -> float:
    """Return the log evidence that some sources measure one ship."""
    ahead = _ahead(speeds, craft)
    of_logs = {source: each for source, each in speeds.items() if _KIND[source] == _LOG}
    through = float(np.mean(list(of_logs.values()))) if of_logs else 0.0
    if through >= 0.0:
        return ahead
    # she makes way astern: over ground a speed has no sign
    pace = through / craft.slow_m_s
    rare = math.log(v.ASTERN * max(v.LEVEL[1][0] / craft.slow_m_s, 1.0)) - 0.5 * pace * pace
    astern = _ahead({**speeds, **{source: -each for source, each in of_logs.items()}}, craft)
    return min(rare, 0.0) + float(np.logaddexp(ahead, astern))


class Soundness(NamedTuple):
    """
    What each source probably is.

    Attributes
    ----------
    sets
        Probability of each set of sources to be those that measure the ship.
    scaled
        Probability of each source to be the ship in a wrong scale.
    """

    sets: dict[tuple[int, ...], float]
    scaled: dict[int, float]

    def wrong(self, source: int) -> float:
        """Return the probability that a source does not measure the ship."""
        return math.fsum(each for sound, each in self.sets.items() if source not in sound)


def sound_probabilities(
    speeds: Mapping[int, Float64],
    craft: Craft,
    *,
    doubted: Collection[int] = (),
    scales: Mapping[tuple[int, int], Scaled] | None = None,
) -> Soundness:
    """
    Return the probability of each set of sources to be those that measure the ship.

    Parameters
    ----------
    speeds : (10,) each
        Means by source [m/s], at least of two sources.
    craft
        How fast she may change her speed, and about how fast she goes astern.
    doubted
        Sources that said nothing of her just before.
    scales
        What the record says of each, the first, being another, the second, in a wrong scale.
    """
    names, found = sorted(speeds, key=_RANK.__getitem__), {}
    in_a_scale: dict[int, list[float]] = {name: [] for name in names}

    @cache
    def measured(*sound: int) -> float:
        return _measured({name: speeds[name] for name in sound}, craft)

    nothing = {name: _evidence(_nothing(), speeds[name]) for name in names}
    least = 0 if len(names) <= _FEW else len(names) - _MOST_WRONG
    sets = {
        sound for count in range(least, len(names) + 1) for sound in combinations(names, count)
    }
    kinds = [
        [one for one in names if _KIND[one] == kind] for kind in {_KIND[one] for one in names}
    ]
    sets |= {tuple(name for name in names if name not in of_kind) for of_kind in kinds}
    for sound in sorted(sets):
        part = {name: speeds[name] for name in sound}
        logs, ratio = [measured(*sound)] if sound else [], {}
        logs += [_share_of(of_kind, sound, doubted) for of_kind in kinds]
        for name in names:
            if name not in sound:
                beside = _beside(name, part, speeds[name], scales or {}, craft, measured)
                beside += math.log(_IN_A_SCALE[_KIND[name]]) - (logs[0] if sound else 0.0)
                other = math.log(1.0 - _IN_A_SCALE[_KIND[name]]) + nothing[name]
                logs.append(float(np.logaddexp(other, beside)))
                ratio[name] = beside - logs[-1]
        found[sound] = math.fsum(logs)
        for name, share in ratio.items():
            in_a_scale[name].append(found[sound] + share)
    total = float(np.logaddexp.reduce(list(found.values())))
    return Soundness(
        {sound: math.exp(each - total) for sound, each in found.items()},
        {
            name: math.exp(float(np.logaddexp.reduce(logs)) - total)
            for name, logs in in_a_scale.items()
        },
    )


def _share_of(names: list[int], sound: Collection[int], doubted: Collection[int]) -> float:
    """Return the log share of minutes in which these of a kind are wrong, alone or together."""
    shares = [v.STILL if name in doubted else _WRONG_SHARE[_KIND[name]] for name in names]
    alone = math.prod(
        1.0 - share if name in sound else share for name, share in zip(names, shares, strict=True)
    )
    right = sum(name in sound for name in names)
    together = {0: max(shares), len(names): 1.0 - max(shares)}.get(right, 0.0)
    return math.log((1.0 - v.TOGETHER) * alone + v.TOGETHER * together)


def _beside(
    name: int,
    sound: Mapping[int, Float64],
    speed: Float64,
    scales: Mapping[tuple[int, int], Scaled],
    craft: Craft,
    measured: Callable[..., float],
) -> float:
    """Return the log evidence of sound sources and of one that is the ship in a wrong scale."""
    if _KIND[name] == _METRES and sound:
        scaled_up = {**sound, name: speed / _KM.scale}
        return _KM.log_odds + _measured(_in_order(scaled_up), craft)
    found = -math.inf
    if _KIND[name] == _LOG and sound:
        found = math.log(v.REVERSED) + _measured(_in_order({name: -speed, **sound}), craft)
    # a track has no scale, and no current is between it and a speed over ground
    for other in sorted(sound, key=_RANK.__getitem__, reverse=_KIND[name] != _LOG):
        if (name, other) in scales:
            both = measured(*_in_order({**sound, name: speed}))
            return float(np.logaddexp(scales[name, other].log_odds + both, found))
    return found


class Craft(NamedTuple):
    """Length of a craft [m], and a speed at which she is slow [m/s]."""

    length_m: float
    slow_m_s: float


class Contradiction(NamedTuple):
    """
    What is said of a source until a second: why it is doubted, and what to do.
    """

    until: int
    why: str
    remedy: str

    @property
    def text(self) -> str:
        return f'{self.why}: {self.remedy}'


class Vouching:
    """
    What the sources of one monitor say of each other.

    Parameters
    ----------
    craft
        Below her slow speed nothing is compared.
    still_s
        A shaft that repeats, or is not heard, for longer says nothing.

    Attributes
    ----------
    until : (channels,) int64
        Second up to which each channel is not used; what it read before then never is.
    """

    def __init__(self, craft: Craft, still_s: float) -> None:
        self.until: Int64 = np.full(len(Channel), NEVER)
        self._craft = craft
        self._since: Int64 = np.full(len(Channel), NEVER)  # of a contradiction that goes on
        self._nothing: Int64 = np.full(len(Channel), NEVER)  # when each last said nothing of her
        self._now = NEVER
        self._said: dict[str, Contradiction] = {}
        # when it was last known of each log whether it is, and how probable
        self._scaled: dict[int, tuple[int, float]] = {}
        self._still_s = round(still_s)
        self._stuck: dict[int, str] = {}  # what is said of shafts that stick
        self._lied: dict[int, float] = {}  # revs that contradict the motion, when that was found

    @property
    def texts(self) -> dict[str, str]:
        """What to say of each input that is doubted."""
        return {name: one.text for name, one in self._said.items() if one.until > self._now}

    @property
    def ever(self) -> dict[str, str]:
        """What was last said of shafts and of unused sources; of all where there is none."""
        left, shaft = set(self.left_out), Channel.SHAFT.input
        told = {shaft} | left if left - {shaft} else self._said
        return {name: one.text for name, one in self._said.items() if name in told}

    @property
    def log_doubt(self) -> tuple[str, float]:
        """The log most probably in a wrong scale, though it is used, and that probability."""
        known = {
            Channel(log).input: doubt
            for log, (when, doubt) in self._scaled.items()
            if when > self._now - EDGES[-1] and self.until[log] <= self._now
        }
        return max(known.items(), key=lambda one: one[1], default=('', 0.0))

    @property
    def left_out(self) -> dict[str, str]:
        """The last that was said of each input that was not used."""
        return {name: one.text for name, one in self._unused(NEVER).items()}

    def _unused(self, since: int) -> dict[str, Contradiction]:
        sources = np.flatnonzero(self.until > since).tolist()
        return {name: self._said[name] for name in {Channel(each).input: None for each in sources}}

    def notes(self, start_ns: int) -> tuple[str, ...]:
        """Say of each input that is not used from a time on [ns] that it is left out, and why."""
        unused = self._unused(start_ns // SECOND_NS)
        return tuple(f'without {name}: {one.text}' for name, one in unused.items())

    def explained(self, events: list[Event]) -> list[Event]:
        """Say in what failed that an input is left out, why, and what to do."""
        unused = self._unused(self._now)
        if not unused:
            return events
        why = '; '.join(
            f'the {name.replace("_", " ")} is left out: {one.why}' for name, one in unused.items()
        )
        remedy = '; '.join(one.remedy for one in unused.values())

        def told(text: str) -> str:
            return f'{why}. By what is left, {text}. To do: {remedy}'

        def of(event: Event) -> Event:
            if isinstance(event, NotCoastdown):
                return replace(event, text=told(event.text))
            if isinstance(event, NoEstimate):
                return replace(event, reason=told(event.reason))
            if isinstance(event, EndedCoastdown):
                cuts = tuple(replace(cut, text=told(cut.text)) for cut in event.cuts)
                failure = event.failure and told(event.failure)
                return replace(event, failure=failure, cuts=cuts)
            return event

        return [of(event) for event in events]

    def sound(self, bins: Bins, *, shafts: bool = False) -> Bins:
        """
        Return bins in which the channels that are not used were never read.

        With `shafts`, those that contradict the motion stay in: the regimes judge that themselves.
        """
        doubted = self.until > self._now
        if shafts:
            doubted[_with_pitch(self._lied)] = False
        return unread(bins, doubted) if doubted.any() else bins

    def kept(self, block: Block) -> Block:
        """Return a block without what sources read up to the second since which they are used."""
        first_ns = np.maximum(self.until, NEVER // SECOND_NS) * SECOND_NS
        return block[block.stamp_ns >= first_ns[block.channel]]

    def look(self, bins: Bins, number: int, width: int, *, hold: bool) -> list[int]:
        """
        Compare the last minute.

        Parameters
        ----------
        bins
            What the monitor keeps.
        number
            The second that has begun.
        width
            Of a slope window: the speed of a track is that of some seconds ago.
        hold
            Whether something runs that was begun without the sources that are doubted.

        Returns
        -------
        list of int
            Sources that are used again from now on.
        """
        if hold:
            self.until[self.until > self._now] = number + LOOK_S + 1
        back = SOURCES[(self.until > self._now)[SOURCES] & (self.until <= number)[SOURCES]]
        self._now = number
        self._compare(bins, number, smoothing(width))
        return [int(source) for source in back if self.until[source] <= number]

    def _compare(self, bins: Bins, number: int, lag: int) -> None:
        last = number - _LATE_S - lag
        speeds = {
            source: mean
            for source in SOURCES.tolist()
            if len(mean := _means(bins, source, last + lag * (_KIND[source] >= FIRST_TRACK)))
        }
        table = np.array(list(speeds.values()))
        if len(speeds) < 2 or np.abs(table.mean(axis=1)).max() < self._craft.slow_m_s:
            return
        if float(np.ptp(table, axis=0).max()) < _AGREE_M_S:
            return
        doubted = [source for source in speeds if self.until[source] > number]
        scales = _scales(bins, speeds, last, lag, self._nothing)
        found = sound_probabilities(speeds, self._craft, doubted=doubted, scales=scales)
        logs = {one for one, _ in scales if _KIND[one] == _LOG}
        self._scaled |= {source: (number, found.scaled[source]) for source in logs}
        wrong = {source: found.wrong(source) for source in speeds}
        contradiction = found.sets[tuple(speeds)] < 1.0 - v.WRONG
        left = len(speeds) - len(doubted)
        for source, each in wrong.items():
            if source not in doubted and left < 2:
                self._since[source] = NEVER  # the others say nothing of her: it is all there is
                continue
            if source in doubted:
                lasts = each > 0.5  # as long as it is more probable than not
            else:  # a radar that takes another mark is odd for the length of its filter
                begins = NEVER if not (contradiction and each > v.UNUSED) else number
                self._since[source] = (
                    begins if NEVER in (begins, self._since[source]) else self._since[source]
                )
                lasts = begins == number >= self._since[source] + _LASTS_S
                # while a scale is known from the whole record
                lasts = lasts or found.scaled[source] > v.WRONG
            if lasts:
                left -= source not in doubted
                self.until[source] = number + _HOLD_S
            if lasts or (contradiction and each == max(wrong.values())):
                used = {other: bool(self.until[other] <= number) for other in speeds}
                if contradiction and found.scaled[source] < 0.5 * each:
                    self._nothing[source] = number
                name = Channel(source).input
                one = self._said.get(name)
                if contradiction or one is None:  # else what was said is the best that is known
                    one = _doubt(source, speeds, found, used, scales, number)
                self._said[name] = one._replace(until=number + _HOLD_S)

    def look_at_shafts(self, bins: Bins, last: int, lie: float) -> None:
        """
        Look at the last seconds of the shafts.

        Parameters
        ----------
        bins
            What the monitor keeps.
        last
            The last second that all are read in.
        lie
            Probability that they say nothing true, by the regimes; NaN where these follow none.
        """
        heard = [int(each) for each in SHAFTS if bins.closed[each] != NEVER]
        if not heard:
            return
        turning = {}
        if lie > 0.5 or self._lied:
            turning = {each: mean_turning(bins, each, last, LOOK_S)[0] for each in heard}
        why = ''
        if lie > 0.5:
            self._lied = turning
            why = (
                'the motion is not that of a ship whose shafts turn as they say (probability '
                f'{lie:.2f}); they are not used'
            )
        elif lie <= 0.5:
            self.until[_with_pitch(self._lied)] = NEVER
            self._lied = {}
        elif any(  # or reads again, where it read nothing when that was found
            not abs(turning[each] - level) <= max(STANDS_RAD_S, SHAFT_SD[0] * abs(level))
            for each, level in self._lied.items()
            if not math.isnan(turning[each])
        ):
            self._lied = {}
        if self._stuck or self._now % _STUCK_LOOK_S < LOOK_S:
            self._stuck = {
                each: said for each in heard if (said := self._sticks(bins, each, last))
            }
        unused = self._lied or self._stuck
        until = self._now + LOOK_S + 1
        self.until[_with_pitch(unused)] = until
        if not unused:
            why = '; '.join(
                f'{_shaft(each)} ceased at {utc(int(bins.filling[each]) * SECOND_NS)}'
                for each in heard
                if bins.filling[each] < last - self._still_s
            )
        elif not self._lied:
            why = '; '.join(self._stuck.values())
        elif not why:  # as it was found
            why = self._said[Channel.SHAFT.input].why
        if why:
            self._said[Channel.SHAFT.input] = Contradiction(until, why, 'check the sensor')

    def _sticks(self, bins: Bins, shaft: int, last: int) -> str:
        """Say that a sensor repeats itself which does not by its nature; '' where it does not."""
        still = _readings(bins, shaft, last, self._still_s)
        if len(still) < 2 or (still != still[-1]).any():
            return ''
        if shaft in self._stuck:
            return self._stuck[shaft]
        before = _readings(bins, shaft, last, len(bins.places[shaft]))
        before = before[: np.flatnonzero(before != still[-1])[-1:].sum() + 1]
        turning = still[-1] / PER_UNIT
        coarse = len(np.unique(before)) < v.DISTINCT * len(before)
        if abs(turning) < STANDS_RAD_S or coarse or len(before) < len(still):
            return ''
        return (
            f'{_shaft(shaft)} has read {turning:.4g} rad/s to the last digit for '
            f'{self._still_s} s and more, as it never did before; it is not used'
        )


def _shaft(channel: int) -> str:
    return f'shaft {SHAFTS.index(Channel(channel)) + 1}'


def _with_pitch(shafts: Collection[int]) -> list[int]:
    """Return the channels of some shafts."""
    both = zip(SHAFTS, PITCHES, strict=True)
    return [int(each) for pair in both if pair[0] in shafts for each in pair]


def _readings(bins: Bins, channel: int, last: int, seconds: int) -> Int64:
    """Return the means of the seconds up to one, of those that are kept and were read in."""
    totals, newest = bins.places[channel], int(bins.closed[channel])
    until = min(last, newest)
    first = max(until - seconds, newest - len(totals) + 1)
    each = np.diff(totals[np.arange(first, until + 1) & (len(totals) - 1)], axis=0)
    return np.asarray(each[each[:, COUNT] == 1, A])


def _scales(
    bins: Bins, sources: Collection[int], last: int, lag: int, nothing: Int64
) -> dict[tuple[int, int], Scaled]:
    """Say of each speed whether it is another one in a wrong scale."""
    read = {
        source: means(bins, source, last + lag * (_KIND[source] >= FIRST_TRACK))
        for source in sources
    }
    found = {}
    for one, other in combinations(read, 2):
        if _KIND[one] >= FIRST_TRACK:
            continue
        count = min(len(read[one]), len(read[other]))
        both = np.array([read[one][:count], read[other][:count]])
        # as long as she makes way ahead, through the water and faster than a current may run:
        # a speed over ground has no sign
        way = (both > 0.0).all(axis=0) & (both[1] > v.CURRENT[-1][0])
        # and since both said something of her
        way &= EDGES[1 : count + 1] <= last - nothing[[one, other]].max()
        count = count if way.all() else int(np.argmin(way))
        if count:
            found[one, other] = both_ways = scaled(*both[:, :count])
            if _KIND[other] < FIRST_TRACK:  # which of two is wrong is known beforehand alone
                found[other, one] = both_ways._replace(scale=1.0 / both_ways.scale)
    return found


def _means(bins: Bins, source: int, last: int) -> Float64:
    """Return means of the speed [m/s] up to a second; none where one is missing."""
    if bins.closed[source] < last - LOOK_S:
        return np.empty(0)
    count, speed = mean_speeds(bins, source, last - _MEAN_S * np.arange(_MEANS, -1, -1))
    return speed if count.all() else np.empty(0)


def _doubt(
    source: int,
    speeds: Mapping[int, Float64],
    found: Soundness,
    used: Mapping[int, bool],
    scales: Mapping[tuple[int, int], Scaled],
    number: int,
) -> Contradiction:
    """Say what contradicts what, who is wrong, and what to do."""
    others = [each for each in speeds if each != source]
    best = min(others, key=lambda each: (not used[each], found.wrong(each)))
    mine, other = float(speeds[source].mean()), float(speeds[best].mean())
    instead = ', which is used instead' if used[best] and not used[source] else ''
    units = mistaken_units(mine / other) if other else ''
    near = f' (near {units})' if units else ''
    alone = all(_KIND[each] >= FIRST_TRACK for each in others)
    less = '; of a speed over ground less is needed than of positions alone' if alone else ''
    why = (
        f'over a minute up to {utc(number * SECOND_NS)} it read {mine:.2f} ± '
        f'{float(speeds[source].std()):.2f} m/s, the {Channel(best).input.replace("_", " ")} '
        f'{other:.2f} ± {float(speeds[best].std()):.2f} m/s{instead}: with a probability of '
    )
    if (source, best) in scales and found.scaled[source] > 0.5 * found.wrong(source):
        scale = scales[source, best]
        return Contradiction(
            number,
            f'{why}{min(found.scaled[source], 0.99):.2f}, by {scale.span_s} s, it reads about '
            f'{scale.scale:.2f} times the speed{near}',
            'look at the unit that its driver converts from and at its calibration; if they are '
            f'right, a current of {abs(other - mine):.1f} m/s runs, which turns show{less}',
        )
    return Contradiction(
        number,
        f'{why}{min(found.wrong(source), 0.99):.2f} it says nothing of the ship{near}',
        f'look at its sensor, axis, sign and unit{less}',
    )
