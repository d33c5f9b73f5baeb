# SPDX-License-Identifier: Apache-2.0
"""
The experiment of the paper behind the estimator, on a simulated ship.

150 m, 20 200 m^3, from 8.2 m/s, 1500 s, n = 100, 200 .. 500 samples of log
(0.05 m/s) and radar (10 m); a yacht-like hull from 5 and from 6 knots. Draws
the paper's three figures and a fourth that it could not: sigma_r beside the
real error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from benchmarks.accuracy._coasts import CARGO, YACHT, Case, Hull, errors, read, rms, voyage
from shipdrag_ros.estimation import estimate
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Truth

mpl.use('Agg')
import matplotlib.pyplot as plt

SEED = 1
RUNS = 100
COUNTS = (100, 200, 300, 400, 500)
KNOT_M_S = 1852.0 / 3600.0
Noise = tuple[float, float]  # of log [m/s] and position [m]
NOISE: Noise = (0.05, 10.0)
YACHT_NOISE: Noise = (0.005, 0.1)
GOOD_NOISE: Noise = (0.01, 2.0)
LABELS = {'s1_position': 'position', 's1_speed': 'speed', 's1_joint': 'joint'}


def solve(
    truth: Truth,
    problem: str,
    n: int,
    *,
    seed: int = SEED,
    noise: Noise = NOISE,
) -> Estimate:
    """
    Estimate by one problem from n samples of each input.
    """
    hull = Hull('', '', np.nan, truth.scenario.duration_s, *noise)
    window = read(truth, Case(hull=hull, n=n), seed)
    return estimate(window, truth.ship, Parameters(estimator=problem))


def off(curve: ResistanceCurve, truth: Truth) -> tuple[Float64, Float64]:
    """
    Return error over the true r at the start, and sigma, evenly over a curve.
    """
    true = truth.specific_resistance(curve.speed_m_s)
    error, sigma = errors(curve, lambda speed: np.interp(speed, curve.speed_m_s, true))
    largest = float(truth.specific_resistance(truth.speed_through_water_m_s[0]))
    return error / largest, sigma / largest


def draw_orders(axes: list[Axes], truth: Truth) -> None:
    """
    Residual variance of each channel against the order.
    """
    print('s^2 over its plateau mean against the order (number of coefficients)')
    panels = (
        ('s1_position', 'variance_position', 'position alone: $s_x$'),
        ('s1_speed', 'variance_speed', 'speed alone: $s_v$'),
        ('s1_joint', 'variance_position', 'joint: $s_x$'),
        ('s1_joint', 'variance_speed', 'joint: $s_v$'),
    )
    for axis, (problem, channel, title) in zip(axes, panels):
        for n in COUNTS:
            found = solve(truth, problem, n)
            order = np.array([trial.order for trial in found.orders])
            variance = np.array([getattr(trial, channel) for trial in found.orders])
            settled = variance[order >= found.order].mean()
            axis.semilogy(order, variance / settled, '.-', label=f'n = {n}', lw=0.8)
            shown = ' '.join(f'{value / settled:.3g}' for value in variance[2:12])
            print(f'  {title:<24} n={n}: order {found.order:2d}; orders 3..12: {shown}')
        axis.set(title=title, xlabel='number of coefficients', ylim=(0.5, 100))
        axis.set_xticks(range(2, 21, 2))


def draw_hulls(axis: Axes, ship_truth: Truth, yachts: dict[str, Truth]) -> None:
    """
    Normalised r and its derivative against the Froude number.
    """
    print('Fr_max, one record each')
    slope_axis = axis.twinx()
    coasts = {'cargo ship 8.2 m/s': (ship_truth, 100, NOISE)}
    coasts |= {name: (truth, 300, YACHT_NOISE) for name, truth in yachts.items()}
    largest: dict[str, float] = {}
    for colour, (name, (truth, n, noise)) in zip(('C0', 'C1', 'C2'), coasts.items()):
        found = solve(truth, 's1_joint', n, noise=noise)
        curve = found.curve
        # S1 draws the slower run of a hull on the scale of the faster one
        hull = truth.ship.name
        largest[hull] = max(largest.get(hull, 0.0), float(curve.resistance_m_s2.max()))
        scale = largest[hull]
        axis.plot(curve.froude, curve.resistance_m_s2 / scale, colour, label=name)
        slope_axis.plot(curve.froude, curve.slope / curve.slope.max(), colour, ls=':')
        axis.axvline(found.froude_valid[1], color=colour, lw=0.6)
        print(
            f'  {name:<20} Fr_max {found.froude_valid[1]:.3f} ({found.froude_max_by.value}), '
            f'argmax dr/dFr {found.froude_max_argmax:.3f}, start Fr '
            f'{truth.ship.froude(truth.speed_through_water_m_s[0]):.3f}'
        )
    axis.set(xlabel='Fr', ylabel='r / r max', title='r (full), dr/dFr (dotted), Fr_max')


@dataclass(frozen=True)
class Stated:
    """
    What an estimate says of its error, and the error, mean of `RUNS` records [%].

    Attributes
    ----------
    largest, mean
        w = sigma_r / max r on the valid range, and over the Froude numbers.
    small
        Froude numbers between which w < 1 %, in the record of `SEED`.
    rmse, at_top
        Of r, in parts of max r.
    """

    largest: float
    mean: float
    small: tuple[float, float]
    rmse: float
    at_top: float

    @classmethod
    def of(cls, truth: Truth, problem: str, n: int, noise: Noise = NOISE) -> Stated:
        """
        Measure one problem.
        """
        largest, mean, wrong, small = [], [], [], np.zeros(0)
        for seed in range(RUNS):
            curve = solve(truth, problem, n, seed=seed, noise=noise).valid_curve
            w = curve.sigma_repeatable_m_s2 / curve.resistance_m_s2.max()
            largest.append(w.max())
            mean.append(np.trapezoid(w, curve.froude) / np.ptp(curve.froude))
            wrong.append(off(curve, truth)[0])
            if seed == SEED:
                small = curve.froude[w < 0.01]
        return cls(
            100.0 * float(np.mean(largest)),
            100.0 * float(np.mean(mean)),
            (float(small.min()), float(small.max())),
            100.0 * rms(wrong),
            100.0 * rms(np.array(wrong)[:, -1]),
        )


def draw_w(axis: Axes, truth: Truth) -> None:
    """
    Sigma_r over max r against the Froude number, n = 100.
    """
    cases = (
        ('s1_position', 100, NOISE),
        ('s1_speed', 100, NOISE),
        ('s1_joint', 50, NOISE),
        ('s1_joint', 100, NOISE),
        ('s1_speed', 500, NOISE),
        ('s1_joint', 500, NOISE),
        ('s1_speed', 100, GOOD_NOISE),
        ('s1_joint', 100, GOOD_NOISE),
    )
    print(f'w = sigma_r / max r on the valid range and the real error, mean of {RUNS} records')
    for problem, n, noise in cases:
        found = Stated.of(truth, problem, n, noise)
        if noise == NOISE and n <= 100:
            curve = solve(truth, problem, n).valid_curve
            w = curve.sigma_repeatable_m_s2 / curve.resistance_m_s2.max()
            axis.semilogy(curve.froude, w, label=f'{LABELS[problem]}, n = {n}')
        print(
            f'  {LABELS[problem]:<9} n={n:3d}, log {noise[0]} m/s, radar {noise[1]:g} m: '
            f'largest w {found.largest:.2f} %, mean over Fr {found.mean:.2f} %, '
            f'w < 1 % from Fr {found.small[0]:.3f} to {found.small[1]:.3f} (one record); '
            f'real error {found.rmse:.2f} %, at the top {found.at_top:.1f} %'
        )
    axis.axhline(0.01, color='k', lw=0.6)
    axis.set(xlabel='Fr', ylabel='w', title='w, order by the test')


def at(speeds: Float64, curve: ResistanceCurve, values: Float64) -> Float64:
    """
    Read values of a curve at speeds; NaN outside it.
    """
    inside = (speeds >= curve.speed_m_s[0]) & (speeds <= curve.speed_m_s[-1])
    return np.where(inside, np.interp(speeds, curve.speed_m_s, values), np.nan)


def draw_truth(axis: Axes, truth: Truth) -> None:
    """
    Real rms error of r over RUNS records beside the mean sigma_r.
    """
    ship = truth.ship
    largest = float(truth.specific_resistance(truth.speed_through_water_m_s[0]))
    speeds = np.linspace(float(ship.speed(0.055)), 0.99 * 8.2, 100)
    print(f'real error and sigma_r in % of max r at n = 500, {RUNS} records')
    for colour, problem in zip(('C0', 'C1', 'C2'), LABELS):
        error, stated = [], []
        for seed in range(RUNS):
            curve = solve(truth, problem, 500, seed=seed).valid_curve
            wrong = curve.resistance_m_s2 - truth.specific_resistance(curve.speed_m_s)
            error.append(at(speeds, curve, wrong))
            stated.append(at(speeds, curve, curve.sigma_repeatable_m_s2))
        real = 100.0 * np.sqrt(np.nanmean(np.square(error), axis=0)) / largest
        bias = 100.0 * np.nanmean(error, axis=0) / largest
        sigma = 100.0 * np.sqrt(np.nanmean(np.square(stated), axis=0)) / largest
        froude = ship.froude(speeds)
        axis.semilogy(froude, real, colour, label=f'{LABELS[problem]}: real error')
        axis.semilogy(froude, sigma, colour, ls='--')
        shown = [
            f'Fr {froude[i]:.2f}: {real[i]:.2f} (bias {bias[i]:+.2f}) against {sigma[i]:.2f}'
            for i in (5, 30, 60, 85, 97)
        ]
        print(f'  {LABELS[problem]:<9}', '; '.join(shown))
    axis.set(
        xlabel='Fr', ylabel='% of max r', title='real error (full), sigma_r (dashed), n = 500'
    )


def draw_bands(axis: Axes, truth: Truth) -> None:
    """
    One joint estimate with its band, thrust ending at once and running down.
    """
    print('one joint estimate, n = 500, at the top of the valid range')
    slow = voyage(Case(run_down=True))
    for colour, name, record in (('C0', 'at once', truth), ('C3', 'runs down', slow)):
        curve = solve(record, 's1_joint', 500).valid_curve
        r, sigma = curve.resistance_m_s2, curve.sigma_repeatable_m_s2
        axis.plot(curve.froude, r, colour, label=f'thrust {name}')
        axis.fill_between(curve.froude, r - 2 * sigma, r + 2 * sigma, color=colour, alpha=0.3)
        true = record.specific_resistance(curve.speed_m_s)
        print(
            f'  thrust {name}: Fr {curve.froude[-1]:.3f}, r {r[-1]:.5f} +- {sigma[-1]:.5f}, '
            f'true {true[-1]:.5f} m/s^2'
        )
    axis.plot(curve.froude, true, 'k', lw=0.8, label='true')
    axis.set(xlabel='Fr', ylabel='r, m/s^2', title='joint, n = 500, +-2 sigma_r')


def inflection(ship: Ship) -> float:
    """
    Return the Froude number of the true inflection of r.
    """
    froude = np.linspace(0.05, 0.284, 500)
    r = ship.resistance_n(ship.speed(froude)) / ship.mass_kg
    return float(froude[np.argmax(np.gradient(r, froude))])


def maxima(truth: Truth, noise: Noise) -> tuple[Float64, Float64]:
    """
    Return Fr_max where it is a significant inflection, and argmax dr/dFr, of `RUNS` records.
    """
    results = [solve(truth, 's1_joint', 300, seed=seed, noise=noise) for seed in range(RUNS)]
    found = [e.froude_valid[1] for e in results if e.froude_max_by is FroudeMax.INFLECTION]
    return np.array(found), np.array([e.froude_max_argmax for e in results])


def print_yacht(yachts: dict[str, Truth]) -> None:
    """
    Say whether Fr_max depends on the starting speed, over many records.
    """
    ship = next(iter(yachts.values())).ship
    print(
        f'yacht-like hull: true inflection at Fr {inflection(ship):.3f}; joint, n = 300, '
        f'{RUNS} records'
    )
    for log, radar in ((0.02, 1.0), YACHT_NOISE, (0.001, 0.02)):
        for name, truth in yachts.items():
            found, by_argmax = maxima(truth, (log, radar))
            where = f'at {np.mean(found):.3f} +- {np.std(found):.3f}' if len(found) else ''
            print(
                f'  {name:<12} log {log} m/s, position {radar} m: significant in '
                f'{len(found)} {where}; argmax dr/dFr {np.mean(by_argmax):.3f} +- '
                f'{np.std(by_argmax):.3f}'
            )


def coastdowns() -> tuple[Truth, dict[str, Truth]]:
    """
    Return those of the cargo ship and of the yacht.
    """
    yachts = {}
    for knots in (6, 5):
        hull = replace(YACHT, speed_m_s=knots * KNOT_M_S, duration_s=300.0)
        yachts[f'yacht {knots} kn'] = voyage(Case(hull=hull))
    return voyage(Case(hull=CARGO)), yachts


def draw(picture: Path) -> None:
    """
    Print the figures and draw the picture.
    """
    truth, yachts = coastdowns()
    speed = truth.speed_through_water_m_s
    print(
        f'{truth.ship.name}: {speed[0]:.2f} to {speed[-1]:.2f} m/s in 1500 s, largest '
        f'deceleration {-np.gradient(speed, truth.time_s).min():.4f} m/s^2; seed {SEED}'
    )
    figure, axes = plt.subplots(2, 4, figsize=(20, 9), layout='constrained')
    draw_orders(list(axes[0]), truth)
    draw_hulls(axes[1, 0], truth, yachts)
    draw_w(axes[1, 1], truth)
    draw_truth(axes[1, 2], truth)
    print_yacht(yachts)
    draw_bands(axes[1, 3], truth)
    for axis in axes.flat:
        axis.legend(fontsize=7)
    figure.savefig(picture, dpi=60)
