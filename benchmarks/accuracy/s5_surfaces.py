# SPDX-License-Identifier: Apache-2.0
"""
S5: polynomial surfaces of hydrodynamic coefficients, and their degree.

    python -m benchmarks.figures s5_surfaces

The paper's tables beside the same figures recomputed; how surely the degree of
its c_x surface comes back, by grid and noise; what other rules choose; what a
surface says outside its data; and how fast it is evaluated. `--pictures` draws
those of docs/s5_surfaces.md.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from timeit import repeat

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.polynomial.polynomial import polyval2d

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import titled, write_csv
from shipdrag_ros.report.drawing import STYLE, save
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.least_squares import OrderTable, least_squares
from shipdrag_ros.studies.surface.face.verb import contour_picture, degree_picture
from shipdrag_ros.studies.surface.fit import (
    SIGNIFICANCE,
    Surface,
    fit_surface,
    monomials,
    terms_up_to,
)

PICTURES = ROOT / 'docs' / 'pictures'
TABLE = ROOT / 'docs' / 'data' / 'c_x.csv'  # a draw to try the verb on
NOISE = 1e-4
GRIDS = (17, 13, 11, 9, 7, 6, 5)
NOISES = (1e-4, 3e-4, 1e-3, 3e-3)
SEED = 5
ANGLES = ('alpha', 'beta')
Rule = Callable[[OrderTable], int]
PUBLISHED = {  # of c_x at 1 m/s, angles in degrees
    (0, 0): 0.0680 + 3.57e-3,
    (1, 0): -3.543e-5,
    (2, 0): -6.155e-5,
    (0, 2): -2.005e-5,
    (3, 0): -1.204e-8,
    (4, 0): 1.431e-11,
    (2, 2): 5.283e-11,
    (0, 4): -8.756e-12,
}
# degree, SSE, RMSE as the paper prints them
M_X = ((3, 0.002438, 0.002956), (4, 6.776e-5, 0.0004973), (5, 6.506e-5, 0.0004927))
CHOSEN = {
    'c_x': (4, 2.03e-5, 0.0002939),
    'c_y': (3, 0.0441, 0.01257),
    'c_z': (3, 0.1141, 0.02022),
    'm_x': (4, 6.776e-5, 0.0004973),
    'm_y': (3, 0.0006829, 0.001564),
    'm_z': (3, 0.003299, 0.003439),
}


def c_x(points: Float64) -> Float64:
    """
    Return the published c_x at 1 m/s; angles in degrees.
    """
    powers = np.array(list(PUBLISHED))
    return monomials(points, powers) @ np.array(list(PUBLISHED.values()))


def grid(count: int) -> Float64:
    """
    Return count x count points over +-90 degrees.
    """
    angles = np.linspace(-90.0, 90.0, count)
    return np.stack(np.meshgrid(angles, angles), axis=-1).reshape(-1, 2)


def draws(count: int, noise: float, runs: int) -> list[Surface]:
    """
    Fit surfaces to noisy draws of c_x.
    """
    points = grid(count)
    rng = np.random.default_rng([SEED, count, round(1e7 * noise)])
    truth = c_x(points)
    return [
        fit_surface(points, truth + noise * rng.normal(size=len(truth)), inputs=ANGLES)
        for _ in range(runs)
    ]


def terms(degree: int) -> int:
    """
    Return how many terms a surface over two angles has.
    """
    return len(terms_up_to(degree, [degree, degree]))


def of_step(result: OrderTable, i: int) -> tuple[str, str]:
    """
    Return F and p of a step to a degree; of the first there is none.
    """
    return ('', '') if i == 0 else (f'{result.f[i]:.3g}', f'{result.p[i]:.2g}')


def paper_tables() -> Iterator[str]:
    """
    Recompute what can be from the paper's tables.
    """
    sizes = [terms(degree) for degree, _, _ in M_X]
    found = OrderTable.of(sizes, [sse for _, sse, _ in M_X], rows=17 * 17)

    def row(degree: int, sse: float, rmse: float) -> tuple[object, ...]:
        left = 289 - terms(degree)
        return degree, f'{sse:.4g}', f'{rmse:.4g}', f'{sse / rmse**2:.1f}', left

    heads = ('degree', 'SSE', 'RMSE', 'SSE / RMSE²', '289 - terms')
    yield from titled(
        'Table 1 of the paper, m_x',
        (*heads, 'terms', 'RMSE, ours', 'F', 'p'),
        [
            (*row(*M_X[i]), sizes[i], f'{np.sqrt(found.variance[i]):.4g}', *of_step(found, i))
            for i in range(len(M_X))
        ],
    )
    degree = M_X[found.plateau(significance=SIGNIFICANCE)][0]
    yield f'The paper keeps degree 4; so does our rule (p = {found.p[2]:.2g}): degree {degree}.'
    yield from titled(
        'Table 2 of the paper',
        ('', *heads),
        [(name, *row(*printed)) for name, printed in CHOSEN.items()],
    )


def published_surface(surface: Surface) -> Iterator[str]:
    """
    Show one draw: the degrees, and the coefficients beside the published ones.
    """
    result = surface.table
    yield from titled(
        'The published c_x, drawn again',
        ('degree', 'terms', 'SSE', 'RMSE', 'F', 'p'),
        [
            (
                f'**{degree}**' if degree == surface.degree else degree,
                result.coefficients[i],
                f'{result.sse[i]:.4g}',
                f'{np.sqrt(result.variance[i]):.4g}',
                *of_step(result, i),
            )
            for i, degree in enumerate(surface.degrees)
        ],
    )
    place = {tuple(each): i for i, each in enumerate(surface.polynomial.powers.tolist())}
    rows = []
    for (a, b), value in PUBLISHED.items():
        ours, sd = (each[place[a, b]] for each in (surface.coefficients, surface.sd))
        off = f'{(ours - value) / sd:+.1f}'
        rows.append((f'x^{a} y^{b}', f'{value:.4g}', f'{ours:.4g}', f'{sd:.2g}', off))
    yield from titled(
        'Its terms, x and y the angles in degrees',
        ('term', 'published', 'ours', 'sd', 'off by [sd]'),
        rows,
    )
    yield f'sd of x^3 y, which the paper prints as 3e-23: {surface.sd[place[3, 1]]:.1g}'


def shares(degrees: Sequence[int]) -> tuple[float, float, float]:
    """
    Return the parts of degrees that are too low, right and too high.
    """
    low, right = (float(np.mean(each)) for each in (np.less(degrees, 4), np.equal(degrees, 4)))
    return low, right, abs(1.0 - low - right)


def percents(parts: Sequence[float]) -> str:
    """
    Show parts in percent.
    """
    return ' / '.join(f'{100.0 * part:.1f}' for part in parts)


def power(found: dict[tuple[int, float], tuple[float, float, float]]) -> Iterator[str]:
    """
    How often which degree is chosen, by grid and noise.
    """
    yield from titled(
        'How surely the degree comes back: too low / 4 / too high in %',
        ('grid', *(f'noise {noise:g}' for noise in NOISES)),
        [
            (f'{count} x {count}', *(percents(found[count, noise]) for noise in NOISES))
            for count in GRIDS
        ],
    )


def with_speed(runs: int) -> str:
    """
    The paper's four speeds as a third input.
    """
    speeds = np.array([1.0, 3.0, 5.0, 7.0])
    points = np.vstack([np.column_stack([grid(9), np.full(81, v)]) for v in speeds])
    truth = c_x(points[:, :2]) + 3.57e-3 * (points[:, 2] - 1.0)
    rng = np.random.default_rng(SEED)
    found = [
        fit_surface(points, truth + NOISE * rng.normal(size=len(truth)), inputs=(*ANGLES, 'V'))
        for _ in range(max(runs // 10, 2))
    ]
    right = np.mean([surface.degree == 4 for surface in found])
    return (
        f'With the speed as a third input, {len(speeds)} values over 9 x 9 angles: degree 4 in '
        f'{100 * right:.0f} % of {len(found)} draws; {len(found[0].sd)} terms'
    )


def by_information(penalty: float) -> Rule:
    """
    Return the rule of least n log SSE plus a penalty a term.
    """
    return lambda t: int(np.argmin(t.rows * np.log(t.sse) + penalty * t.coefficients))


def by_fall(factor: float) -> Rule:
    """
    Return the rule that goes on while the RMSE falls below a factor of that before.
    """

    def choose(result: OrderTable) -> int:
        falls = np.sqrt(result.variance[1:] / result.variance[:-1]) < factor
        return int(np.argmin([*falls, False]))

    return choose


RULES: dict[str, Rule] = {
    f'**ours, p < {SIGNIFICANCE:g}**': lambda t: t.plateau(significance=SIGNIFICANCE),
    "the same at S1's p < 0.05": lambda t: t.plateau(),
    'AIC': by_information(2.0),
    'BIC': lambda t: by_information(np.log(t.rows))(t),
    'RMSE falls by a tenth or more': by_fall(0.9),
    'RMSE falls at all': by_fall(1.0),
}


def other_rules(runs: int) -> Iterator[str]:
    """
    What other rules choose on the same draws.
    """
    cases = ((17, 1e-4), (17, 3e-3), (7, 1e-3))
    found = [[surface.table for surface in draws(*case, runs)] for case in cases]
    yield from titled(
        'Beside other rules',
        ('rule', *(f'{count} x {count}, noise {noise:g}' for count, noise in cases)),
        [
            (name, *(percents(shares([2 + choose(each) for each in of])) for of in found))
            for name, choose in RULES.items()
        ],
    )


def outside(runs: int) -> Iterator[str]:
    """
    Error of fits inside their data and beyond, along the edge beta = 90 deg times a factor.
    """
    points = grid(17)
    truth = c_x(points)
    rng = np.random.default_rng(SEED)
    reach = (0.9, 1.0, 1.1, 1.2, 1.5)
    rows = []
    for degree in (4, 6, 8):
        errors = np.zeros((runs, len(reach)))
        powers = terms_up_to(degree, [degree, degree])
        columns = monomials(points / 90.0, powers)
        for i in range(runs):
            fit = least_squares(columns, truth + NOISE * rng.normal(size=289))
            for j, factor in enumerate(reach):
                edge = np.linspace(-factor, factor, 41)
                rim = np.column_stack([edge, np.full(41, factor)])
                off = fit.predict(monomials(rim, powers)) - c_x(90.0 * rim)
                errors[i, j] = np.mean(off**2)
        rows.append((degree, *(f'{value:.2g}' for value in np.sqrt(errors.mean(axis=0)) / NOISE)))
    heads = ('degree', *(f'{factor:g}' for factor in reach))
    yield from titled(f'Outside the data, rms error over the noise, {runs} draws', heads, rows)


def speed(surface: Surface) -> Iterator[str]:
    """
    Time of an evaluation, processor time, best of five.
    """
    points = np.random.default_rng(SEED).uniform(-90.0, 90.0, (200_000, 2))
    powers = surface.polynomial.powers
    matrix = np.zeros((5, 5))
    matrix[tuple(powers.T)] = surface.coefficients
    space: dict[str, Callable[..., Float64]] = {}
    exec(surface.source('c_x'), space)
    calls: dict[str, Callable[[], object]] = {
        'compiled': lambda: surface.polynomial(points),
        'compiled, both derivatives': lambda: surface.polynomial.gradient(points),
        'exported function on arrays': lambda: space['c_x'](*points.T),
        'numpy polyval2d, value alone': lambda: polyval2d(*points.T, matrix),
        'numpy, columns times coefficients': lambda: (
            monomials(points, powers) @ surface.coefficients
        ),
    }
    took = {}
    for name, call in calls.items():
        call()
        took[name] = min(repeat(call, number=1, timer=time.process_time)) / len(points)
    yield from titled(
        'Evaluation, degree 4 in two angles, 200 thousand points',
        ('', 'ns a point', 'over ours'),
        [(n, f'{1e9 * s:.0f}', f'{s / took["compiled"]:.1f}') for n, s in took.items()],
    )


def power_picture(found: dict[tuple[int, float], tuple[float, float, float]]) -> Figure:
    """
    Draw the share of right degrees by grid and noise.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 3.0), layout='constrained')
        axis = figure.subplots()
        for noise, marker in zip(NOISES, 'os^v'):
            right = [100.0 * found[count, noise][1] for count in GRIDS]
            axis.plot(GRIDS, right, marker=marker, label=f'noise sd {noise:g}')
        axis.axhline(95.0, color='#777777', linestyle='--')
        axis.set_xlabel('points along each angle')
        axis.set_ylabel('degree 4 chosen [%]')
        axis.legend()
    return figure


def main() -> None:
    """
    Print the tables, and draw where that is asked for.
    """
    options = asked(__doc__, runs=500, pictures=False)
    runs = options.runs
    (one,) = draws(17, NOISE, 1)
    found = {
        (count, noise): shares([surface.degree for surface in draws(count, noise, runs)])
        for count, noise in product(GRIDS, NOISES)
    }
    print(f'{runs} draws of each case, seed {SEED} with grid and noise')
    for lines in (paper_tables(), published_surface(one), power(found), [with_speed(runs)]):
        print(*lines, sep='\n')
    print(*other_rules(runs), *outside(min(runs, 100)), *speed(one), sep='\n')
    if options.pictures:
        points = grid(17)
        noisy = c_x(points) + NOISE * np.random.default_rng(SEED).normal(size=len(points))
        write_csv(TABLE, (*ANGLES, 'c_x'), np.column_stack([points, noisy]))
        save(degree_picture(one), PICTURES / 's5_degrees.png')
        save(contour_picture(one, points, 'c_x'), PICTURES / 's5_surface.png')
        save(power_picture(found), PICTURES / 's5_power.png')


if __name__ == '__main__':
    main()
