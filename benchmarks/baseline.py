# SPDX-License-Identifier: Apache-2.0
"""
What a mis-stated baseline costs a diagnosis, and what five clean runs give back.

    python benchmarks/baseline.py
    python benchmarks/baseline.py --cases 40 --processes 2

Ships, sea and sensors are those of the hidden data, whose generator shares no
code with the package. Clean runs differ by 1 % of the resistance besides gusts
and slow currents; then two reciprocal runs are held against each baseline.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

# before numpy: the processes share the cores with each other alone
os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import as_block
from hidden.cases import SHAPE_RMS
from hidden.effect import Effect, Leg
from hidden.hull import SHAPE_TERMS, Hull, draw_hull
from hidden.library import Fouling, TowedCable
from hidden.recording import (
    BETWEEN_RUNS_NS,
    INPUTS,
    MOTION,
    START_NS,
    Noise,
    disturb,
    draw_noise,
    record,
)
from hidden.sailing import LEAD_IN_S, World, sail

from shipdrag_ros.diagnosis import CoastRun, Verdict, diagnose
from shipdrag_ros.diagnosis.learn_baseline import learn_baseline
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

SEED = 20261121
CLEAN_RUNS = 5
SCATTER = 0.01  # of the resistance, from run to run
WORSE = 3.0  # the baseline, than stated
HIDDEN: tuple[type[Effect] | None, ...] = (None, Fouling, TowedCable)
BASELINES = ('as stated, and it is so', 'three times worse than stated', 'the same, learnt')


@dataclass(frozen=True)
class Answer:
    """One diagnosis: what was hidden, against which baseline, what was said."""

    hidden: str
    baseline: str
    verdict: Verdict
    holds: bool
    false_name: bool


@dataclass(frozen=True)
class Sea:
    """A ship and her sensors."""

    hull: Hull
    noise: Noise
    duration_s: float
    heading_rad: float

    def run(
        self, number: int, world: World, effects: tuple[Effect, ...], *, seed: int
    ) -> CoastRun:
        """Sail and record; runs alternate between two opposite headings."""
        sign = 1.0 - 2.0 * (number % 2)
        leg = Leg(self.hull, sign, self.duration_s, self.hull.speed_m_s)
        heading = self.heading_rad + (0.0 if sign > 0.0 else math.pi)
        rng = np.random.default_rng([seed, number])
        factor = 1.0 + SCATTER * rng.standard_normal()
        own = World(
            factor * (1.0 + world.friction) - 1.0,
            factor * (1.0 + world.wave) - 1.0,
            world.shape,
            world.n_r,
            self.hull.run_down_sd * rng.standard_normal(),
        )
        motion = sail(
            leg,
            effects,
            heading_rad=heading,
            first_heading_rad=self.heading_rad,
            world=own,
            disturbance=disturb(leg, self.noise, heading, rng),
        )
        block = as_block(
            record(
                motion,
                leg,
                effects,
                number=number,
                inputs=MOTION,
                noise=self.noise,
                heading_rad=heading,
                streams=dict(zip(INPUTS, rng.spawn(len(INPUTS)), strict=True)),
            )
        )
        stop = START_NS + number * BETWEEN_RUNS_NS + round(LEAD_IN_S * 1e9)
        first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
        return CoastRun(f'run {number}', Window.from_block(block, stop, last, before_ns=first))


def case(number: int) -> tuple[list[Answer], list[float]]:
    """
    Ask about one ship; also return scatter and relative_sd of friction as learnt.
    """
    rng = np.random.default_rng([SEED, number])
    hull = draw_hull(rng)
    resistance = float(hull.still_n(np.array([hull.speed_m_s]))[0])
    slow_s = hull.speed_m_s * hull.mass_kg / resistance
    duration_s = round(float(np.clip(2.4 * slow_s, 700.0, 3600.0)))
    sea = Sea(hull, draw_noise(rng), duration_s, rng.uniform(-np.pi, np.pi))
    draws, n_r = rng.standard_normal(2), hull.n_r_sd * rng.standard_normal()
    shape = tuple(SHAPE_RMS * rng.standard_normal(SHAPE_TERMS) / np.sqrt(0.5 * SHAPE_TERMS))
    right, wrong = (
        World(worse * hull.friction_sd * draws[0], worse * hull.wave_sd * draws[1], shape, n_r)
        for worse in (1.0, WORSE)
    )
    leg = Leg(hull, 1.0, duration_s, hull.speed_m_s)
    hidden = [() if kind is None else (kind.draw(leg, rng),) for kind in HIDDEN]
    parameters = Parameters()
    stated = Ship.from_yaml(hull.ship_file(), subject='hull')
    clean = [sea.run(k, wrong, (), seed=SEED + number) for k in range(CLEAN_RUNS)]
    learnt = learn_baseline(clean, stated, parameters)
    answers = []
    for baseline, world, ship in zip(
        BASELINES, (right, wrong, wrong), (stated, stated, learnt.ship), strict=True
    ):
        for effects in hidden:
            runs = [
                sea.run(CLEAN_RUNS + 1 + k, world, effects, seed=SEED + number) for k in range(2)
            ]
            found = diagnose(runs, ship, parameters)
            names = tuple(effect.name for effect in effects)
            answers.append(
                Answer(
                    names[0] if names else 'nothing',
                    baseline,
                    found.verdict,
                    any(each.names == names for each in found.candidates),
                    found.verdict is Verdict.NAMED
                    and tuple(each.name for each in found.effects) != names,
                )
            )
    return answers, [learnt.scatter, float(learnt.relative_sd[0])]


def _case(number: int) -> tuple[list[Answer], list[float]] | str:
    try:
        return case(number)
    except Exception as error:
        return f'case {number}: {type(error).__name__}: {error}'


def table(answers: Sequence[Answer]) -> list[str]:
    """
    Return the lines of the table.
    """
    head = ('alarms, nothing hidden', 'false names, of all')
    found = [name for name in dict.fromkeys(a.hidden for a in answers) if name != 'nothing']
    lines = [
        '| baseline | ' + ' | '.join((*head, *(f'{name} found' for name in found))) + ' |',
        '|---|' + '---|' * (2 + len(found)),
    ]
    for baseline in BASELINES:
        here = [answer for answer in answers if answer.baseline == baseline]
        cells = [_share(_of(here, 'nothing'), lambda a: a.verdict is not Verdict.NONE)]
        cells.append(_share(here, lambda a: a.false_name))
        cells += [
            _share(_of(here, name), lambda a: a.verdict is not Verdict.NONE and a.holds)
            for name in found
        ]
        lines.append(f'| {baseline} | ' + ' | '.join(cells) + ' |')
    return lines


def _of(answers: Sequence[Answer], hidden: str) -> list[Answer]:
    return [answer for answer in answers if answer.hidden == hidden]


def _share(answers: Sequence[Answer], holds: object) -> str:
    assert callable(holds)
    hits, of = sum(map(holds, answers)), len(answers)
    return f'{hits / of:.0%} ({hits} of {of})'


def main() -> None:
    """
    Ask, and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--cases', type=int, default=12)
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.processes) as pool:
        done = list(pool.map(_case, range(options.cases)))
    for failure in (each for each in done if isinstance(each, str)):
        print(failure)
    kept = [each for each in done if not isinstance(each, str)]
    print(
        f'{len(kept)} ships, seed {SEED}; {CLEAN_RUNS} clean runs each that differ by '
        f'{SCATTER:.0%}; two reciprocal runs are diagnosed, with log and positions'
    )
    for line in table([answer for answers, _ in kept for answer in answers]):
        print(line)
    scatter, sd = np.median([learnt for _, learnt in kept], axis=0)
    print(f'learnt, median: scatter {scatter:.2%}, relative_sd of friction {sd:.2%}')


if __name__ == '__main__':
    main()
