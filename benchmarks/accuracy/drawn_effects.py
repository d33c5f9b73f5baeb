# SPDX-License-Identifier: Apache-2.0
"""
Effects of the library in sizes drawn from their own priors, simulated and diagnosed.

    python -m benchmarks.accuracy.drawn_effects --what limits --count 100
    python -m benchmarks.accuracy.drawn_effects --what gap --count 50
    python -m benchmarks.accuracy.drawn_effects --what runs --count 20
    python -m benchmarks.accuracy.drawn_effects --what rate --count 60
    python -m benchmarks.accuracy.drawn_effects --what log --count 40
    python -m benchmarks.accuracy.drawn_effects --what wind --count 12

`limits`: how often upper_95 holds the size. `gap`: what is left of it where two runs name an
effect, and what a run on the first heading says of the ship file with it. `runs`, `rate`: the
log probability of the truth by one, two and three runs, and by 0.5, 2 and 8 readings a second; in
half of the cases nothing is hidden. `log`: r(v) by a log alone, in scales that are drawn or fixed.
`wind`: r(v) on four headings in 6 m/s of measured wind. The world is the package's own: this shows
what its inference makes of its own model, and no more.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks._asked import asked, pooled
from benchmarks._tables import table
from benchmarks.accuracy._coasts import CARGO
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.diagnose import with_effects
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import (
    STANDARD_INPUTS,
    START_NS,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)
from shipdrag_ros.simulation.effects import effects_of

LEAD_S, COAST_S, SPEED_M_S = 900.0, 1200.0, 8.0
RATES_HZ, SCALES = (0.5, 2.0, 8.0), (None, 0.0, 0.01, 0.02, 0.03)
WIDE, LEAST = 1.96, 1e-3  # and the least probability that is counted
SHIP = CARGO.ship
EFFECTS = {e.name: e for e in effects_of(SHIP).values() if not e.missing(SHIP)}
Row = tuple[str, Sequence[float]]


class Case(NamedTuple):
    """What is hidden (the name of an effect, or nothing), its sizes, and a seed."""

    name: str
    sizes: Mapping[str, float]
    seed: int

    @classmethod
    def drawn(cls, seed: int, names: Sequence[str] = tuple(EFFECTS), empty: float = 0.0) -> Case:
        """Draw an effect, or nothing with a probability, and its sizes."""
        rng = np.random.default_rng(seed)
        name = str(rng.choice(names))
        if rng.uniform() < empty:
            return cls('none', {}, seed)
        of_it = EFFECTS[name].parameters_of(SHIP)
        return cls(name, {each.name: _possible(each, rng) for each in of_it}, seed)

    @property
    def hidden(self) -> list[StatedEffect]:
        """As the simulation takes it."""
        values = {name: Parameter(value, 0.0) for name, value in self.sizes.items()}
        return [StatedEffect(self.name, values)] if values else []

    def run(
        self, number: int = 0, rate_hz: float = 1.0, inputs: Sequence[str] = STANDARD_INPUTS
    ) -> CoastRun:
        """Return one of its runs, each on its own heading; the fifth on that of the first."""
        turned = np.random.default_rng([self.seed, 1]).uniform(-math.pi, math.pi, 4)
        turned[0] = 0.0
        scenario = Scenario(
            speed_m_s=SPEED_M_S,
            lead_in_s=LEAD_S,
            duration_s=COAST_S,
            heading_rad=float(turned[number % 4]),
        )
        truth = simulate(SHIP, scenario, effects=self.hidden, reference_rad=0.0)
        sensors = standard_sensors(rate_hz=rate_hz, inputs=inputs)
        block = sense(truth, sensors, seed=10 * self.seed + number)
        stop_ns, end_ns = START_NS + round(LEAD_S * SECOND_NS), int(block.stamp_ns.max())
        window = Window.from_block(block, stop_ns, end_ns, before_ns=START_NS)
        return CoastRun(f'run {number}', window)

    def log_probability(self, found: DiagnosisResult) -> float:
        """Return that of the truth."""
        chances = {each.names: each.probability for each in found.candidates}
        chance = chances.get((self.name,), 0.0) if self.sizes else found.nothing
        return math.log(max(chance, LEAST))


def _possible(size: Parameter, rng: np.random.Generator) -> float:
    """Draw a size that can be on this ship."""
    while not size.low <= (value := size.prior.draw(rng)) <= size.high:
        pass
    return value


def answered(runs: Sequence[CoastRun], ship: Ship = SHIP) -> DiagnosisResult:
    """Return a diagnosis without advice."""
    return diagnose(runs, ship, Parameters(), advise=False)


def limits(seed: int) -> Row:
    """Say whether a limit holds the size; nothing where it is named."""
    case = Case.drawn(seed)
    limit = answered([case.run()]).limits.get(case.name)
    if limit is None:
        return case.name, ()
    size = abs(case.sizes[limit.parameter])
    return case.name, (size <= limit.value if limit.bound == 'upper_95' else size >= limit.value,)


def gap(seed: int) -> Row:
    """Return chi^2 of runs left out, the gap left, and whether a new run says nothing."""
    case = Case.drawn(seed)
    found = answered([case.run(0), case.run(1)])
    before, after = found.held_out_before, found.held_out_after
    if [each.name for each in found.effects] != [case.name] or before is None or after is None:
        return case.name, ()
    again = answered([case.run(4)], with_effects(SHIP, found.effects))
    left = (after.chi2_per_sample - 1.0) / max(before.chi2_per_sample - 1.0, 1e-9)
    said = str(again.verdict) == 'none'
    return case.name, (after.chi2_per_sample, max(left, 0.0), said)


def runs(seed: int) -> Row:
    """Return the log probability of the truth by one, two and three runs."""
    case = Case.drawn(seed, empty=0.5)
    seen = [case.run(k) for k in range(3)]
    return case.name, [case.log_probability(answered(seen[: k + 1])) for k in range(3)]


def rate(seed: int) -> Row:
    """Return the same by the readings a second, of a hull that is fouled or not."""
    case = Case.drawn(seed, ('fouling',), empty=0.5)
    return case.name, [case.log_probability(answered([case.run(0, hz)])) for hz in RATES_HZ]


def log(seed: int, factor: float | None = None) -> Row:
    """Return cover and error of r(v) by a log alone."""
    drawn = np.random.default_rng(seed).normal(0.0, 0.02)
    case = Case('log_scale', {'factor': drawn if factor is None else factor}, seed)
    window = case.run(inputs=('speed_through_water',)).window
    curve = estimate_final(window, SHIP, Parameters()).valid_curve
    true = np.asarray(SHIP.resistance_n(curve.speed_m_s)) / SHIP.mass_kg
    off = curve.resistance_m_s2 - true
    cover = float(np.mean(np.abs(off) < WIDE * curve.sigma_m_s2))
    return ('drawn' if factor is None else f'{factor:.0%}'), (
        cover,
        100.0 * _rms(off) / true.max(),
    )


def wind(seed: int) -> Row:
    """Return the scatter of r(v) on four headings, in calm water and as it was [% of r]."""
    along = np.random.default_rng(seed).uniform(-math.pi, math.pi)
    sizes = {'head_m_s': 6.0 * math.cos(along), 'cross_m_s': 6.0 * math.sin(along)}
    case, curves = Case('wind', sizes, seed), list[Sequence[Float64]]()
    for k in range(4):
        window = case.run(k, inputs=(*STANDARD_INPUTS, 'wind_apparent')).window
        found = estimate_final(window, SHIP, Parameters())
        speed = np.linspace(4.0, 7.5, 30)
        both = found.calm, found.conditions
        curves.append([np.interp(speed, e.speed_m_s, e.resistance_m_s2) for e in both])
    calm, in_it = (np.std(each, axis=0, ddof=1) / np.mean(each, axis=0) for each in zip(*curves))
    return 'wind of 6 m/s', (100.0 * _rms(calm), 100.0 * _rms(in_it))


def _rms(value: Float64) -> float:
    return float(np.sqrt(np.mean(value**2)))


def grouped(rows: Sequence[Row]) -> dict[str, Float64]:
    """Return the figures (n, k) of each name, and of all."""
    found = defaultdict(list)
    for name, figures in rows:
        for each in (name, 'all') if len(figures) else ():
            found[each].append(figures)
    return {name: np.array(each, np.float64) for name, each in sorted(found.items())}


def _means(figures: Float64) -> list[str]:
    return [f'{value:.3g}' for value in np.mean(figures, axis=0)]


def _paired(figures: Float64) -> Iterator[str]:
    """Yield the means, and the differences from the first with two standard errors."""
    yield from _means(figures)
    for k in range(1, figures.shape[1]):
        more = figures[:, k] - figures[:, 0]
        twice = f'{2.0 * more.std(ddof=1) / math.sqrt(len(more)):.2f}' if len(more) > 1 else '-'
        yield f'{more.mean():+.2f} ± {twice}'


COLUMNS = {
    'limits': ('upper_95 holds',), 'gap': ('chi^2 left out', 'gap left, mean', 'then none'),
    'runs': ('1 run', '2', '3', '2 less 1', '3 less 1'),
    'rate': ('0.5 Hz', '2', '8', '2 less 0.5', '8 less 0.5'),
    'log': ('cover', 'RMSE, % of the largest r'),
    'wind': ('scatter of calm r, %', 'of r in the conditions, %'),
}  # fmt: skip
WORK = {'limits': limits, 'gap': gap, 'runs': runs, 'rate': rate, 'log': log, 'wind': wind}


def main() -> None:
    """Print one of the tables."""
    options = asked(__doc__, what=tuple(WORK), count=60, seed=0, processes=2)
    seeds = range(options.seed, options.seed + options.count)
    ways = (
        [partial(log, factor=f) for f in SCALES] if options.what == 'log' else [WORK[options.what]]
    )
    rows = [row for way in ways for row in pooled(way, seeds, options.processes)]
    found = grouped(rows)
    paired = options.what in ('runs', 'rate')
    print(f'{options.count} cases, seeds {seeds.start} to {seeds.stop - 1}')
    cells = (
        [name, len(each), *(_paired(each) if paired else _means(each))]
        for name, each in found.items()
    )
    print(*table(['hidden', 'N', *COLUMNS[options.what]], cells), sep='\n')
    if options.what == 'gap':
        print(f'gap left, median {np.median(found["all"][:, 1]):.3g}')


if __name__ == '__main__':
    main()
