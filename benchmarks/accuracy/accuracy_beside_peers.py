# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of r(v) beside other ways to differentiate, on the same simulated records.

Prints Markdown; `--write` puts it into benchmarks/results/accuracy_beside_peers.md, the short
table into the .txt of that name in docs/results. It takes half an hour of a processor:
`--parts FOLDER` keeps what is done, goes on from there, and with `--group` does a part only.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import json
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.accuracy import _peers
from benchmarks.accuracy._bound import FAMILY as BOUND_FAMILY
from benchmarks.accuracy._bound import bound
from benchmarks.accuracy._coasts import (
    CARGO,
    COLOUR_S,
    FAMILY,
    GUST_S,
    IN_FAMILY,
    POINTS,
    STEADY_S,
    TANKER,
    YACHT,
    Case,
    Coast,
    Hull,
    coasts,
)
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import estimate, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64

ROOT = Path(__file__).parents[2]
PAGE = ROOT / 'benchmarks' / 'results' / 'accuracy_beside_peers.md'
FIGURES = ROOT / 'docs' / 'results' / 'accuracy_beside_peers.txt'
BEGIN, END = '<!-- beside peers -->', '<!-- end beside peers -->'
HULLS = (CARGO, TANKER, YACHT)
COUNTS = (100, 500, 2000)
SHORT = 500  # samples, in the short table

WHITE = Case('white noise')
CURRENT = Case('current 0.25 m/s', current_m_s=0.25)
GUSTS = Case('gusts worth 0.05 m/s', steady=True, gust_m_s=0.05)
CASES = (
    WHITE,
    CURRENT,
    Case('5 % outliers', outliers=0.05),
    Case('gap', gap=True),
    Case('coloured log 0.05 m/s', steady=True, colour_m_s=0.05),
    Case('thrust runs down, shaft read', steady=True, run_down=True),
    GUSTS,
)
FINAL, LIVE = 'ours, final', 'ours, live'

Figures = dict[str, dict[str, str]]  # by row and column of a table


@dataclass(frozen=True)
class Found:
    """
    r(v) as an estimator gives it, on the speeds of the comparison.

    Attributes
    ----------
    resistance_m_s2, sigma_m_s2 : (m,)
        sigma without the error of n_r; None: not stated.
    valid : (m,)
        Where the estimator vouches for it.
    """

    resistance_m_s2: Float64
    sigma_m_s2: Float64 | None
    valid: np.ndarray


@dataclass(frozen=True)
class Estimator:
    """
    One row of the tables.

    Attributes
    ----------
    name
    runs
        At most; the slow ones get fewer.
    train
        From the first record of a case to the call; most need no training.
    """

    name: str
    runs: int
    train: Callable[[Coast], Callable[[Coast], Found]]


def own(method: Callable[..., object], estimator: str, _: Coast) -> Callable[[Coast], Found]:
    """
    Wrap an estimator of the package.
    """
    parameters = Parameters(estimator=estimator)

    def call(coast: Coast) -> Found:
        found = method(coast.window, coast.truth.ship, parameters)
        curve, valid = found.curve, found.valid_curve.speed_m_s
        at = coast.speeds
        return Found(
            np.interp(at, curve.speed_m_s, curve.resistance_m_s2),
            np.interp(at, curve.speed_m_s, curve.sigma_repeatable_m_s2),
            (at >= valid[0]) & (at <= valid[-1]),
        )

    return call


def peer(
    method: Callable[[_peers.Samples], _peers.Motion], _: Coast | None
) -> Callable[[Coast], Found]:
    """
    Wrap a peer: r = -(1 + n_r) dv/dt, sorted by the speed.
    """

    def call(coast: Coast) -> Found:
        motion = method(_peers.Samples.of(coast.window))
        order = np.argsort(motion.speed_m_s)
        speed = motion.speed_m_s[order]
        inertia = 1.0 + coast.truth.ship.n_r(speed)
        at = coast.speeds
        sigma = None
        if motion.sd_m_s2 is not None:
            sigma = np.interp(at, speed, inertia * motion.sd_m_s2[order])
        r = np.interp(at, speed, -inertia * motion.acceleration_m_s2[order])
        return Found(r, sigma, (at >= speed[0]) & (at <= speed[-1]))

    return call


def tuned(by_truth: bool, coast: Coast) -> Callable[[Coast], Found]:
    """
    Tune pynumdiff on the first record of the case.
    """
    samples = _peers.Samples.of(coast.window)
    acceleration = None
    if by_truth:
        time_s = coast.truth.scenario.lead_in_s + samples.even()[0]
        acceleration = np.interp(
            time_s,
            coast.truth.time_s,
            np.gradient(coast.truth.speed_through_water_m_s, coast.truth.time_s),
        )
    return peer(_peers.TunedByPynumdiff.on(samples, acceleration), None)


OURS = (
    Estimator(FINAL, 10_000, partial(own, estimate_final, 'one')),
    Estimator(LIVE, 10_000, partial(own, estimate, 'one')),
    Estimator('S1 joint', 10_000, partial(own, estimate, 's1_joint')),
    Estimator('S1 speed', 10_000, partial(own, estimate, 's1_speed')),
    Estimator('S1 position', 10_000, partial(own, estimate, 's1_position')),
)
PEERS = (
    Estimator('Chebyshev, BIC (numpy)', 10_000, partial(peer, _peers.chebyshev)),
    Estimator('Savitzky-Golay, CV (scipy)', 50, partial(peer, _peers.savitzky_golay)),
    Estimator('smoothing spline, GCV (scipy)', 6, partial(peer, _peers.smoothing_spline)),
    Estimator('Kalman RTS, ML (statsmodels)', 10, partial(peer, _peers.kalman_rts)),
    Estimator('Matern 5/2 process (scikit-learn)', 6, partial(peer, _peers.gaussian_process)),
    Estimator('pynumdiff, tuned by itself', 10_000, partial(tuned, False)),
    Estimator('pynumdiff, tuned to the truth', 10_000, partial(tuned, True)),
)
GROUPS = {'ours': OURS, 'peers': PEERS, 'bound': ()}


@dataclass
class Tally:
    """
    Errors of one estimator in one case, in parts of the largest r.
    """

    errors: list[Float64] = field(default_factory=list)
    covered: list[np.ndarray] = field(default_factory=list)
    valid: list[np.ndarray] = field(default_factory=list)
    failed: int = 0

    def add(self, found: Found, coast: Coast, largest_m_s2: float) -> None:
        """
        Count one result.
        """
        error = found.resistance_m_s2 - coast.resists(coast.speeds)
        self.errors.append(error / largest_m_s2)
        self.valid.append(found.valid)
        if found.sigma_m_s2 is not None:
            self.covered.append(np.abs(error) <= 2.0 * found.sigma_m_s2)

    @property
    def bias(self) -> Float64:
        """Mean error at each speed."""
        return np.mean(self.errors, axis=0)

    @property
    def spread(self) -> float:
        """Of the errors about their mean, root mean square over the speeds."""
        return rms(self.errors - self.bias)

    def figures(self) -> dict[str, str]:
        """
        Return what the tables show.
        """
        if not self.errors:
            return {'runs': f'0, {self.failed} failed'}
        valid = np.array(self.valid)
        cover = f'{100.0 * np.mean(self.covered):.0f}' if self.covered else '-'
        return {
            'RMSE': percent(rms(self.errors)),
            'bias': percent(rms(self.bias)),
            'spread': percent(self.spread),
            'at the top': f'{100.0 * rms(np.array(self.errors)[:, -1]):.1f}',
            'where valid': percent(rms(np.array(self.errors)[valid])),
            'valid': f'{100.0 * valid.mean():.0f}',
            'cover': cover,
            'runs': f'{len(self.errors)}' + (f', {self.failed} failed' if self.failed else ''),
        }


BOUNDS = {'v .. v⁴': BOUND_FAMILY, 'v, v², v⁴': IN_FAMILY, 'v .. v⁴, v⁶, v⁸': (1, 2, 3, 4, 6, 8)}
EFFICIENCY = ('RMSE', 'bias', 'spread', *BOUNDS)
HEADINGS = ('RMSE', 'bias', 'spread', 'at the top', 'cover', 'where valid', 'valid', 'runs')


def rms(values: object) -> float:
    """
    Return the root mean square.
    """
    return float(np.sqrt(np.mean(np.square(values))))


def percent(part: float) -> str:
    """
    Show a part in percent.
    """
    return f'{100.0 * part:.2f}'


def tally(
    hull: Hull, case: Case, n: int, runs: int, estimators: tuple[Estimator, ...]
) -> dict[str, Tally]:
    """
    Run estimators on the same records of one case.
    """
    tallies = {each.name: Tally() for each in estimators}
    calls: dict[str, Callable[[Coast], Found]] = {}
    largest = np.nan
    most = min(runs, max(each.runs for each in estimators))
    for seed, coast in enumerate(coasts(hull, case, n, most)):
        if not calls:
            largest = float(coast.resists(np.array([hull.speed_m_s]))[0])
            calls = {each.name: each.train(coast) for each in estimators}
        for each in estimators:
            if seed >= each.runs:
                continue
            try:
                tallies[each.name].add(calls[each.name](coast), coast, largest)
            except (EstimationError, ValueError, np.linalg.LinAlgError):
                tallies[each.name].failed += 1
    return tallies


def figures(hull: Hull, case: Case, n: int, runs: int, group: str) -> Figures:
    """
    Return the figures of a group of estimators in one case, or the bound.
    """
    if group != 'bound':
        found = tally(hull, case, n, runs, GROUPS[group])
        return {name: one.figures() for name, one in found.items()}
    sd, largest = bound(hull, case, n)
    rmse = percent(rms(sd) / largest)
    top = f'{100.0 * sd[-1] / largest:.1f}'
    return {'Cramer-Rao bound': {'RMSE': rmse, 'spread': rmse, 'at the top': top}}


def efficiency(n: int, runs: int) -> Figures:
    """
    Return the figures on the hull whose resistance lies in the family.
    """
    found = tally(FAMILY, WHITE, n, runs, OURS[:2])
    result = {}
    for name, one in found.items():
        shown = {key: one.figures()[key] for key in EFFICIENCY[:3]}
        for heading, powers in BOUNDS.items():
            sd, largest = bound(FAMILY, WHITE, n, powers)
            limit = rms(sd) / largest
            shown[heading] = f'{percent(limit)}: {100.0 * (limit / one.spread) ** 2:.0f} %'
        result[name] = shown
    return result


def part(folder: Path | None, name: str, make: Callable[[], Figures]) -> Figures:
    """
    Return figures, from the folder where an earlier call has left them.
    """
    kept = None if folder is None else folder / f'{name.replace("/", "_")}.json'
    if kept is not None and kept.exists():
        found: Figures = json.loads(kept.read_text(encoding='utf-8'))
        return found
    start = time.process_time()
    found = make()
    print(f'{name}: {time.process_time() - start:.0f} s', file=sys.stderr, flush=True)
    if kept is not None:
        kept.write_text(json.dumps(found), encoding='utf-8')
    return found


def row(cells: list[str]) -> str:
    """
    Return one line of a table.
    """
    return f'| {" | ".join(cells)} |'


def head(headings: list[str]) -> list[str]:
    """
    Return the first two lines of a table.
    """
    return [row(headings), row(['---'] * len(headings))]


def table(counts: list[int], by_count: list[Figures]) -> list[str]:
    """
    Return the table of one hull and case; figures of all n in a cell.
    """
    lines = head(['n = ' + ' / '.join(map(str, counts)), *HEADINGS])
    for name in by_count[0]:
        cells = []
        for heading in HEADINGS:
            values = [rows[name].get(heading, '') for rows in by_count]
            cells.append(values[0] if len(set(values)) == 1 else ' / '.join(values))
        bold = f'**{name}**' if name in (FINAL, LIVE) else name
        lines.append(row([bold, *cells]))
    return lines


def short_table(results: dict[Case, Figures]) -> list[str]:
    """
    Return the short table: the cargo ship, three cases, RMSE, top, cover.
    """
    cases = (WHITE, CURRENT, GUSTS)
    lines = head(['RMSE / at the top / cover', *(case.name for case in cases)])
    for name in results[WHITE]:
        cells = []
        for case in cases:
            shown = results[case][name]
            keys = ('RMSE', 'at the top', 'cover')
            cells.append(' / '.join(shown.get(key, '') or '-' for key in keys))
        lines.append(row([f'**{name}**' if name in (FINAL, LIVE) else name, *cells]))
    return lines


def preface(runs: int) -> list[str]:
    """
    Say what the page shows and how it was measured.
    """
    fewer = ', '.join(f'{each.name} {each.runs}' for each in PEERS if each.runs < runs)
    return [
        '# Accuracy beside other estimators',
        '',
        'Written by `python -m benchmarks.accuracy.accuracy_beside_peers --write` '
        '(`make peers` installs what it compares with). All estimators',
        f'get the same simulated records, seeds 0 to {runs - 1}, or the first of them '
        f'({fewer or "none"}): column `runs`.',
        '',
        '- Errors of r(v) in % of the true r at the stop. RMSE² = bias² + spread². All are over '
        'one range of speeds, evenly: from the',
        '  true speed at the end of the record, or Froude number 0.05, to the true speed at the '
        f'stop ({POINTS} points). Beyond its own ends a curve is held.',
        '- `cover`: share of that range where ±2 sigma (repeatable) holds the truth, of those '
        'that state a sigma. `valid`: the part, in %, for which an',
        '  estimator vouches; `where valid`: its RMSE there.',
        '- Records: n samples of log and position each. Cargo ship 8.2 m/s, 1500 s; tanker '
        '7.9 m/s, 3600 s; log 0.05 m/s, position 10 m; yacht, whose r has',
        '  a hump, 3 m/s, 150 s, 0.02 m/s, 2 m. Outliers: 1/8 to 3/8 of the first speed. Gap: a '
        'tenth of the record, early. Coloured: on top of the white noise of',
        f'  the log, {COLOUR_S:.0f} s. Gusts: a force that moves the steady ship by 0.05 m/s, '
        f'{GUST_S:.0f} s. Run-down of the thrust: 8, 20, 3 s. In these three the '
        f'{STEADY_S / 60:.0f} min before',
        '  the stop are given too, as a ship has them; the final fit learns from them. No '
        'estimator is given the noise level.',
        '- Bound: Cramer-Rao, r = c₁v + .. + c₄v⁴ with the noise known, unknown current and state '
        'at the stop (`benchmarks/accuracy/_bound.py`, apart from the',
        '  package). A smaller or a fitting family, or a biased estimator, may lie below it.',
        '- What is expected of r beforehand was chosen, among some dozens of ways, in view of '
        'these three ships and seeds, so ours are flattered here; on hulls that',
        '  nothing was chosen on: docs/results/accuracy_0_1.txt, Unseen hulls.',
        '- Peers differentiate; r = -(1 + n_r) dv/dt with the true n_r, sorted by v. Chebyshev: '
        'degree by BIC. Savitzky-Golay: cubic, window by leave-one-out',
        '  on evenly spaced speeds. Spline: `make_smoothing_spline`. Kalman: log and position '
        'jointly, white jerk, current as a state,',
        '  three variances by maximum likelihood. Gaussian process: scikit-learn, means of '
        f'neighbours above {_peers.GAUSS_SAMPLES} samples. pynumdiff: savgoldiff (its best here),',
        '  tuned by its `optimize` on the first record of each case, by its own loss or against '
        'the true derivative, which nobody has at sea.',
    ]


def between(path: Path, lines: list[str]) -> None:
    """
    Replace what stands between the marks in a file.
    """
    text = path.read_text(encoding='utf-8')
    before, begin, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    if not begin:
        raise SystemExit(f'{path}: no mark {BEGIN}, add it where the table belongs')
    made = '\n'.join(lines)
    path.write_text(f'{before}{BEGIN}\n{made}\n{END}{after}', encoding='utf-8')


def main() -> None:
    """
    Run everything and print it.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=200, help='coastdowns of each case')
    parser.add_argument('--n', type=int, choices=COUNTS, nargs='+', default=list(COUNTS))
    parser.add_argument('--hull', choices=[hull.name for hull in HULLS], help='this one alone')
    parser.add_argument('--write', action='store_true', help='the page and the short table')
    parser.add_argument('--jobs', type=int, default=1, help='processes')
    parser.add_argument('--parts', type=Path, metavar='FOLDER', help='keep and reuse what is done')
    parser.add_argument('--group', choices=list(GROUPS), help='fill the parts with this one alone')
    options = parser.parse_args()
    runs, counts = options.runs, options.n
    hulls = [hull for hull in HULLS if options.hull in (None, hull.name)]
    has_short = SHORT in counts and CARGO in hulls
    if runs < 2:
        parser.error('--runs must be 2 or more: the spread is shown')
    if options.write and not has_short:
        parser.error(f'--write needs n = {SHORT} and the {CARGO.name} for the short table')
    if options.group and not options.parts:
        parser.error('--group needs --parts, where the figures are kept')
    if options.parts:
        options.parts.mkdir(parents=True, exist_ok=True)
    calls: dict[tuple[object, ...], tuple[str, Callable[[], Figures]]] = {}
    # the long ones first
    for n, hull, case, group in product(counts[::-1], hulls, CASES, GROUPS):
        name = f'{hull.name}, {case.name}, n = {n}, {group}, {runs}'
        calls[hull, case, n, group] = name, partial(figures, hull, case, n, runs, group)
    for n in counts:
        calls[FAMILY, n, 'ours'] = f'efficiency, n = {n}, {runs}', partial(efficiency, n, runs)
    with ProcessPoolExecutor(options.jobs) as pool:
        waiting = {
            key: pool.submit(part, options.parts, name, make)
            for key, (name, make) in calls.items()
            if options.group in (None, key[-1])
        }
        results = {key: future.result() for key, future in waiting.items()}
    if options.group:
        return
    found: dict[tuple[Hull, Case, int], Figures] = {}
    for hull, case, n in product(hulls, CASES, counts):
        of_all = [results[hull, case, n, group] for group in GROUPS]
        found[hull, case, n] = {name: row for group in of_all for name, row in group.items()}
    efficient = [
        row([str(n), name, *(shown[key] for key in EFFICIENCY)])
        for n in counts
        for name, shown in results[FAMILY, n, 'ours'].items()
    ]
    body = []
    for hull in hulls:
        body += ['', f'## {hull.name.capitalize()}']
        for case in CASES:
            body += ['', f'### {hull.name.capitalize()}: {case.name}', '']
            body += table(counts, [found[hull, case, n] for n in counts])
    body += [
        '',
        '## Variance efficiency',
        '',
        'The cargo ship with r = c₁v + c₂v² + c₄v⁴; white noise. Under each family: its bound '
        '(last: of all powers that the final fit',
        'averages over), and the efficiency, the variance of the bound over that of ours. The '
        'first fit knows that r is v .. v⁴ and reaches the bound: finding noise and',
        'weights costs nothing. Final and live figure do not know the family; what they lose '
        'against a bound that does is the price of not knowing, and where they',
        'lie below one, what they expect of r beforehand is in the bias.',
        '',
        *head(['n', '', *EFFICIENCY]),
        *efficient,
    ]
    lines = [*preface(runs), *body]
    if has_short:
        short = short_table({case: found[CARGO, case, SHORT] for case in CASES})
        lines += ['', f'## In short: cargo ship, n = {SHORT}', '', *short]
    print('\n'.join(lines))
    if options.write:
        PAGE.write_text('\n'.join(lines) + '\n', encoding='utf-8')
        between(FIGURES, short)


if __name__ == '__main__':
    main()
