# SPDX-License-Identifier: Apache-2.0
"""
The piece of record behind one estimate.

An estimate is a pure function of its window. The arrays are fresh, contiguous
and in the order of time, however the record was cut on the way here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shipdrag_ros.samples import (
    FURTHER,
    GEODETIC,
    MOTION_INPUTS,
    PITCHES,
    SHAFTS,
    Block,
    Channel,
    Float64,
    Int64,
    kind_of,
)

_PLANE = ('position', 'wind_apparent')  # inputs of two columns
# WGS84
_SEMI_MAJOR_M = 6378137.0
_ECCENTRICITY_2 = 6.69437999014e-3


@dataclass(frozen=True)
class Series:
    """
    Samples of one input.

    Attributes
    ----------
    time_ns : (n,) int64
        Time of measurement, strictly ascending [ns since the epoch].
    value : (n,), for a position or wind (n, 2)
    variance
        Of each value, in its unit squared; NaN where unknown.
    """

    time_ns: Int64
    value: Float64
    variance: Float64

    def __len__(self) -> int:
        return len(self.time_ns)

    def __getitem__(self, part: slice) -> Series:
        return Series(self.time_ns[part], self.value[part], self.variance[part])


@dataclass(frozen=True)
class Window:
    """
    All accepted samples between two times, both included.

    Attributes
    ----------
    start_ns, end_ns
        Bounds asked for [ns].
    speed_through_water, speed_over_ground
        [m/s].
    position
        [m] in a plane: as sent, or east and north of the first one.
    heading
        Yaw as sent [rad].
    shafts, pitches
        Rate of turn of each of `samples.SHAFTS` [rad/s] and the pitch of its
        propeller [ratio or rad]; empty where there is none.
    rudder
        Angle [rad].
    wind_apparent
        (n, 2): of the air relative to the ship, forward and to port [m/s].
    depth
        Of the water [m].
    notes
        What was left out, a sentence each.
    further
        Series of further instruments, by the name of the input; of those heard.
    geodetic
        Inputs of position that came as latitude and longitude.
    doubted_log, log_doubt
        The log most probably in a wrong scale, and that probability.
    told_ns
        When the engine was stopped, as a person told it [ns]; None where nobody did.
    found
        Whether the regimes found it: who gives a window says that she glides in it.
    before
        The record that ends where this window starts, positions in the same
        plane; None where there is none.

    Notes
    -----
    S1's problems weight the samples of an input equally, as published; the
    variances are carried for other estimators.
    """

    start_ns: int
    end_ns: int
    speed_through_water: Series
    speed_over_ground: Series
    position: Series
    heading: Series
    shafts: tuple[Series, ...]
    pitches: tuple[Series, ...]
    rudder: Series
    wind_apparent: Series
    depth: Series
    notes: tuple[str, ...] = ()
    further: Mapping[str, Series] = field(default_factory=dict)
    geodetic: frozenset[str] = frozenset()
    doubted_log: str = 'speed_through_water'
    log_doubt: float = 0.0
    told_ns: int | None = None
    found: bool = False
    before: Window | None = None

    @property
    def shaft(self) -> Series:
        """The first shaft that has been heard; empty where none has."""
        return next((shaft for shaft in self.shafts if len(shaft)), self.shafts[0])

    def series(self, name: str) -> Series:
        """
        Return an input by its name; empty of a further instrument that was not heard.
        """
        if name not in FURTHER:
            found: Series = getattr(self, name)
            return found
        if name in self.further:
            return self.further[name]
        first: Series = getattr(self, FURTHER[name])
        return first[:0]

    def each(self, *kinds: str) -> tuple[Series, ...]:
        """
        Return the series of kinds of input, the first instrument of each first.
        """
        return tuple(
            self.series(name)
            for kind in kinds
            for name in (kind, *(each for each in self.further if FURTHER[each] == kind))
        )

    def one_of_each(self) -> Window:
        """
        Return a window with one instrument of each kind: the first that was heard for long.

        A note names the others, and says what a speed reads against that of the one used.
        """
        if not self.further:
            return self
        heard = {name: self.series(name) for name in self.motion if len(self.series(name))}
        chosen: dict[str, str] = {}
        span_ns = {name: np.ptp(series.time_ns) for name, series in heard.items()}
        for kind in MOTION_INPUTS:
            of_kind = [name for name in heard if kind_of(name) == kind]
            longest = max((span_ns[name] for name in of_kind), default=0)
            long = [name for name in of_kind if 2 * span_ns[name] >= longest]
            if long:
                chosen[kind] = long[0]
        notes = []
        for name, reads in heard.items():
            which = chosen[kind_of(name)]
            used = heard[which]
            if used is reads:
                continue
            notes.append(f'{name} is not used beside {which}')
            both = (reads.time_ns >= used.time_ns[0]) & (reads.time_ns <= used.time_ns[-1])
            if reads.value.ndim == 1 and both.any():
                beside = np.median(np.interp(reads.time_ns[both], used.time_ns, used.value))
                if beside > 0.0:
                    more = float(np.median(reads.value[both]) / beside) - 1.0
                    notes[-1] += f', against which it reads {100.0 * more:+.1f} %'

        def alone(window: Window) -> Window:
            changes: dict[str, Any] = {kind: window.series(name) for kind, name in chosen.items()}
            return replace(window, further={}, **changes)

        before = None if self.before is None else alone(self.before)
        return replace(alone(self), before=before, notes=(*self.notes, *notes))

    def by_rep103(self, heading_convention: str) -> Window:
        """
        Return the same with yaw from east, anticlockwise, of whatever convention it was sent in.
        """
        if heading_convention != 'compass':
            return self
        before = None if self.before is None else self.before.by_rep103(heading_convention)
        yaw = replace(self.heading, value=0.5 * np.pi - self.heading.value)
        return replace(self, heading=yaw, before=before)

    @property
    def motion(self) -> tuple[str, ...]:
        """Inputs that show how the ship moves: the first of each kind, and others heard."""
        return (*MOTION_INPUTS, *self.further)

    def part(self, start_ns: int, end_ns: int) -> Window:
        """
        Return a part of it, both bounds included.

        The record `before` is that of the whole: it is kept where the part
        begins with the window, and left out elsewhere.
        """

        def cut(series: Series) -> Series:
            inside = slice(
                int(np.searchsorted(series.time_ns, start_ns)),
                int(np.searchsorted(series.time_ns, end_ns, side='right')),
            )
            return Series(*(each.copy() for each in vars(series[inside]).values()))

        changes: dict[str, Any] = {
            name: tuple(map(cut, found)) if isinstance(found, tuple) else cut(found)
            for name, found in vars(self).items()
            if isinstance(found, Series) or name in ('shafts', 'pitches')
        }
        changes['further'] = {name: cut(found) for name, found in self.further.items()}
        before = self.before if start_ns == self.start_ns else None
        return replace(self, start_ns=start_ns, end_ns=end_ns, before=before, **changes)

    def without(self, name: str, why: str) -> Window:
        """
        Leave out an input, in the record before too; the reason becomes a note.
        """
        none = self.series(name)[:0]
        before = None if self.before is None else self.before.without(name, why)
        changes: dict[str, Any] = {name: none}
        if name in self.further:
            changes = {'further': {**self.further, name: none}}
        changes['before'] = before
        return replace(self, **changes, notes=(*self.notes, f'without {name}: {why}'))

    @classmethod
    def from_block(
        cls, block: Block, start_ns: int, end_ns: int, *, before_ns: int | None = None
    ) -> Window:
        """
        Cut a window from accepted samples.

        Parameters
        ----------
        block
            Accepted samples in arrival order: of each input the stamps
            ascend strictly.
        start_ns, end_ns
            Bounds, both included [ns].
        before_ns
            Where the record before the window starts [ns]; None: not taken.

        Returns
        -------
        Window
            With a series of each input: stamps [ns], values [m/s, m or rad], variances.

        Raises
        ------
        ValueError
            If the stamps of an input do not ascend.

        Notes
        -----
        Of two encodings of the position the one with more samples is used,
        metres where they are equally many; a note says what was left out.
        Latitude and longitude become metres by the WGS84 radii of curvature at
        the first position, the east by the cosine of the mean latitude: the
        error is of third order, some centimetres over 10 km.

        Examples
        --------
        >>> from importlib import resources
        >>> from shipdrag_ros.ship import Ship
        >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
        >>> from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate
        >>> from shipdrag_ros.simulation import standard_sensors
        >>> scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
        >>> block = sense(simulate(ship, scenario), standard_sensors(), seed=1)
        >>> from shipdrag_ros.estimation import Window
        >>> stop_ns = START_NS + round(scenario.lead_in_s * 1e9)
        >>> end_ns = START_NS + round(scenario.length_s * 1e9)
        >>> window = Window.from_block(block, stop_ns, end_ns)
        >>> len(window.speed_through_water)
        901
        """
        inside = (block.stamp_ns >= start_ns) & (block.stamp_ns <= end_ns)

        def series(channel: Channel) -> Series:
            rows = np.flatnonzero(inside & (block.channel == channel))
            time_ns = block.stamp_ns[rows]
            if np.any(time_ns[1:] <= time_ns[:-1]):
                raise ValueError(f'{channel.name}: the stamps do not ascend strictly')
            columns = 2 if channel.kind.input in _PLANE else 1
            value, variance = block.value[rows, :columns], block.variance[rows, :columns]
            if columns == 1:
                value, variance = value.reshape(-1), variance.reshape(-1)
            return Series(time_ns, value, variance)

        def part(first_ns: int, last_ns: int) -> Window:
            return cls(
                first_ns,
                last_ns,
                series(Channel.SPEED_THROUGH_WATER),
                series(Channel.SPEED_OVER_GROUND),
                positions(Channel.POSITION),
                series(Channel.HEADING),
                tuple(map(series, SHAFTS)),
                tuple(map(series, PITCHES)),
                series(Channel.RUDDER),
                series(Channel.WIND_APPARENT),
                series(Channel.DEPTH),
                further={
                    channel.input: positions(channel) if channel in GEODETIC else series(channel)
                    for channel in further
                },
                geodetic=frozenset(origins),
            )

        since_ns = start_ns if before_ns is None else min(before_ns, start_ns)
        further = _further(block, since_ns, end_ns)
        each_position = {
            metres: (series(metres), series(degrees)) for metres, degrees in GEODETIC.items()
        }
        origins = {
            channel.input: degrees.value[0]
            for channel, (metres, degrees) in each_position.items()
            if len(degrees) > len(metres)
        }

        def positions(channel: Channel) -> Series:
            if channel.input not in origins:
                return series(channel)
            return _local_plane(series(GEODETIC[channel]), origins[channel.input])

        notes = tuple(
            f'{channel.input} came as metres ({len(metres)}) and as latitude and longitude '
            f'({len(degrees)}): the larger part was used, the other left out'
            for channel, (metres, degrees) in each_position.items()
            if len(metres) and len(degrees)
        )
        window = replace(part(start_ns, end_ns), notes=notes)
        if before_ns is None or before_ns >= start_ns:
            return window
        inside = (block.stamp_ns >= before_ns) & (block.stamp_ns < start_ns)
        return replace(window, before=part(before_ns, start_ns))


def _further(block: Block, since_ns: int, end_ns: int) -> list[Channel]:
    """Return the channels of further instruments that speak."""
    heard = (block.stamp_ns >= since_ns) & (block.stamp_ns <= end_ns)
    there = [Channel(code) for code in np.unique(block.channel[heard]).tolist()]
    found = {Channel[each.name.replace('_GEODETIC', '')] for each in there}
    return sorted(
        (each for each in found if each.input in FURTHER), key=lambda c: (c.kind, c.input)
    )


def _local_plane(geodetic: Series, origin: Float64) -> Series:
    """Turn latitude, longitude [deg] into metres east and north of an origin."""
    latitude = np.radians(geodetic.value[:, 0])
    first = float(np.radians(origin[0]))
    # the short way round, also across the date line
    turned = np.radians((geodetic.value[:, 1] - origin[1] + 180.0) % 360.0 - 180.0)
    curvature = 1.0 - _ECCENTRICITY_2 * math.sin(first) ** 2
    prime_vertical = _SEMI_MAJOR_M / math.sqrt(curvature)
    meridian = prime_vertical * (1.0 - _ECCENTRICITY_2) / curvature
    metres = np.empty_like(geodetic.value)
    metres[:, 0] = prime_vertical * np.cos(0.5 * (latitude + first)) * turned
    metres[:, 1] = meridian * (latitude - first)
    # the variances are in m^2 already, of north and east
    return Series(geodetic.time_ns, metres, np.ascontiguousarray(geodetic.variance[:, ::-1]))
