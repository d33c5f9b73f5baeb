# SPDX-License-Identifier: Apache-2.0
"""
S4: how regressions of residual resistance fail, and what the guard makes of it.

River ships as the paper describes them, with a known control curve; the power of
the guard over simulated data sets; and, with SHIPDRAG_DATA, the Delft yacht
series with hulls and Froude numbers left out. A Gaussian process with a physical
mean stands beside the forms. `--pictures` draws those of docs/s4_residual.md.

    python -m benchmarks.figures s4_residual    # needs `make peers`
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import titled, write_csv
from benchmarks.accuracy import _river_ships as river
from benchmarks.accuracy._delft import FILE as DELFT
from benchmarks.accuracy._delft import WRONG, Predictor, delft, gauss, rms, shown
from shipdrag_ros.report.drawing import BLUE, GREEN, STYLE, VERMILION, save
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import FORMS, Hulls, ResidualFit, fit_form

PICTURES = ROOT / 'docs' / 'pictures'
TABLE = ROOT / 'docs' / 'data' / 'river_ships.csv'  # tests to try the verb on
SEED = 4
ASKED = 30  # hulls asked for in each data set
PROCESSES = 50  # sets to which a Gaussian process is fitted too: it takes its time
PAPER = {'sirotina': 0.006, 'sakhnovsky': 0.017}
FLEETS = (9, 16, 25, 40)
WORDS = {  # of a rule's reasons
    'range or convex hull': 'outside',
    'leverage': 'leverage',
    'trend against physics': 'against physics',
}


# the paper's experiment

SWEEPS = {'L/B': (0, np.linspace(6.0, 10.5, 91)), 'B/T': (1, np.linspace(2.5, 6.0, 71))}
SPANS = ('within 0.3', 'within 1', 'beyond')


def lines_of(ratio: int, values: Float64, by: dict[str, Predictor]) -> dict[str, Float64]:
    """
    Return 10^3 c_R of the prototype with a ratio varied, Fr 0.15.
    """
    ships = river.sweep(ratio, values, 0.15)
    return {
        'control': river.control(ships),
        **{name: foretell(ships) for name, foretell in by.items()},
    }


def of_forms(hulls: Hulls, values: Float64) -> dict[str, ResidualFit]:
    """
    Fit both published forms.
    """
    return {name: fit_form(form, hulls, values) for name, form in FORMS.items()}


def foretellers(found: dict[str, ResidualFit]) -> dict[str, Predictor]:
    """
    Return the fits as functions of hulls.
    """

    def bound(fit: ResidualFit) -> Predictor:
        return lambda ships: fit.fit.predict(fit.form.columns(ships))

    return {name: bound(fit) for name, fit in found.items()}


def nine_ships(runs: int) -> Iterator[str]:
    """
    The sweeps of the paper's figures 1 and 2, over many sets of nine ships.
    """
    rng = np.random.default_rng(SEED)
    errors: dict[tuple[str, str, str], list[float]] = {}
    wrong: Counter[tuple[str, str]] = Counter()
    criteria: dict[str, list[float]] = {name: [] for name in FORMS}
    passed = 0
    fits = {}
    for run in range(runs):
        hulls, values = river.models(9, rng)
        fits = of_forms(hulls, values)
        by = foretellers(fits)
        if run < PROCESSES:
            by['Gaussian process'] = gauss(hulls, values, 0.0)
        for name, fit in fits.items():
            criteria[name].append(fit.criterion)
        for varied, (ratio, at) in SWEEPS.items():
            lines = lines_of(ratio, at, by)
            away = np.abs(at - river.PROTOTYPE[ratio])
            near = np.argsort(away)[:2]
            for name in by:
                off = lines[name] - lines['control']
                for span, rows in zip(SPANS, (away <= 0.3, away <= 1.0, away > 1.0)):
                    errors.setdefault((varied, name, span), []).append(rms(off[rows]))
                slopes = [np.subtract(*lines[each][near]) for each in (name, 'control')]
                wrong[varied, name] += slopes[0] * slopes[1] < 0.0
        if run < PROCESSES:
            for ratio, at in SWEEPS.values():
                ships = river.sweep(ratio, at, 0.15)
                passed += sum(each.inside for fit in fits.values() for each in fit.predict(ships))
    yield from titled(
        f'Nine river ships, {runs} sets, the Gaussian process on {min(runs, PROCESSES)} of them',
        ('form', 'F, the paper', 'F, ours, median', 'rank', 'condition'),
        [
            (
                name,
                PAPER[name],
                f'{np.median(criteria[name]):.4f}',
                f'{fit.fit.rank} of 15',
                f'{fit.fit.condition:.0e}',
            )
            for name, fit in fits.items()
        ],
    )
    rows = []
    for (varied, name), count in wrong.items():
        of = [errors[varied, name, span] for span in SPANS]
        cells = ['{:.2f}, {:.2f}'.format(*np.quantile(each, [0.5, 0.9])) for each in of]
        rows.append((varied, name, *cells, f'{100 * count / len(of[0]):.0f} %'))
    yield from titled(
        'Error of 10^3 c_R in the sweeps, rms: median of the sets, and what one in ten exceeds',
        ('varied', '', *SPANS, 'trend reversed at the prototype'),
        rows,
    )
    yield f'{passed} ships of the sweeps passed the guard'


def sweep_picture() -> Figure:
    """
    Draw the sweeps of one set of nine ships.
    """
    hulls, values = river.models(9, np.random.default_rng(SEED))
    by = foretellers(found := of_forms(hulls, values))
    sirotina = found['sirotina']
    # along what the data leave open, until the trend is reversed
    much = -4.0 / open_part(sirotina, river.sweep(0, np.array([6.0]), 0.15))[0]
    by['Sirotina, another'] = lambda ships: (
        by['sirotina'](ships) + much * open_part(sirotina, ships)
    )
    by['Gaussian process'] = gauss(hulls, values, 0.0)
    styles = (('black', '-'), (VERMILION, '--'), (BLUE, '-.'), (BLUE, ':'), (GREEN, '-'))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.0), layout='constrained')
        axes = figure.subplots(1, 2, sharey=True)
        for axis, (varied, (ratio, at)) in zip(axes, SWEEPS.items()):
            for (name, line), (color, style) in zip(lines_of(ratio, at, by).items(), styles):
                axis.plot(at, line, color=color, linestyle=style, label=name)
            axis.axvline(river.PROTOTYPE[ratio], color='#777777', linewidth=0.8)
            axis.set_xlabel(f'{varied}; the line is the prototype')
        axes[0].set_ylabel('10³ c_R at Fr 0.15')
        axes[0].set_ylim(-1.0, 3.5)
        axes[0].legend()
    return figure


def open_part(found: ResidualFit, ships: Hulls) -> Float64:
    """
    Return a change of the fit that no datum sees.
    """
    return (found.form.columns(ships) / found.fit.scale) @ found.fit.directions[-1]


# the power of the guard


def guard(runs: int) -> Iterator[str]:
    """
    Over simulated data sets: what is refused, and what passes.
    """
    rows = []
    rules: Counter[tuple[str, bool]] = Counter()
    totals: Counter[bool] = Counter()
    for name, form in FORMS.items():
        for count in FLEETS:
            rng = np.random.default_rng([SEED, count])
            draw = np.random.default_rng([SEED, count, 1])
            off, passed, within = [], [], []
            for _ in range(runs):
                found = fit_form(form, *river.models(count, rng))
                ships = river.wanted(ASKED, rng)
                truth = river.control(ships)
                said = found.predict(ships)
                value = np.array([each.value for each in said])
                off.append(value / truth - 1.0)
                passed.append([each.inside for each in said])
                test = truth * (1.0 + river.LINES * draw.normal(size=ASKED))
                test *= 1.0 + river.NOISE * draw.normal(size=ASKED)
                within.append([abs(each.value - t) < 2.0 * each.sd for each, t in zip(said, test)])
                if (name, count) == ('sirotina', 16):
                    _count(rules, totals, [each.reasons for each in said], np.abs(off[-1]) > WRONG)
            error, ok, hit = map(np.concatenate, (off, passed, within))
            bad = np.abs(error) > WRONG
            rows.append(
                (
                    name,
                    count,
                    f'{100 * bad.mean():.0f}',
                    f'{100 * (~ok)[bad].mean():.1f}',
                    f'{100 * ok[~bad].mean():.1f}' if (~bad).any() else '-',
                    ok.sum(),
                    shown(100 * rms(error[ok]), '.1f'),
                    shown(100 * rms(error[~ok]), '.0f'),
                    shown(100 * hit[ok].mean() if ok.any() else float('nan'), '.0f'),
                )
            )
    yield from titled(
        f'Power of the guard, {runs} data sets of each kind, {ASKED} hulls in each',
        (
            'form',
            'hulls',
            'bad %',
            '**bad refused %**',
            'good passed %',
            'passed',
            'error of passed %',
            'of refused %',
            '2 sd hold a new test %',
        ),
        rows,
    )
    yield from titled(
        'Each rule alone, Sirotina, 16 hulls; share in % that it refuses',
        ('rule', 'of bad ones', 'of good ones'),
        [
            (rule, *(f'{100 * rules[rule, bad] / totals[bad]:.1f}' for bad in (True, False)))
            for rule in WORDS
        ],
    )


def _count(
    rules: Counter[tuple[str, bool]],
    totals: Counter[bool],
    reasons: list[tuple[str, ...]],
    bad: np.ndarray,
) -> None:
    """Count which rules speak, of bad and of good predictions."""
    for given, is_bad in zip(reasons, bad.tolist()):
        totals[is_bad] += 1
        for rule, word in WORDS.items():
            rules[rule, is_bad] += any(word in reason for reason in given)


def main() -> None:
    """
    Print the tables, and draw where that is asked for.
    """
    options = asked(__doc__, runs=500, pictures=False)
    print(*nine_ships(options.runs), *guard(options.runs), sep='\n')
    if (folder := os.environ.get('SHIPDRAG_DATA')) is None:
        print(f'skipped: {DELFT}, as SHIPDRAG_DATA is not set')
    else:
        of_delft, errors = delft(Path(folder) / DELFT)
        print(*of_delft, sep='\n')
    if not options.pictures:
        return
    hulls, values = river.models(FLEETS[-1], np.random.default_rng(SEED))
    places = [getattr(hulls, name) for name in river.NAMES]
    write_csv(TABLE, (*river.NAMES, 'c_R'), np.column_stack([*places, 1e-3 * values]))
    save(sweep_picture(), PICTURES / 's4_sweeps.png')
    if folder is not None:
        save(errors, PICTURES / 's4_delft.png')


if __name__ == '__main__':
    main()
