# SPDX-License-Identifier: Apache-2.0
"""
Forecasts of every measured coast, beside what followed and beside rivals.

    python -m benchmarks.accuracy.forecast_records --write

Reads the folder that SHIPDRAG_DATA names. After a quarter, a third and a half of each coast the
rest is foretold from the readings until then, and compared with speed and way at eighths of what
was left. Rivals: the deceleration persists; the polynomial of S1 goes on; a fit of u' = -k u^2. A
rival's band is as wide as holds 90 % of its errors on the other records. `--write` puts the tables
into docs/forecast.md, and what was not foretold into docs/results/forecast_records.txt.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit

from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy.real_coastdowns import COASTS, KnownCoast
from benchmarks.accuracy.real_records import OUT, ROOT, prepared
from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.running import too_vague
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.estimation.result import Track
from shipdrag_ros.forecast.followed import Followed
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import coast_windows, replay
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship

PAGE = ROOT / 'docs' / 'forecast.md'
REASONS = ROOT / 'docs' / 'results' / 'forecast_records.txt'
PARTS = (0.25, 1.0 / 3.0, 0.5)
EIGHTHS = np.arange(1, 9) / 8.0
OURS, RIVALS = 'forecast', ('persistence', 'polynomial', 'v^2')
FINE = 401  # times of an integral of the speed
LOWEST = 0.05  # of the speed at the stop, until which is foretold and compared
SLOWEST = 1e-3  # Froude number at which a replay of a coast ends
RECENT = 1.0 / 3.0  # of the readings so far, from which the deceleration persists
Motion = Callable[[Float64], Float64]
# two records of one coast are one
ONCE = tuple(
    {(each.record.table, each.coast_s): each for each in COASTS[::-1] if each.coast_s}.values()
)[::-1]


@dataclass(frozen=True)
class Predicted:
    """
    Speed and way of one method, at the times of a case, in parts of `Case.scale`.

    Attributes
    ----------
    error : (2, m)
        Foretold less what followed.
    low, high : (2, m)
        The band about what was foretold; of a rival found later.
    reach : (m,)
        What a rival's band is in proportion to: time since it was made, in parts of that before.
    """

    error: Float64
    low: Float64
    high: Float64
    reach: Float64


@dataclass(frozen=True)
class Case:
    """One forecast of one record by all methods; `part` of the coast was known."""

    record: str
    part: float
    by: dict[str, Predicted]


def inside(one: Predicted) -> Float64:
    """Say of each figure whether its band holds what followed."""
    return np.asarray((one.error >= -one.high) & (one.error <= one.low))


def scores(one: Predicted) -> Float64:
    """Return the interval score of each figure."""
    out = np.maximum(one.error - one.low, 0.0) + np.maximum(-one.error - one.high, 0.0)
    return np.asarray(one.low + one.high + 2.0 / 0.1 * out)


def readings(window: Window, stop_ns: int, tracks: Mapping[str, Track]) -> tuple[Float64, Float64]:
    """Return times from the stop and the speeds that rivals fit; of places, as they are fitted."""
    for series in (window.speed_through_water, window.speed_over_ground):
        if len(series):
            return (series.time_ns - stop_ns) / SECOND_NS, series.value
    time_s = (tracks['position'].time_ns - stop_ns) / SECOND_NS
    return time_s, np.gradient(tracks['position'].fitted, time_s)


def rivals(time_s: Float64, speed: Float64, order: int) -> Iterator[tuple[str, Motion]]:
    """Yield each rival's speed against time; a ship that has stopped stays."""
    recent = time_s >= time_s[-1] - RECENT * (time_s[-1] - time_s[0])
    line = np.polynomial.Polynomial.fit(time_s[recent], speed[recent], 1)
    whole = np.polynomial.Polynomial.fit(time_s, speed, max(order - 1, 1))
    (first, tau), _ = curve_fit(
        lambda t, u, tau: u / (1.0 + t / tau),
        time_s,
        speed,
        p0=(speed[0], max(float(np.ptp(time_s)), 1.0)),
        bounds=((0.0, 1e-3), (np.inf, np.inf)),
    )
    yield RIVALS[0], lambda t: np.maximum(line(t), 0.0)
    yield RIVALS[1], lambda t: np.clip(whole(t), 0.0, 2.0 * float(speed.max()))
    yield RIVALS[2], lambda t: np.asarray(first / (1.0 + t / tau))


def case_of(
    name: str, part: float, window: Window, followed: Followed, ship: Ship, parameters: Parameters
) -> Case:
    """Foretell from a part of a coast by all methods."""
    stop_ns = window.start_ns
    length_s = float(followed.time_s[-1])
    known = window.part(stop_ns, stop_ns + round(part * length_s * SECOND_NS))
    found = estimate(known, ship, parameters)
    if why := too_vague(found, parameters):
        raise ShipdragError(why)
    stop_m_s = float(found.curve.speed_m_s[-1])
    forecast = foretell(found, ship, speeds_m_s=(LOWEST * stop_m_s,))
    made_s = (forecast.made_ns - stop_ns) / SECOND_NS
    slow = np.flatnonzero(followed.speed_m_s <= LOWEST * stop_m_s)
    end_s = float(followed.time_s[slow[0]]) if len(slow) else length_s
    if end_s <= made_s:
        raise ShipdragError('she has lost nearly all of her speed by then')
    ahead = EIGHTHS * (end_s - made_s)
    start_m = np.interp(made_s, followed.way_time_s, followed.way_m)
    was = np.stack(
        [
            np.interp(made_s + ahead, followed.time_s, followed.speed_m_s),
            np.interp(made_s + ahead, followed.way_time_s, followed.way_m) - start_m,
        ]
    )
    scale = np.array([[stop_m_s], [stop_m_s * length_s]])
    fine = np.linspace(0.0, ahead[-1], FINE)
    table_of = forecast.in_time(fine).T[1:]
    speed, low, high, way, way_low, way_high = (np.interp(ahead, fine, each) for each in table_of)
    median = np.stack([speed, way])
    by = {
        OURS: Predicted(
            (median - was) / scale,
            (median - np.stack([low, way_low])) / scale,
            (np.stack([high, way_high]) - median) / scale,
            ahead / made_s,
        )
    }
    seen = readings(known, stop_ns, found.tracks)
    published = (
        's1_speed' if known.speed_through_water or known.speed_over_ground else 's1_position'
    )
    try:
        order = estimate(known, ship, Parameters(estimator=published, froude_min=SLOWEST)).order
    except ShipdragError:
        order = None
    current = found.current_m_s or 0.0 if forecast.over_ground else 0.0
    for rival, motion in rivals(*seen, order or 3):
        u = motion(made_s + fine)
        x = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (u[1:] + u[:-1]))])
        there = np.stack([np.interp(ahead, fine, u), np.interp(ahead, fine, x + current * fine)])
        nothing = np.zeros_like(there)
        by[rival] = Predicted((there - was) / scale, nothing, nothing, ahead / made_s)
    return Case(name, part, by)


def cases(coast: KnownCoast, out: Path, estimator: str) -> Iterator[Case | str]:
    """Yield the forecasts of a record, or why there is none."""
    record, span = coast.record, coast.coast_s
    assert span is not None
    (run,) = open_runs([record.bag(out)])
    try:
        given = replace(record.given, estimator=estimator)
        result = replay(run, parameters=given, window=span)
        found = coast_windows(result)
        if not found:
            raise ShipdragError('; '.join(each.text for each in result.not_coastdowns))
        ((whole, window),) = found
        if whole.estimate is None:
            raise ShipdragError(whole.failure or 'no estimate of the whole coast')
        followed = Followed.of(window, whole.estimate)
    except ShipdragError as error:
        yield f'{record.name}: what followed is not known: {error}'
        return
    for part in PARTS:
        try:
            yield case_of(record.name, part, window, followed, result.ship, result.parameters)
        except ShipdragError as error:
            yield f'{record.name}, after {part:.0%}: {error}'


def with_bands(every: list[Case]) -> list[Case]:
    """Give each rival the band that holds 90 % of its errors on the other records."""
    found = []
    for case in every:
        by = dict(case.by)
        for rival in RIVALS:
            others = [each for each in every if each.record != case.record]
            relative = [np.abs(each.by[rival].error) / each.by[rival].reach for each in others]
            weights = [1.0 / sum(o.record == each.record for o in others) for each in others]
            widths = [
                weighted_quantile(
                    np.concatenate([each[k] for each in relative]),
                    np.repeat(weights, relative[0].shape[1]),
                )
                for k in range(2)
            ]
            half = np.array(widths)[:, None] * by[rival].reach
            by[rival] = Predicted(by[rival].error, half, half, by[rival].reach)
        found.append(Case(case.record, case.part, by))
    return found


def weighted_quantile(values: Float64, weights: Float64) -> float:
    """Return the value below which 90 % of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.9 * total[-1])])


def report(every: list[Case], problems: list[str]) -> str:
    """Return the tables."""
    methods = (OURS, *RIVALS)
    rows: list[Sequence[object]] = []
    shares: dict[str, float] = {}
    better: dict[str, list[list[bool]]] = {}  # score and error, than each rival
    for name in dict.fromkeys(each.record for each in every):
        mine = [each.by for each in every if each.record == name]
        score = [np.mean([scores(by[m]) for by in mine]) for m in methods]
        error = [np.median([np.abs(by[m].error) for by in mine]) for m in methods]
        shares[name] = float(np.mean([inside(by[OURS]) for by in mine]))
        better[name] = [[each[0] < rival for rival in each[1:]] for each in (score, error)]
        cells = (*(f'{100.0 * each:.3g}' for each in score), *(f'{100.0 * e:.2g}' for e in error))
        rows.append((name, len(mine), f'{shares[name]:.0%}', *cells))
    parts = [
        f'{part:.0%}: {np.mean([inside(one.by[OURS]) for one in every if one.part == part]):.0%}'
        for part in PARTS
    ]
    n, held = len(shares), list(shares.values())
    share, spread = float(np.mean(held)), float(np.std(held) / np.sqrt(n))
    won = np.sum(list(better.values()), axis=0).tolist()
    head = ['record', 'forecasts', 'inside 90 %']
    head += [f'score, {m}' for m in methods] + [f'error, {m}' for m in methods]
    # the families of the law were chosen on the first of each two records of the list
    listed = [coast.record.name for coast in ONCE]
    halves = []
    for half, which in ((listed[::2], 'odd'), (listed[1::2], 'even')):
        of_half = [name for name in shares if name in half]
        score, error = np.sum([better[name] for name in of_half], axis=0)[:, 0]
        halves.append(
            f'{which} records ({len(of_half)}): '
            f'{float(np.mean([shares[name] for name in of_half])):.0%} inside, better score than '
            f'persistence in {score}, less error in {error}'
        )
    missed = len({re.split('[,:]', each)[0] for each in problems})
    lines = [
        *table(head, rows),
        '',
        f'{len(every)} forecasts of {n} records. Inside the band: {share:.0%} ± {2 * spread:.0%} '
        '(mean over records, ± two standard errors). '
        + ' '.join(
            f'{words} than {", ".join(RIVALS)} in {", ".join(map(str, of))} of {n}.'
            for words, of in zip(('Better score', 'Less error'), won)
        ),
        '',
        f'By part of the coast that was known: {", ".join(parts)}.',
        '',
        f'By half of the list: {"; ".join(halves)}.',
        '',
        f'Of {missed} of {len(ONCE)} records some or all was not foretold: '
        '[each with its reason](results/forecast_records.txt).',
    ]
    return '\n'.join(lines)


def main() -> None:
    """
    Print the tables, and write them into the page if asked.
    """
    options = asked(__doc__, write=False, estimator='one', out=OUT / 'forecast')
    if not prepared(options.out):
        return
    every: list[Case] = []
    problems: list[str] = []
    for coast in ONCE:
        for each in cases(coast, options.out, options.estimator):
            if isinstance(each, str):
                problems.append(each)
            else:
                every.append(each)
            print(each if isinstance(each, str) else (each.record, each.part), flush=True)
    text = report(with_bands(every), problems)
    print(text, *problems, sep='\n')
    if options.write:
        put(PAGE, {'records': text})
        head = 'Not foretold by `python -m benchmarks.accuracy.forecast_records --write`:\n'
        REASONS.write_text('\n'.join([head, *problems, '']), encoding='utf-8')


if __name__ == '__main__':
    main()
