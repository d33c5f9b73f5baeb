# SPDX-License-Identifier: Apache-2.0
"""
Slow-downs that no instrument explains: an engine put astern, a tug's line, power in steps.

Ships, engine, sea and instruments are made here and share nothing with the package. Of each
kind, and of true glides, it prints how many were reported, and how many of these have a
band of two sigma that holds less than half of the true r(v).

    python benchmarks/unseen_drives.py [--count 60] [--seed 1] [--inputs log both] [--jobs 1]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
import pandas as pd

import shipdrag_ros as sd

STEP_S = 0.25  # of the motion
RATE_HZ = 1.0  # of the instruments
LEAD_S = 1200.0
RECORD_S = 3600.0
KINDS = ('glide', 'astern', 'tug', 'steps')
INPUTS = {'log': ('log',), 'both': ('log', 'track')}
N_R, N_R_SD = 0.06, 0.02


@dataclass(frozen=True)
class Hull:
    """
    A ship: length [m], volume [m^3], speed [m/s], r there [m/s^2] and its wave part.
    """

    length_m: float
    volume_m3: float
    speed_m_s: float
    r_m_s2: float
    wave: float

    def r(self, speed: np.ndarray | float) -> np.ndarray | float:
        """Return the specific resistance [m/s^2] at speeds [m/s]."""
        part = np.abs(speed) / self.speed_m_s
        friction = (1.0 - self.wave) * part**1.87
        return self.r_m_s2 * np.sign(speed) * (friction + self.wave * part**5)


HULLS = {
    'coaster': Hull(82.0, 4100.0, 6.2, 0.018, 0.25),
    'bulk carrier': Hull(190.0, 47000.0, 7.2, 0.0075, 0.15),
    'ferry': Hull(38.0, 300.0, 6.0, 0.055, 0.40),
}


@dataclass(frozen=True)
class Run:
    """
    What was made: the readings, the ship file's hull, and the true r(v) [m/s^2].
    """

    frame: pd.DataFrame
    hull: Hull
    truth: Callable[[np.ndarray], np.ndarray]


def _wander(
    rng: np.random.Generator, n: int, step_s: float, sd: float, time_s: float
) -> np.ndarray:
    """Return a Gauss-Markov sequence."""
    keep = np.exp(-step_s / time_s)
    values, kicks = np.empty(n), rng.normal(size=n) * sd
    state = kicks[0]
    for i in range(n):
        state = keep * state + np.sqrt(1.0 - keep**2) * kicks[i]
        values[i] = state
    return values


def _drive(kind: str, hull: Hull, rng: np.random.Generator) -> Callable[[float, float], float]:
    """Return thrust and pull over steady thrust at seconds after the stop and u over u0."""
    fall = rng.uniform(3.0, 30.0)

    def screw(revs: float, part: float) -> float:
        # thrust of a screw that balances at revs 1, u 1 and pushes no more at u = 1.6 revs
        return (1.6 * revs**2 - revs * part) / 0.6 if revs > 0.0 else 0.0

    if kind == 'glide':
        return lambda t, part: max(0.0, 1.0 - t / fall) * part**2
    if kind == 'astern':
        wait, power = rng.uniform(10.0, 240.0), rng.uniform(0.15, 1.0)

        def astern(t: float, part: float) -> float:
            if part < 0.03:  # the telegraph goes back before she gathers way
                return 0.0
            ahead = max(0.0, 1.0 - t / fall) * part**2
            return ahead - power * float(np.clip((t - wait) / 12.0, 0.0, 1.0))

        return astern
    if kind == 'tug':
        pull = rng.uniform(0.1, 0.6)
        return lambda t, part: (
            max(0.0, 1.0 - t / fall) * part**2 - pull * min(1.0, t / 20.0) * (part > 0.03)
        )
    wait, steps = rng.uniform(60.0, 200.0), (0.8, 0.6, 0.42, 0.28, 0.0)

    def in_steps(t: float, part: float) -> float:
        at = int(t // wait)
        now = steps[min(at, 4)]
        before = 1.0 if at == 0 else steps[min(at - 1, 4)]
        revs = before + (now - before) * min(1.0, (t - at * wait) / 15.0)
        return max(screw(revs, part), -0.15 * part**2)

    return in_steps


def make(kind: str, seed: int) -> Run:
    """
    Make one record.

    Parameters
    ----------
    kind
        One of `KINDS`.
    seed
        Of the ship, the weather and the instruments.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    hull = HULLS[list(HULLS)[seed % len(HULLS)]]
    n_r = N_R + N_R_SD * float(np.clip(rng.normal(), -2.0, 2.0))
    n = int((LEAD_S + RECORD_S) / STEP_S)
    gust = _wander(rng, n, STEP_S, rng.choice([0.01, 0.03, 0.08]) * hull.r_m_s2, 90.0)
    dragged = rng.uniform(0.05, 0.35)  # the screw's drag, part of the ship as she glides
    drive = _drive(kind, hull, rng)
    u, speeds = hull.speed_m_s, np.empty(n)
    for i in range(n):
        speeds[i] = u
        t, part = i * STEP_S - LEAD_S, u / hull.speed_m_s
        thrust = 1.0 + 1.4 * (1.0 - part) if t < 0.0 else drive(t, part)
        screw = 0.0 if t < 0.0 else dragged * hull.r_m_s2 * part * abs(part) * (thrust <= 0.0)
        force = hull.r_m_s2 * thrust - float(hull.r(u)) - screw + gust[i]
        u += STEP_S * force / (1.0 + n_r)

    every = int(1.0 / RATE_HZ / STEP_S)
    log, filtered = np.empty(n), speeds[0]
    for i in range(n):
        filtered += STEP_S / 4.0 * (speeds[i] - filtered)
        log[i] = filtered
    log = log[::every]
    m = len(log)
    time_s = np.arange(m) / RATE_HZ
    log = log * (1.0 + 0.01 * rng.normal()) + _wander(rng, m, 1.0 / RATE_HZ, 0.015, 60.0)
    log = np.round((log + 0.03 * rng.normal(size=m)) / 0.01) * 0.01
    current, heading = rng.normal(size=2) * 0.15, rng.uniform(0.0, 2.0 * np.pi)
    way = np.cumsum(speeds) * STEP_S
    east = np.sin(heading) * way[::every] + current[0] * time_s
    north = np.cos(heading) * way[::every] + current[1] * time_s
    east = east + _wander(rng, m, 1.0 / RATE_HZ, 1.5, 120.0) + 0.5 * rng.normal(size=m)
    north = north + _wander(rng, m, 1.0 / RATE_HZ, 1.5, 120.0) + 0.5 * rng.normal(size=m)
    frame = pd.DataFrame({'time': time_s, 'log': log, 'east': east, 'north': north})

    def truth(speed: np.ndarray) -> np.ndarray:
        part = speed / hull.speed_m_s
        return np.asarray(hull.r(speed)) + dragged * hull.r_m_s2 * part * np.abs(part)

    return Run(frame, hull, truth)


@dataclass(frozen=True)
class Score:
    """
    Whether a run was reported, and the share of its curves inside two sigma of the truth.
    """

    kind: str
    inputs: str
    seed: int
    reported: bool
    cover: float
    bias: float


def score(kind: str, seed: int, inputs: str) -> Score:
    """
    Replay a run with the inputs and compare r(v) with the truth.
    """
    run = make(kind, seed)
    hull = run.hull
    ship = sd.Ship.from_yaml(
        f'name: {kind}\nlength_m: {hull.length_m}\ndisplaced_volume_m3: {hull.volume_m3}\n'
        f'added_mass: {{model: constant, value: {N_R}, sd: {N_R_SD}}}\n',
        subject='the ship',
    )
    columns: dict[str, object] = {'speed_through_water': 'log'}
    if inputs == 'both':
        columns['position'] = ('east', 'north')
    record = sd.read(run.frame, ship=ship, columns=columns, time='time')
    curves = [each.curve for each in record.coastdowns() if each.estimate is not None]
    if not curves:
        return Score(kind, inputs, seed, False, np.nan, np.nan)
    speed = np.concatenate([each.speed_m_s for each in curves])
    error = np.concatenate([each.resistance_m_s2 for each in curves]) - run.truth(speed)
    sigma = np.concatenate([each.sigma_m_s2 for each in curves])
    bias = float(np.median(error / run.truth(speed)))
    return Score(kind, inputs, seed, True, float(np.mean(np.abs(error) <= 2.0 * sigma)), bias)


def _score(given: tuple[str, int, str]) -> Score:
    return score(*given)


def main() -> None:
    """
    Run and print.
    """
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--count', type=int, default=60, help='runs of each kind')
    parser.add_argument('--seed', type=int, default=1, help='first seed')
    parser.add_argument('--kinds', nargs='+', default=KINDS, choices=KINDS)
    parser.add_argument('--inputs', nargs='+', default=list(INPUTS), choices=INPUTS)
    parser.add_argument('--jobs', type=int, default=1)
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.count)
    cases = [(k, s, i) for k in given.kinds for i in given.inputs for s in seeds]
    with get_context('fork').Pool(given.jobs) as pool:
        scores = list(pool.imap(_score, cases))
    print(f'{given.count} runs of each kind, seeds from {given.seed}')
    print('| kind | inputs | reported | cover below half | mean cover | median error of r |')
    print('|---|---|---:|---:|---:|---:|')
    for kind in given.kinds:
        for inputs in given.inputs:
            rows = [each for each in scores if (each.kind, each.inputs) == (kind, inputs)]
            kept = [each for each in rows if each.reported]
            below = sum(each.cover < 0.5 for each in kept)
            cover = np.mean([each.cover for each in kept]) if kept else np.nan
            bias = np.median([each.bias for each in kept]) if kept else np.nan
            print(
                f'| {kind} | {inputs} | {len(kept)} of {len(rows)} | {below} | {cover:.2f} '
                f'| {100.0 * bias:+.1f} % |'
            )


if __name__ == '__main__':
    main()
