# SPDX-License-Identifier: Apache-2.0
"""
What stands beside the forms of S4, a cubic with more terms and a Gaussian process; and all of
them on the Delft yacht series, with hulls and Froude numbers left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from benchmarks._tables import titled
from shipdrag_ros.report.drawing import BLUE, ORANGE, STYLE
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import FORMS, Hulls, RegressionForm, fit_form
from shipdrag_ros.studies.surface.fit import monomials, terms_up_to

WRONG = 0.15  # a prediction this far off, relative, is a bad one
SHAPES = ('L_B', 'B_T', 'C_B', 'lcb', 'Fr')
CUBE = terms_up_to(3, [3] * len(SHAPES))
CUBIC = RegressionForm(
    'cubic',
    lambda hulls: dict(
        zip(
            map(str, CUBE),
            monomials(np.column_stack([getattr(hulls, name) for name in SHAPES]), CUBE).T,
        )
    ),
    SHAPES,
)
Predictor = Callable[[Hulls], Float64]


def gauss(hulls: Hulls, values: Float64, offset: float) -> Predictor:
    """
    Fit a Gaussian process to the logarithm, about a power law with physical signs.

    The mean is in 1, log Fr, Fr^2, log slenderness and log B/T.
    """

    def mean(of: Hulls) -> Float64:
        return np.column_stack(
            [np.ones(len(of)), np.log(of.Fr), of.Fr**2, np.log(of.slenderness), np.log(of.B_T)]
        )

    def place(of: Hulls) -> Float64:
        return (CUBIC.place(of) - centre) / scale

    centre = CUBIC.place(hulls).mean(axis=0)
    scale = CUBIC.place(hulls).std(axis=0) + 1e-9
    logarithm = np.log(values + offset)
    law = np.linalg.lstsq(mean(hulls), logarithm)[0]
    left = logarithm - mean(hulls) @ law
    size = left.std()
    kernel = ConstantKernel() * RBF(np.full(len(SHAPES), 2.0), (0.1, 100.0)) + WhiteKernel(0.01)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # a length that reaches its bound
        process = GaussianProcessRegressor(kernel).fit(place(hulls), left / size)
    return lambda of: np.exp(mean(of) @ law + size * process.predict(place(of))) - offset


def rms(values: Float64) -> float:
    """
    Return the root mean square; NaN of nothing.
    """
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float('nan')


def shown(value: float, digits: str = '.2f') -> str:
    """
    Return a figure for a cell.
    """
    return '-' if np.isnan(value) else format(value, digits)


FILE = 'yacht_hydrodynamics.data'


def yachts(path: Path, froude_max: float) -> tuple[Hulls, Float64]:
    """
    Read the series up to a Froude number; R_r per weight x 1000.
    """
    data = np.loadtxt(path, delimiter='\t', skiprows=1)
    data = data[data[:, 5] <= froude_max]
    lcb, _, slenderness, b_t, l_b, froude, resistance = data.T
    columns = np.column_stack([l_b, b_t, slenderness, froude, lcb / 100.0])
    return Hulls.of(path.name, ('L_B', 'B_T', 'slenderness', 'Fr', 'lcb'), columns), resistance


def left_out(
    hulls: Hulls, values: Float64, groups: np.ndarray
) -> dict[str, tuple[Float64, np.ndarray, Float64]]:
    """
    Foretell each group >= 0 from all others: error, whether the guard passes, sd.
    """
    forms = {**FORMS, 'cubic': CUBIC}
    found = {
        name: (np.full(len(values), np.nan), np.zeros(len(values), bool), np.zeros(len(values)))
        for name in (*forms, 'process')
    }
    for group in np.unique(groups[groups >= 0]):
        out = groups == group
        given, asked_for = hulls.take(~out), hulls.take(out)
        for name, form in forms.items():
            said = fit_form(form, given, values[~out]).predict(asked_for)
            error, ok, sd = found[name]
            error[out] = [each.value for each in said] - values[out]
            ok[out] = [each.inside for each in said]
            sd[out] = [each.sd for each in said]
        found['process'][0][out] = gauss(given, values[~out], 0.1)(asked_for) - values[out]
    # the process has no guard of its own: it is shown where Sirotina's passes
    found['process'][1][:] = found['sirotina'][1]
    asked = groups >= 0
    return {name: (error[asked], ok[asked], sd[asked]) for name, (error, ok, sd) in found.items()}


def delft(path: Path) -> tuple[list[str], Figure]:
    """
    Leave hulls out, leave Froude numbers out.
    """
    lines, relative = [f'\nThe Delft yacht series; the cubic has {len(CUBE)} terms'], []
    (every, values), (slow, of_slow) = (yachts(path, most) for most in (1.0, 0.301))
    step = np.searchsorted(np.unique(every.Fr), every.Fr)
    cases = (
        ('hulls, all Fr', every, values, every.groups()),
        ('hulls, Fr up to 0.3', slow, of_slow, slow.groups()),
        ('each Fr in turn, all hulls known', every, values, step),
        ('Fr above 0.38', every, values, np.where(every.Fr > 0.38, 0, -1)),
    )
    for title, of, measured, groups in cases:
        found = left_out(of, measured, groups)
        rows = []
        for name, (error, ok, sd) in found.items():
            size, known = np.abs(error), ok & np.isfinite(sd) & (sd > 0.0)
            cells: list[object] = [{'process': 'Gaussian process'}.get(name, name)]
            for which in (ok, ~ok):
                worst = size[which].max() if which.any() else float('nan')
                cells += [which.sum(), shown(rms(error[which]), '.3g'), shown(worst, '.3g')]
            hit = 100 * (size < 2.0 * sd)[known].mean() if known.any() else float('nan')
            rows.append((*cells, shown(hit, '.0f')))
        errors = ('rms error', 'worst')
        heads = ('', 'passed', *errors, 'refused', *errors, '2 sd hold in %')
        lines += titled(f'Left out: {title}', heads, rows)
        if title.startswith('hulls'):
            relative += [
                (title, name, *over(error / measured, ok, sd / measured))
                for name, (error, ok, sd) in found.items()
                if name in FORMS
            ]
            figure = delft_picture(found)  # of the last: Fr up to 0.3
    heads = (
        'left out',
        '',
        'of passed ones %',
        'of refused ones %',
        'refused, of such %',
        'sd of passed ones, median %',
    )
    return [*lines, *titled(f'More than {WRONG:.0%} off', heads, relative)], figure


def over(error: Float64, ok: np.ndarray, sd: Float64) -> tuple[str, ...]:
    """
    Say how many relative errors are too large, with and without the guard, in %.
    """
    bad = np.abs(error) > WRONG
    shares = (bad[ok].mean(), bad[~ok].mean(), (~ok)[bad].mean(), np.median(sd[ok]))
    return tuple(f'{100 * share:.0f}' for share in shares)


def delft_picture(found: dict[str, tuple[Float64, np.ndarray, Float64]]) -> Figure:
    """
    Draw the errors of hulls left out, passed and refused.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.2), layout='constrained')
        axis = figure.subplots()
        for place, (error, ok, _) in enumerate(found.values()):
            size = np.maximum(np.abs(error), 1e-3)
            spread = np.random.default_rng(0).uniform(-0.15, 0.15, len(size))
            for shift, which, color, label in (
                (-0.2, ok, BLUE, 'passed'),
                (0.2, ~ok, ORANGE, 'refused'),
            ):
                axis.semilogy(
                    (place + shift + spread)[which],
                    size[which],
                    '.',
                    color=color,
                    markersize=4,
                    label=label if place == 0 else '',
                )
        axis.set_xticks(
            range(len(found)), ['Gaussian process' if n == 'process' else n for n in found]
        )
        axis.set_ylabel('error of R_r per weight x 1000')
        axis.legend()
    return figure
