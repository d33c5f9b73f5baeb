# SPDX-License-Identifier: Apache-2.0
"""
Whether the band of r(v) holds the truth where the log reads a few per cent wrong.

    python -m benchmarks.accuracy.log_scale --count 30 --seed 0
    python -m benchmarks.accuracy.log_scale --count 30 --live

The same coastdowns, in gusts and with a log that wanders, with a log that reads 0, 1, 2 or 3 % too
much on the hull of the ship file, and with one whose scale is drawn from the prior on a hull whose
friction and waves are drawn from what the file states. Root mean square error of r in parts of it,
and the share of the speeds at which two standard deviations hold it; from the log alone, and with
positions, which show the scale; with the baseline of the file and without.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship, StatedEffect
from shipdrag_ros.simulation import START_NS, GaussMarkov, Scenario, Sensor, sense, simulate

CONFIG = Path(__file__).parents[2] / 'config'
HULLS = (('vitus_bering', 8.2, 1500.0), ('kvlcc2', 7.97, 1800.0))  # speed [m/s], coastdown [s]
LEAD_S, RATE_HZ, WIDE = 1800.0, 0.5, 1.96
SCALES: tuple[float | None, ...] = (0.0, 0.01, 0.02, 0.03, None)  # None: drawn
DRAWN_SD = 0.02
INPUTS = {'log alone': 1, 'log, position': 2}


def errors(
    number: int, seed: int, scale: float | None, inputs: int, *, live: bool, baseline: bool
) -> tuple[Float64, Float64]:
    """
    Return the error of r over r, and over its standard deviation, at speeds of the valid range.

    Raises
    ------
    EstimationError
        If it cannot be estimated.
    """
    rng = np.random.default_rng([seed, number])
    name, speed_m_s, duration_s = HULLS[number % len(HULLS)]
    # the air at rest is part of the ship's resistance, over ground: none, for one truth
    ship = replace(Ship.load(CONFIG / f'{name}.yaml'), air=None)
    stated = ship if baseline else replace(ship, baseline=None)
    if scale is None:
        ship = drawn_hull(ship, rng)
    largest = float(ship.resistance_n(speed_m_s)) / ship.mass_kg
    gust = 0.012 * largest * math.exp(0.6 * rng.standard_normal()) * ship.mass_kg
    scenario = Scenario(
        speed_m_s=speed_m_s,
        lead_in_s=LEAD_S,
        duration_s=duration_s,
        gust_force=GaussMarkov(gust, 150.0 * math.exp(0.6 * rng.standard_normal())),
        seed=int(rng.integers(2**31)),
    )
    wander = GaussMarkov(0.02 * math.exp(0.6 * rng.standard_normal()), rng.uniform(20.0, 200.0))
    drawn = DRAWN_SD * float(rng.standard_normal())
    factor = Parameter(drawn if scale is None else scale)
    truth = simulate(ship, scenario, effects=[StatedEffect('log_scale', {'factor': factor})])
    sensors = [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=RATE_HZ, sd=0.05, coloured=wander),
        Sensor(channel=Channel.POSITION, rate_hz=RATE_HZ, sd=5.0),
    ]
    block = sense(truth, sensors[:inputs], seed=int(rng.integers(2**31)))
    stop_ns = START_NS + round(LEAD_S * 1e9)
    end_ns = stop_ns + round(duration_s * 1e9)
    window = Window.from_block(block, stop_ns, end_ns, before_ns=START_NS)
    curve = (estimate if live else estimate_final)(window, stated, Parameters()).valid_curve
    top = min(curve.speed_m_s[-1], ship.baseline_range_m_s[1])
    speed = np.linspace(curve.speed_m_s[0], top, 50)
    r, sd = (
        np.interp(speed, curve.speed_m_s, each)
        for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
    )
    true = np.asarray(ship.resistance_n(speed)) / ship.mass_kg
    return (r - true) / true, (r - true) / sd


def drawn_hull(ship: Ship, rng: np.random.Generator) -> Ship:
    """
    Return the ship with friction and waves drawn as the file states them.
    """
    base = ship.baseline
    assert isinstance(base, CoefficientBaseline)
    more, of_wave = rng.standard_normal(2)
    friction = 1.0 + base.relative_sd.friction * more
    wave = 1.0 + base.relative_sd.wave * of_wave
    drawn = replace(
        base,
        form_factor=friction * (1.0 + base.form_factor) - 1.0,
        correlation_allowance=friction * base.correlation_allowance,
        wave_coefficient=tuple(wave * each for each in base.wave_coefficient),
    )
    return replace(ship, baseline=drawn)


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Simulate, estimate, print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--count', type=int, default=30, help='coastdowns of each scale')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--live', action='store_true', help='as while a coastdown runs')
    parser.add_argument('--no-baseline', action='store_true', help='length and volume alone')
    options = parser.parse_args(arguments)
    how = {'live': options.live, 'baseline': not options.no_baseline}
    print(f'N = {options.count}, seed {options.seed}, {how}')
    print('| inputs | scale of the log | RMSE of r | cover | failed |')
    print('| --- | --- | --- | --- | --- |')
    for name, inputs in INPUTS.items():
        for scale in SCALES:
            found = []
            for number in range(options.count):
                try:
                    found.append(errors(number, options.seed, scale, inputs, **how))
                except EstimationError:
                    continue
            relative, sds = np.array(found).transpose(1, 0, 2)
            rmse = 100.0 * float(np.sqrt(np.mean(relative**2)))
            cover = float(np.mean(np.abs(sds) < WIDE))
            said = 'drawn, sd 2 %' if scale is None else f'{100.0 * scale:g} %'
            failed = options.count - len(found)
            print(f'| {name} | {said} | {rmse:.2f} % | {cover:.2f} | {failed} |', flush=True)


if __name__ == '__main__':
    main()
