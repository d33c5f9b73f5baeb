# SPDX-License-Identifier: Apache-2.0
"""
What `shipdrag learn` makes of effects that the library lacks, on ships that share no code with it.

    python -m benchmarks.accuracy.learn_strangers --show kelp_below
    python -m benchmarks.accuracy.learn_strangers --ships 8 --runs 4
    python -m benchmarks.accuracy.learn_strangers --ships 100 --only none
    python -m benchmarks.accuracy.learn_strangers --table

`--show` is the whole way with one stranger: diagnosed, learnt, the gap on a run that was kept,
and a later run diagnosed by name. Without it every stranger is learnt on every ship, and ships
without one; a run that was broken off goes on where it was. `--table` shows what is there, and
both write docs/results/learn_strangers.txt.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks import ROOT, _verbs
from benchmarks._asked import asked
from benchmarks.accuracy.diagnosis_score import write_bag
from benchmarks.worlds.hidden_b.cases import EPOCH_NS
from benchmarks.worlds.strangers import world
from benchmarks.worlds.strangers.hidden import CURVES, PLAIN, STRANGERS
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.term import LearntTerm
from shipdrag_ros.simulation import Action, Scenario, simulate_columns
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import declared

WHY = (
    'no form is certain', 'something smooth', 'half of them', 'effects of the library',
    'nothing is missing',
)  # fmt: skip
OUT = Path(__file__).parent / 'out' / 'learn_strangers.jsonl'
RESULTS = ROOT / 'docs' / 'results' / 'learn_strangers.txt'
NAME = 'stranger'
GONE = 0.9  # of the gap
Found = dict[str, Any]


def write_run(case: world.Case, run: int, folder: Path) -> str:
    """
    Write a run as a bag; return its path.
    """
    return str(write_bag(folder / f'run_{run}.mcap', case.ship_file, case.recording(run)))


def foretold(case: world.Case, run: int, term: LearntTerm) -> tuple[float, float, float]:
    """
    Return what a term foretells of what a stranger does to the speed, without noise.

    First which part of the rms is gone, then the size over the true one, and its sd.
    """
    t, log, ground, _ = case.shown(run)
    ship, setting = Ship.from_yaml(case.ship_file, subject='ship'), case.settings[run]
    scenario = Scenario(
        speed_m_s=setting.speed_m_s,
        lead_in_s=60.0,
        duration_s=float(t[-1]),
        heading_rad=setting.heading_rad,
        depth_m=setting.depth_m,
        day=(EPOCH_NS * 1e-9 + setting.clock_s) / 86400.0,
    )
    sizes = np.array([q.value for q in term.parameters.values()])
    variance, across = np.linalg.eigh(np.array(term.covariance))
    off = (across * np.sqrt(np.maximum(variance, 0.0))).T
    frame = Frame(ship, scenario, setting.first_rad)
    actions = [
        declared(term).action(frame, *each) for each in (sizes, *(sizes + off), *(sizes - off))
    ]
    time_s = np.clip(t + 60.0, 0.0, scenario.length_s)
    read = simulate_columns(ship, scenario, [Action(), *actions], time_s)
    speeds = np.hstack([read.log_m_s, read.speed_through_water_m_s])
    changes, gap = speeds[1:] - speeds[0], np.concatenate([log, ground])
    size, *others = changes @ gap / (gap @ gap)
    more, less = np.split(np.array(others), 2)
    gone = 1.0 - np.sqrt(np.mean((gap - changes[0]) ** 2) / np.mean(gap**2))
    return float(gone), float(size), float(np.linalg.norm(0.5 * (more - less)))


def tried(stranger: str, ship: int, runs: int, show: bool = False) -> Found:
    """
    Learn from some runs of a ship; foretell the one that was kept, and diagnose a later one.
    """
    case = world.case(stranger, ship)
    with TemporaryDirectory() as name:
        folder = Path(name)
        bags = [write_run(case, run, folder) for run in list(world.LEARNT)[:runs]]
        file = folder / 'effects' / f'{NAME}.yaml'
        file.parent.mkdir()
        alone = _verbs.found('diagnose', bags[0])
        if show:
            _show('first run', alone)
        start = time.process_time()
        found = _verbs.found('learn', *bags, '-o', str(file), '--name', NAME)
        result: Found = {
            'stranger': stranger,
            'ship': ship,
            'runs': runs,
            'cpu_s': round(time.process_time() - start, 1),
            'kind': None,
            'reason': found['reason'],
            'probability': {k: round(p, 3) for k, p in found['probability'].items() if p > 0.01},
            'cut': 0.0,
            'size': None,
            'alone': [alone['verdict'], [each['name'] for each in alone['effects']]],
            'later': None,
        }
        if found['learnt'] is None:
            return result
        term = LearntTerm.load(file)
        result['kind'] = [term.term.channel, term.term.variable, term.term.shape]
        result['parameters'] = {k: [q.value, q.sd] for k, q in term.parameters.items()}
        result['evidence'] = found['learnt']['evidence']
        if stranger:
            cut, *size = foretold(case, world.KEPT, term)
            result |= {'cut': round(cut, 3), 'size': [round(each, 3) for each in size]}
        if show:
            print(file.read_text())
            print(f'gap of a run that was kept: {result["cut"]:.0%} gone')
        bag = write_run(case, world.LATER, folder)
        later = _verbs.found('diagnose', bag, '--effects', str(file.parent))
        result['later'] = [later['verdict'], [each['name'] for each in later['effects']]]
        if show:
            _show('later run', later)
    return result


def _show(what: str, found: Found) -> None:
    names = ', '.join(each['name'] for each in found['effects'])
    print(f'{what}: {found["verdict"]} {names}; where: {found["where"]}')


def table(rows: Sequence[Found]) -> Iterator[str]:
    """
    Yield shares with their intervals of 95 %, and each case.
    """
    yield 'What `python -m benchmarks.accuracy.learn_strangers` learnt; seeds: the ships'
    for runs in sorted({row['runs'] for row in rows}):
        mine = [row for row in rows if row['runs'] == runs]
        plain = [row for row in mine if row['stranger'] in PLAIN]
        other = [row for row in mine if row['stranger'] and row['stranger'] not in PLAIN]
        empty, strange = [row for row in mine if not row['stranger']], plain + other
        right = [tuple(row['kind'] or ()) == CURVES[row['stranger']] for row in plain]
        wrong = [row['kind'] is not None and not ok for row, ok in zip(plain, right, strict=True)]
        written = [row for row in strange if row['kind'] is not None]
        yield f'\n{runs} runs, {len(mine)} cases'
        yield _line('the twelve: form right', right)
        yield _line('the twelve: another form', wrong)
        yield _line('the others: a form written', [row['kind'] is not None for row in other])
        yield _line('without a stranger: a form written', [r['kind'] is not None for r in empty])
        sizes = [abs(row['size'][0] - 1.0) <= 2.0 * row['size'][1] for row in written]
        yield _line('written: size right within 2 sd, on that run', sizes)
        cut = [row['cut'] >= GONE for row in strange]
        yield _line('90 % of the gap of a run that was kept gone', cut)
        later = [row['later'][1] == [NAME] for row in written]
        yield _line('written, and named in a later run', later)
        alone = [[row['alone'][0] == 'named' for row in some] for some in (strange, empty)]
        yield _line('one run diagnosed alone: a name, which is wrong', alone[0])
        yield _line('without a stranger: one run, a name', alone[1])
        why = [next(k for k in WHY if k in row['reason']) for row in strange if not row['kind']]
        yield f'of {len(why)} of which nothing is written: ' + ', '.join(
            f'{count} {text}' for text, count in Counter(why).most_common()
        )
        first = [
            next(iter(row['probability']), '') == '{} by {} ({})'.format(*CURVES[row['stranger']])
            for row in plain
        ]
        yield _line('the twelve: the right form is the likeliest', first)
        cpu_s = [row['cpu_s'] for row in mine]
        yield f'CPU s: median {np.median(cpu_s):.0f}, most {max(cpu_s):.0f}'
        for row in sorted(mine, key=lambda row: (row['stranger'], row['ship'])):
            kind = ' '.join(row['kind'] or ['-'])
            likeliest = next(iter(row['probability'].items()), ('-', 0.0))
            yield (
                f'  {row["stranger"] or "(none)":18s} ship {row["ship"]} written: {kind:24s} gap '
                f'gone {row["cut"]:5.2f}  likeliest {likeliest[0]} {likeliest[1]:.2f}  alone '
                f'{" ".join([row["alone"][0], *row["alone"][1]])}  later {row["later"]}'
            )


def _line(what: str, hits: Sequence[bool]) -> str:
    if not hits:
        return f'{what:48s} no case'
    low, high = binomtest(sum(hits), len(hits)).proportion_ci(method='wilson')
    return f'{what:48s} {sum(hits):3d} of {len(hits):3d}  ({low:.2f} .. {high:.2f})'


def main() -> None:
    """
    Learn on all cases that are not done, or show one.
    """
    options = asked(
        __doc__, show=('', *STRANGERS), ships=1, runs=[4], only=['none', *STRANGERS], table=False
    )
    if options.show:
        print(json.dumps(tried(options.show, 0, options.runs[0], show=True), indent=1))
        return
    OUT.parent.mkdir(exist_ok=True)
    rows = [json.loads(line) for line in OUT.read_text().splitlines()] if OUT.exists() else []
    if not options.table:
        done = {(row['stranger'], row['ship'], row['runs']) for row in rows}
        names = ['' if name == 'none' else name for name in options.only]
        for ship, name, runs in product(range(options.ships), names, options.runs):
            if (name, ship, runs) not in done:
                rows.append(tried(name, ship, runs))
                with OUT.open('a') as file:
                    print(json.dumps(rows[-1]), file=file)
    text = '\n'.join(table(rows))
    RESULTS.write_text(text + '\n')
    print(text)


if __name__ == '__main__':
    main()
