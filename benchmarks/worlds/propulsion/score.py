# SPDX-License-Identifier: Apache-2.0
"""What the program makes of one case, against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.worlds.propulsion.cases import Case
from benchmarks.worlds.propulsion.motion import ROW_S
from benchmarks.worlds.propulsion.world import Truth, World, build, inputs, seconds
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Onset
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import in_arrival_order

HELD_SHARE = 0.8
_NO_ESTIMATE: Any = SimpleNamespace(samples={})  # in the place of one
DRIVEN_S = 10.0
SURE = 0.7  # probability of a glide that is said
INPUTS: dict[str, tuple[str, ...]] = {
    'log': ('log',),
    'track': ('track',),
    'both': ('log', 'track', 'heading'),
}
SUITES = {
    **INPUTS,
    **{f'{name} + shaft': (*instruments, 'shaft') for name, instruments in INPUTS.items()},
}
FEWER = (
    ('log', 'log + shaft'),
    ('track', 'track + shaft'),
    ('both', 'both + shaft'),
    ('log', 'both'),
    ('track', 'both'),
    ('log + shaft', 'both + shaft'),
    ('track + shaft', 'both + shaft'),
)
"""Pairs of suites, the second of which has an input more."""


@dataclass(frozen=True)
class Row:
    """
    One case under one suite of inputs.

    Attributes
    ----------
    long
        Whether the glide lasts 10 min from half of the service speed or more.
    found
        Exactly one reported coastdown in the glide, with an estimate, that holds 80 % of
        it and at most 10 s of driven propeller.
    why
        What it lacks where it is not found.
    dated_s, delay_s
        Reported start, and first report, less the true end of drive; NaN without.
    wrong
        Reported coastdowns that hold more than 10 s of drive.
    idle
        Reported coastdowns that hold less, but of which half is no glide: an engine that
        is on the shaft and does not push, a ship at rest.
    wrong_live
        Onsets announced of which either is true at the time when they were.
    rms
        Of r against the truth over the valid range, relative to r's maximum; NaN without.
    sure_s
        Of what it says last of each moment about slow-downs: in how long she glides with a
        probability of 0.7 or more, how much of that it expects, in how much she does, and in how
        long besides nobody can tell a glide (`Truth.idle`) [s].
    """

    case: Case
    suite: str
    glide_s: float
    long: bool
    found: bool
    why: str
    dated_s: float
    delay_s: float
    wrong: int
    idle: int
    wrong_live: int
    rms: float
    sure_s: tuple[float, float, float, float]


def score(case: Case, suites: dict[str, tuple[str, ...]], *, spans: bool = False) -> list[Row]:
    """
    Make a case and give it to the program under each suite.

    Spans alone, without an estimate, take a tenth of the time.
    """
    world = build(case)
    given = {'estimate': None, 'final': lambda *_: _NO_ESTIMATE} if spans else {}
    return [_one(world, name, instruments, given) for name, instruments in suites.items()]


def _one(world: World, suite: str, instruments: tuple[str, ...], given: dict[str, Any]) -> Row:
    monitor = Monitor(world.ship, Parameters(update_s=60.0), **given)
    events = [
        *monitor.update(in_arrival_order(inputs(world, instruments))),
        *monitor.finish(),
    ]
    ended = [event for event in events if isinstance(event, EndedCoastdown)]
    kept = [event for event in ended if not event.withdrawn and event.estimate is not None]
    spans = [(seconds(event.start_ns), seconds(event.end_ns)) for event in kept]
    onsets = [
        (seconds(event.start_ns), seconds(event.detected_ns))
        for event in events
        if isinstance(event, Onset)
    ]
    truth = world.truth
    why, best = _lacks(truth, spans)
    glide = truth.glide or (np.nan, np.nan)
    rms = dated = delay = np.nan
    if best is not None:
        dated = spans[best][0] - glide[0]
        delay = kept[best].onset_detected_ns
        delay = np.nan if delay is None else seconds(delay) - glide[0]
        if not given:
            rms = _error(truth, kept[best].estimate)
    return Row(
        world.case,
        suite,
        glide[1] - glide[0],
        truth.glide is not None
        and glide[1] - glide[0] >= 600.0
        and truth.first_speed_m_s >= 0.5 * world.case.ship.service_m_s,
        truth.glide is not None and not why,
        why,
        dated,
        delay,
        sum(_driven_s(truth, span) > DRIVEN_S for span in spans),
        sum(_is_idle(truth, span) for span in spans),
        sum(_driven_s(truth, span) > DRIVEN_S or _is_idle(truth, span) for span in onsets),
        rms,
        _sure(truth, ended),
    )


def _sure(truth: Truth, ended: list[Any]) -> tuple[float, float, float, float]:
    """Return how long she is said to glide, of that expected and true, and how long besides."""
    said: dict[int, tuple[float, float]] = {}  # each moment once, as it was said last
    for event in ended:
        regimes = event.regimes
        if regimes is None or len(regimes.time_ns) < 2:
            continue
        rows = np.round(seconds(regimes.time_ns) / ROW_S).astype(int).tolist()
        step_s = float(np.median(np.diff(regimes.time_ns))) * 1e-9
        chances = regimes.probability['gliding'].tolist()
        said.update((row, (chance, step_s)) for row, chance in zip(rows, chances, strict=True))
    found = np.zeros(4)
    for row, (chance, step_s) in said.items():
        if chance >= SURE and 0 <= row < len(truth.gliding):
            glides, idle = bool(truth.gliding[row]), bool(truth.idle[row])
            found += step_s * np.array([not idle, not idle and chance, glides, idle])
    said_s, expected_s, true_s, idle_s = found.tolist()
    return said_s, expected_s, true_s, idle_s


def _driven_s(truth: Truth, span: tuple[float, float]) -> float:
    return float(truth.driven[_rows(span)].sum() * ROW_S)


def _rows(span: tuple[float, float]) -> slice:
    return slice(max(round(span[0] / ROW_S), 0), max(round(span[1] / ROW_S), 0))


def _is_idle(truth: Truth, span: tuple[float, float]) -> bool:
    gliding = truth.gliding[_rows(span)].sum() * ROW_S
    return _driven_s(truth, span) <= DRIVEN_S and gliding < 0.5 * (span[1] - span[0])


def _lacks(truth: Truth, spans: list[tuple[float, float]]) -> tuple[str, int | None]:
    """What is missing for a glide to count as found; which report is of it."""
    if truth.glide is None:
        return '', None
    begin, end = truth.glide
    shared = [min(end, b) - max(begin, a) for a, b in spans]
    there = [k for k, overlap in enumerate(shared) if overlap > 10.0]
    if not there:
        return 'none', None
    best = max(there, key=lambda k: shared[k])
    if len(there) > 1:
        return 'several', best
    if _driven_s(truth, spans[best]) > DRIVEN_S:
        return 'driven', best
    if shared[best] < HELD_SHARE * (end - begin):
        return 'short', best
    return '', best


def _error(truth: Truth, estimate: Estimate) -> float:
    curve = estimate.valid_curve
    if len(truth.speed) < 5 or not len(curve):
        return np.nan
    inside = (curve.speed_m_s >= truth.speed[0]) & (curve.speed_m_s <= truth.speed[-1])
    if not inside.any():
        return np.nan
    true = np.interp(curve.speed_m_s[inside], truth.speed, truth.retardation)
    off = curve.resistance_m_s2[inside] - true
    return float(np.sqrt(np.mean(off**2)) / true.max())
