# SPDX-License-Identifier: Apache-2.0
"""
Rows of measurements, and the Gauss-Markov noise in them, whitened by a Kalman filter.

Rows say which input each is of, when, and what it reads. What disturbs a measurement is a small
linear state-space model: a gust FORCE that moves the ship
through the equation of motion, whose damping falls with the speed; slow motion of the water,
which moves the ship over ground; slow errors of the log and of the positions. Each is
Gauss-Markov of first order, and off where its size is 0. The filter is linear in the data, so
residual and columns of a design pass the same gains, and it takes uneven stamps, gaps and a noise
that is not stationary. What is known of the noise of a record is a handful of settings, a size
and a correlation time of each slow source, with their probabilities.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import FURTHER, Float64, Int64


class Input(IntEnum):
    """A kind of input of motion; its number is the code of the rows of the first of the kind."""

    SPEED_THROUGH_WATER = 0
    SPEED_OVER_GROUND = 1
    POSITION = 2

    @property
    def key(self) -> str:
        """Its name in a window, in parameters and in results."""
        return self.name.lower()


# the same as plain integers, for compiled code
LOG = int(Input.SPEED_THROUGH_WATER)
OVER_GROUND = int(Input.SPEED_OVER_GROUND)
POSITION = int(Input.POSITION)
KIND_COUNT = len(Input)
CODES = {input_.key: int(input_) for input_ in Input} | {
    name: int(Input[kind.upper()]) + KIND_COUNT * (int(name[-1]) - 1)
    for name, kind in FURTHER.items()
}
"""Of the rows of each instrument: its kind, and `KIND_COUNT` times how many are before it."""


class Rows(NamedTuple):
    """
    Measurements in ascending time.

    Attributes
    ----------
    time_s : (n,)
        After the engine stop, as far as that is known, or of the record.
    kind : (n,)
        Of `CODES`; LOG, OVER_GROUND or POSITION modulo `KIND_COUNT`.
    value : (n,)
        [m/s], or the distance along the track [m].
    """

    time_s: Float64
    kind: Int64
    value: Float64

    def of(self, kind: int) -> NDArray[np.bool_]:
        """
        Say which rows are of a kind, of any instrument.
        """
        result: NDArray[np.bool_] = self.kind % KIND_COUNT == kind
        return result


def bin_means(time_s: Float64, value: Float64, edges: Float64) -> tuple[Float64, Float64, Int64]:
    """
    Average samples over bins; a bin without any is left out.

    Parameters
    ----------
    time_s : (n,)
        In any order, n >= 1.
    value : (n, ...)
    edges : (b,)
        Ascending.

    Returns
    -------
    time_s, value, count : (k,), (k, ...), (k,)
    """
    order = np.argsort(time_s, kind='stable')
    cell = np.searchsorted(edges, time_s[order])
    first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    count = np.diff(np.concatenate([first, [len(order)]]))
    total = np.add.reduceat(value[order], first, axis=0)
    mean = (total.T / count).T
    return np.add.reduceat(time_s[order], first) / count, mean, count


@compiled
def block_medians(value: Float64, edges: Int64) -> Float64:
    """
    Return the medians of parts of a record.

    Parameters
    ----------
    value : (n,)
    edges : (b + 1,)
        Where each part begins, and the end of the last; none is empty.

    Returns
    -------
    (b,)
    """
    result = np.empty(len(edges) - 1)
    for i in range(len(result)):
        result[i] = np.median(value[edges[i] : edges[i + 1]])
    return result


MAD_TO_SD = 1.482602218505602
"""Standard deviation of normal noise over the median of its size."""


OUTLIER = 5.0
"""Robust standard deviations, from which a reading is none of what is looked at."""


# speed through still water and distance over ground, then the sources; behind them the errors of
# further instruments, two a number
_U, _X, _GUST, _WATER, _LOG, _PLACE = range(6)
_OWN = 2
_STATES = 6 + _OWN * 2
_LONGEST_STEP_S = 30.0  # of the prediction through a gap, in which the damping is even


class GaussMarkovNoise(NamedTuple):
    """
    Slow noise: standard deviation and correlation time of each source; a size of 0: none.

    Attributes
    ----------
    gust_m_s2, gust_s
        A force over the mass.
    water_m_s, water_s
        Motion of the water along the track.
    log_m_s, log_s
        Error of each log; of each speed over ground where there is no log.
    place_m, place_s
        Error of the positions, of each instrument by itself.
    """

    gust_m_s2: float = 0.0
    gust_s: float = 60.0
    water_m_s: float = 0.0
    water_s: float = 600.0
    log_m_s: float = 0.0
    log_s: float = 60.0
    place_m: float = 0.0
    place_s: float = 60.0


WHITE = GaussMarkovNoise()


class Noise(NamedTuple):
    """
    What is not motion in rows of measurements.

    Attributes
    ----------
    variance : (n,)
        Of the white noise of each row.
    slow
        In its stationary state at the first row.
    damping_1_s, inertia : (n,)
        dr/dv over 1 + n_r, and 1 + n_r, at each row. Fixed before a fit: the
        weights must not depend on what is fitted.
    """

    variance: Float64
    slow: GaussMarkovNoise
    damping_1_s: Float64
    inertia: Float64


# what a step does, in this order; then decay and added variance of each source
_U_BY_U, _U_BY_GUST, _X_BY_U, _X_BY_GUST, _X_BY_WATER, _UU, _UX, _XX, _UG, _XG, _DECAYS = range(11)
_STEP = _DECAYS + 2 * (_STATES - _GUST)
_NODES = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))  # of Gauss and Legendre, on 0 .. 1
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
_APART = 1e-4  # of decay rates times the step: closer ones are taken as so far apart


@compiled(inline=True, uncounted=True)
def _response(a: float, b: float, by_a: float, by_b: float) -> tuple[float, float]:
    """Return speed and distance, by a force that decays at b, by what is gone of 1 at a and b."""
    return (by_a - by_b) / (a - b), (by_b / b - by_a / a) / (a - b)


@compiled
def _sizes(slow: GaussMarkovNoise, kinds: Int64) -> Float64:
    """Return the size of each source; 0 of instruments that there are not."""
    size = np.zeros(_STATES - _GUST)
    size[:4] = slow.gust_m_s2, slow.water_m_s, slow.log_m_s, slow.place_m
    for kind in kinds:
        number, is_place = kind // KIND_COUNT, kind % KIND_COUNT == POSITION
        if number > 0:
            size[2 + _OWN * number + is_place] = size[2 + is_place]
    return size


@compiled(inline=True, uncounted=True)
def _fill_step(
    slow: GaussMarkovNoise,
    size: Float64,
    damping: float,
    inertia: float,
    dt: float,
    step: Float64,
) -> None:
    """Fill in what a step does to the states."""
    time_s = (slow.gust_s, slow.water_s, slow.log_s, slow.place_s)
    for k in range(_STATES - _GUST):
        if size[k] > 0.0:
            decay = math.exp(-dt / time_s[k if k < 4 else 2 + k % _OWN])
            step[_DECAYS + 2 * k] = decay
            step[_DECAYS + 2 * k + 1] = size[k] ** 2 * (1.0 - decay * decay)
    gone = -math.expm1(-damping * dt)
    step[_U_BY_U], step[_X_BY_U] = 1.0 - gone, gone / damping
    step[_X_BY_WATER] = 0.5 * dt * (1.0 + step[_DECAYS + 2])
    if size[0] > 0.0:
        b = 1.0 / slow.gust_s
        a = damping if abs(damping - b) * dt > _APART else b + _APART / dt
        step[_UU : _XG + 1] = 0.0
        # what the force does that comes up within the step
        for node, weight in zip(_NODES, _WEIGHTS):
            by_a, by_b = -math.expm1(-a * node * dt), -math.expm1(-b * node * dt)
            speed, way = _response(a, b, by_a, by_b)
            speed, way = speed / inertia, way / inertia
            part = weight * dt * 2.0 * b * slow.gust_m_s2**2
            step[_UU] += part * speed * speed
            step[_UX] += part * speed * way
            step[_XX] += part * way * way
            step[_UG] += part * speed * (1.0 - by_b)
            step[_XG] += part * way * (1.0 - by_b)
            if node == 0.5:
                speed, way = _response(a, b, by_a * (2.0 - by_a), by_b * (2.0 - by_b))
                step[_U_BY_GUST], step[_X_BY_GUST] = speed / inertia, way / inertia


@compiled(inline=True, uncounted=True)
def _move(lines: Float64, step: Float64, place: Int64) -> None:
    """Carry speed and distance, lines of a matrix, over a step."""
    u, x, gust, water = place[_U], place[_X], place[_GUST], place[_WATER]
    for c in range(lines.shape[1]):
        speed, force = lines[u, c], lines[gust, c]
        lines[x, c] += (
            step[_X_BY_U] * speed + step[_X_BY_GUST] * force + step[_X_BY_WATER] * lines[water, c]
        )
        lines[u, c] = step[_U_BY_U] * speed + step[_U_BY_GUST] * force


@compiled(inline=True, uncounted=True)
def _predict(cov: Float64, mean: Float64, step: Float64, place: Int64, moved: bool) -> None:
    """Carry covariance and means over a step, F P F' + Q."""
    off = len(cov) - 1
    if moved:
        _move(mean, step, place)
        _move(cov, step, place)
        _move(cov.T, step, place)
    for k in range(_STATES - _GUST):
        s = place[_GUST + k]
        if s == off:
            continue
        decay = step[_DECAYS + 2 * k]
        for c in range(mean.shape[1]):
            mean[s, c] *= decay
        for other in range(off):
            cov[s, other] *= decay
        for other in range(off):
            cov[other, s] *= decay
        cov[s, s] += step[_DECAYS + 2 * k + 1]
    if place[_GUST] < off:
        _add_force(cov, step, place)


@compiled(inline=True, uncounted=True)
def _add_force(cov: Float64, step: Float64, place: Int64) -> None:
    """Add what a force that comes up within the step does to speed and distance."""
    u, x, gust = place[_U], place[_X], place[_GUST]
    cov[u, u] += step[_UU]
    cov[x, x] += step[_XX]
    cov[u, x] += step[_UX]
    cov[u, gust] += step[_UG]
    cov[x, gust] += step[_XG]
    cov[x, u], cov[gust, u], cov[gust, x] = cov[u, x], cov[u, gust], cov[x, gust]


@compiled
def _places(size: Float64) -> tuple[Int64, int]:
    """Number the states that are disturbed; the others share one place behind, always 0."""
    moved = size[0] > 0.0 or size[1] > 0.0
    place = np.full(_STATES, -1)
    active = 0
    for s in range(_STATES):
        if moved if s < _GUST else size[s - _GUST] > 0.0:
            place[s] = active
            active += 1
    place[place < 0] = active
    return place, active


@compiled
def _stationary(noise: Noise, size: Float64, place: Int64, active: int) -> Float64:
    """Return the covariance of the states before the first row."""
    slow, damping, inertia = noise.slow, noise.damping_1_s[0], noise.inertia[0]
    cov = np.zeros((active + 1, active + 1))
    for k in range(_STATES - _GUST):
        s = place[_GUST + k]
        cov[s, s] = size[k] ** 2
    if slow.gust_m_s2 > 0.0:
        u, gust = place[_U], place[_GUST]
        cov[u, gust] = cov[gust, gust] / inertia / (damping + 1.0 / slow.gust_s)
        cov[gust, u] = cov[u, gust]
        cov[u, u] = cov[u, gust] / inertia / damping
    return cov


@compiled
def whiten(rows: Rows, table: Float64, noise: Noise) -> float:
    """
    Whiten, in place, residual and columns of a design.

    Parameters
    ----------
    rows
        In ascending time.
    table : (c, n)
        Residual and columns of the design.
    noise
        Of the rows.

    Returns
    -------
    float
        Logarithm of the determinant of the covariance of the rows.
    """
    variance, slow, damping, inertia = noise
    columns, n = table.shape
    log_det = 0.0
    if slow.gust_m_s2 == slow.water_m_s == slow.log_m_s == slow.place_m == 0.0:
        weights = 1.0 / np.sqrt(variance)
        for c in range(columns):
            for i in range(n):
                table[c, i] *= weights[i]
        for i in range(n):
            log_det += np.log(variance[i])
        return log_det
    moved = slow.gust_m_s2 > 0.0 or slow.water_m_s > 0.0
    size = _sizes(slow, rows.kind)
    place, active = _places(size)
    unlogged = not np.any(rows.kind % KIND_COUNT == LOG)
    cov, mean = _stationary(noise, size, place, active), np.zeros((active + 1, columns))
    innovation = np.empty(columns)
    gain, seen, step = np.zeros(active), np.zeros(active + 1), np.zeros(_STEP)
    last_dt, last_mid, last_inertia = -1.0, -1.0, -1.0
    for i in range(n):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            if dt > 0.0:
                parts = int(np.ceil(dt / _LONGEST_STEP_S)) if moved else 1
                mid = 0.5 * (damping[i] + damping[i - 1])
                if dt != last_dt or mid != last_mid or inertia[i] != last_inertia:
                    _fill_step(slow, size, mid, inertia[i], dt / parts, step)
                    last_dt, last_mid, last_inertia = dt, mid, inertia[i]
                for _ in range(parts):
                    _predict(cov, mean, step, place, moved)
        # what is measured, and the error of its input
        kind, own = rows.kind[i] % KIND_COUNT, _OWN * (rows.kind[i] // KIND_COUNT)
        first, error, other = place[_X], place[_PLACE + own], active
        if kind == LOG:
            first, error = place[_U], place[_LOG + own]
        elif kind == OVER_GROUND:
            first, error = place[_U], place[_WATER]
            other = place[_LOG + own] if unlogged else active
        for s in range(active):
            seen[s] = cov[s, first] + cov[s, error] + cov[s, other]
        total = seen[first] + seen[error] + seen[other] + variance[i]
        weight = 1.0 / np.sqrt(total)
        log_det += np.log(total)
        for s in range(active):
            gain[s] = seen[s] / total
        # line after line, so that it is vectorised
        for c in range(columns):
            innovation[c] = table[c, i] - mean[first, c] - mean[error, c] - mean[other, c]
            table[c, i] = innovation[c] * weight
        for s in range(active):
            of_state = gain[s]
            for c in range(columns):
                mean[s, c] += of_state * innovation[c]
        for a in range(active):
            for b in range(active):
                cov[a, b] -= gain[a] * seen[b]
    return log_det


# Parameters of a setting, all logarithms: size and time of gust, water, log, place; factors of
# the white sd of each input; hold of the engine.
SOURCES = 4
WHITE_OF = 2 * SOURCES
HOLD = WHITE_OF + KIND_COUNT
SIZE = HOLD + 1


class Settings(NamedTuple):
    """
    Choices of all sizes, with their probabilities; the most probable first.

    Attributes
    ----------
    slow : (s, 8)
        Fields of `GaussMarkovNoise`.
    white : (s, 3)
        Factor of the white standard deviation of each input.
    hold : (s,)
        Of the damping before the stop, over that of the hull.
    weight : (s,)
        Summing to 1.
    """

    slow: Float64
    white: Float64
    hold: Float64
    weight: Float64


@compiled
def noise_of(settings: Settings, which: int, rows: Rows, white: Noise, steady: int) -> Noise:
    """
    Return the noise of rows in a setting.

    Parameters
    ----------
    settings, which
    rows
    white
        As samples show it, and how the hull damps.
    steady
        How many of the rows are before the stop.
    """
    n = len(rows.kind)
    variance, damping = np.empty(n), white.damping_1_s.copy()
    for i in range(n):
        variance[i] = white.variance[i] * settings.white[which, rows.kind[i] % KIND_COUNT] ** 2
    for i in range(steady):
        damping[i] *= settings.hold[which]
    s = settings.slow[which]
    slow = GaussMarkovNoise(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
    return Noise(variance, slow, damping, white.inertia)


@dataclass(frozen=True)
class NoisePosterior:
    """
    What is known of the noise of a record.

    Attributes
    ----------
    settings
    learnt
        False where nothing could be learnt: these are the settings of the prior.
    """

    settings: Settings
    learnt: bool

    @property
    def typical(self) -> Settings:
        """The one setting that comes nearest to all: mean squares of sizes, middle times."""
        weight = self.settings.weight
        slow = np.empty(2 * SOURCES)
        slow[::2] = np.sqrt(weight @ self.settings.slow[:, ::2] ** 2)
        slow[1::2] = np.exp(weight @ np.log(self.settings.slow[:, 1::2]))
        return Settings(
            slow[None],
            np.sqrt(weight @ self.settings.white**2)[None],
            np.exp(weight @ np.log(self.settings.hold))[None],
            np.ones(1),
        )

    @property
    def slow(self) -> GaussMarkovNoise:
        """Sizes and times of the typical setting."""
        return GaussMarkovNoise(*self.typical.slow[0].tolist())
