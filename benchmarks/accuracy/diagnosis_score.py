# SPDX-License-Identifier: Apache-2.0
"""
Scoreboard of a diagnosis, on coastdowns in which the effect is hidden.

    python -m benchmarks.accuracy.diagnosis_score --by oracle --count 40
    python -m benchmarks.accuracy.diagnosis_score --by command
    python -m benchmarks.accuracy.diagnosis_score --by MODULE:FUNCTION --as blocks
    python -m benchmarks.accuracy.diagnosis_score --world b --half odd --count 40
    python -m benchmarks.accuracy.diagnosis_score --world b --half odd --count 40 --by oracle

World a is `hidden`; world b, of another hand, is `hidden_b`: its even cases are for choosing
methods, its odd ones for scoring.

Every answer is kept in a file before the truth of its case is asked for; a run
that was broken off goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

# before numpy: the processes share the cores with each other alone
os.environ.setdefault('OMP_NUM_THREADS', '1')

from benchmarks import _verbs
from benchmarks.worlds.hidden import cases, scoring
from benchmarks.worlds.hidden.recording import Recording
from benchmarks.worlds.hidden_b import cases as cases_b
from benchmarks.worlds.hidden_b import facts as facts_b
from benchmarks.worlds.hidden_b import plans as plans_b
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.samples import Block, Channel, in_arrival_order

OUT = Path(__file__).parent / 'out'
WORLDS: dict[str, Any] = {'a': cases, 'b': cases_b}
HALVES = {'all': (0, 1), 'even': (0, 2), 'odd': (1, 2)}  # remainder, divisor
Found = dict[str, Any]
Diagnose = Callable[[cases.Observation], tuple[Found, float]]  # and its CPU time [s]


def as_block(recording: Recording) -> Block:
    """
    Return the readings of a run as the samples that the monitor is given.
    """
    return in_arrival_order(
        [
            Block.of(
                Channel[name.upper()],
                series.stamp_ns,
                series.value,
                receive_ns=series.receive_ns,
            )
            for name, series in recording.items()
        ]
    )


def write_bags(observation: cases.Observation, folder: Path) -> tuple[Path, list[Path]]:
    """
    Write the ship file and one bag a run; return where they are.
    """
    ship = folder / 'ship.yaml'
    ship.write_text(observation.ship_file, encoding='utf-8')
    bags = []
    for number, recording in enumerate(observation.runs):
        bags.append(folder / f'run_{number}.mcap')
        with BagWriter(bags[-1]) as writer:
            writer.attach('ship.yaml', observation.ship_file)
            writer.write_samples(as_block(recording))
    return ship, bags


def by_blocks(diagnose: Callable[[str, list[Block]], Found]) -> Diagnose:
    """
    Adapt a function of the ship file's text and one block a run.
    """
    return lambda seen: _timed(diagnose, seen.ship_file, [as_block(run) for run in seen.runs])


def by_bags(diagnose: Callable[[Path, list[Path]], Found]) -> Diagnose:
    """
    Adapt a function of the paths of the ship file and the bags.
    """

    def adapted(seen: cases.Observation) -> tuple[Found, float]:
        with TemporaryDirectory() as folder:
            return _timed(diagnose, *write_bags(seen, Path(folder)))

    return adapted


def _timed(diagnose: Callable[..., Found], *arguments: Any) -> tuple[Found, float]:
    start = time.process_time()
    found = diagnose(*arguments)
    return found, time.process_time() - start


def command(ship: Path, bags: list[Path], more: Sequence[str] = ()) -> Found:
    """
    Diagnose with the verb `shipdrag diagnose`, in this process.

    Parameters
    ----------
    ship, bags
    more
        Further arguments: the facts that a crew knows.
    """
    return _verbs.found('diagnose', *map(str, bags), '--ship', str(ship), *more)


def diagnosis(
    by: str, form: str, number: int, world: str = 'a', with_facts: bool = False
) -> Diagnose:
    """
    Return the diagnosis that is asked for; the oracle alone knows of the noise.
    """
    if by == 'oracle':
        oracle = import_module(
            f'benchmarks.worlds.{"hidden" if world == "a" else "hidden_b"}.oracle'
        )
        return lambda seen: _timed(oracle.diagnose, seen, WORLDS[world].known(number))
    if by == 'command':
        more: list[str] = []
        if with_facts:
            more = facts_b.arguments(WORLDS[world].reveal(number).facts)
        return by_bags(lambda ship, bags: command(ship, bags, more))
    module, _, function = by.partition(':')
    found = getattr(import_module(module), function)
    return by_blocks(found) if form == 'blocks' else by_bags(found)


def answer(
    by: str,
    form: str,
    number: int,
    world: str = 'a',
    with_facts: bool = False,
    once: bool = False,
) -> dict[str, Any]:
    """
    Diagnose one case, and again with what the answer recommends, unless once is enough.
    """
    hidden = WORLDS[world]
    diagnose = diagnosis(by, form, number, world, with_facts)
    found, cpu_s = diagnose(hidden.observe(number))
    row: dict[str, Any] = {
        'case': number,
        'cpu_s': cpu_s,
        'found': found,
        'followed': None,
        'everything': None,
    }
    if found['verdict'] == 'one_of' and not once:
        tried = scoring.parse(found).tried
        if tried is not None:
            row['followed'], _ = diagnose(hidden.observe(number, added=(tried.test,)))
        row['everything'], _ = diagnose(hidden.observe(number, added=hidden.TESTS))
    return row


def _answer(task: tuple[str, str, int, str, bool, bool]) -> dict[str, Any]:
    try:
        return answer(*task)
    except Exception as error:
        return {'case': task[2], 'error': f'{type(error).__name__}: {error}'}


def trials(rows: Sequence[dict[str, Any]], world: str = 'a') -> list[scoring.Trial]:
    """
    Reveal the truth of the cases that were answered.
    """

    def parsed(found: Found | None) -> scoring.Answer | None:
        return None if found is None else scoring.parse(found)

    return [
        scoring.Trial(
            WORLDS[world].reveal(row['case']),
            scoring.parse(row['found']),
            row['cpu_s'],
            parsed(row['followed']),
            parsed(row['everything']),
        )
        for row in rows
        if 'error' not in row
    ]


def table(done: Sequence[scoring.Trial]) -> Iterator[str]:
    """
    Yield the lines of the scoreboard.
    """
    conditions = sorted({str(trial.truth.condition) for trial in done})
    grouped = {
        text: scoring.scores([t for t in done if str(t.truth.condition) == text])
        for text in conditions
    }
    grouped['all but mis-stated'] = scoring.scores(
        [trial for trial in done if not trial.truth.condition.misstated] or done
    )
    yield '| | ' + ' | '.join(grouped) + ' |'
    yield '|---|' + '---|' * len(grouped)
    for name in grouped['all but mis-stated']:
        cells = [_cell(columns[name]) for columns in grouped.values()]
        yield f'| {name} | ' + ' | '.join(cells) + ' |'
    yield ''
    yield 'parameters within 2 sd'
    known = [trial for trial in done if not trial.truth.condition.misstated]
    for name, share in scoring.parameters_inside(known).items():
        yield f'  {name}: {share}'
    yield ''
    yield 'hidden: answers (name: how often)'
    for truth, answers in scoring.confusion(done).items():
        yield f'  {truth}: ' + ', '.join(f'{name} {n}' for name, n in answers.most_common())


def _cell(value: scoring.Share | float) -> str:
    if isinstance(value, scoring.Share):
        return str(value) if value.of else '-'
    return '-' if value != value else f'{value:.3g}'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Ask, keep, reveal, and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument(
        '--by',
        default='command',
        help='oracle, command or MODULE:FUNCTION',
    )
    parser.add_argument('--as', dest='form', choices=('blocks', 'bags'), default='blocks')
    parser.add_argument('--first', type=int, default=0, help='number of the first case')
    parser.add_argument('--count', type=int, help='how many cases; all of them by default')
    parser.add_argument('--world', choices=tuple(WORLDS), default='a')
    parser.add_argument('--half', choices=tuple(HALVES), default='all', help='by number')
    parser.add_argument('--facts', action='store_true', help='say what a crew knows (world b)')
    parser.add_argument(
        '--once', action='store_true', help='without what the answers recommend: quicker'
    )
    parser.add_argument('--processes', type=int, default=2)
    parser.add_argument('--out', type=Path, help='answers, one line of JSON a case')
    options = parser.parse_args(arguments)
    if options.facts and options.world == 'a':
        parser.error('--facts: world a has none')
    hidden = WORLDS[options.world]
    place, step = HALVES[options.half]
    numbers = [n for n in range(options.first, hidden.count()) if n % step == place]
    numbers = numbers[: options.count]
    name = options.by.replace(':', '_') + '_b' * (options.world == 'b') + '_facts' * options.facts
    out = options.out or OUT / f'diagnosis_{name}.jsonl'
    out.parent.mkdir(parents=True, exist_ok=True)

    kept = _kept(out)
    tasks = [
        (options.by, options.form, number, options.world, options.facts, options.once)
        for number in numbers
        if number not in kept
    ]
    with ProcessPoolExecutor(options.processes) as pool, out.open('a', encoding='utf-8') as file:
        for row in pool.map(_answer, tasks):
            file.write(json.dumps(row) + '\n')
            file.flush()
            kept[row['case']] = row
    rows = [kept[number] for number in numbers]

    print(f'{len(rows)} of {hidden.count()} cases, seed {hidden.SEED}, answers of {options.by}')
    failed = [row for row in rows if 'error' in row]
    for row in failed[:10]:
        print(f'case {row["case"]}: {row["error"]}')
    if failed:
        print(f'{len(failed)} cases without an answer, not counted below')
    done = trials(rows, options.world)
    for line in table(done):
        print(line)
    if options.world == 'b':
        print(f'\nnothing hidden, and named what is always there: {_always(done)}')
    _write_summary(out.with_suffix('.json'), done, hidden.SEED)


def _always(done: Sequence[scoring.Trial]) -> scoring.Share:
    named = [t for t in done if t.truth.kind == 'none' and t.answer.verdict == 'named']
    return scoring.Share.over(set(trial.answer.named) <= set(plans_b.ALWAYS) for trial in named)


def _kept(out: Path) -> dict[int, dict[str, Any]]:
    if not out.exists():
        return {}
    rows = (json.loads(line) for line in out.read_text(encoding='utf-8').splitlines())
    return {row['case']: row for row in rows if 'error' not in row}


def _write_summary(path: Path, done: Sequence[scoring.Trial], seed: int) -> None:
    figures = {
        name: asdict(value) if isinstance(value, scoring.Share) else value
        for name, value in scoring.scores(done).items()
    }
    summary = {
        'seed': seed,
        'cases': len(done),
        'figures': figures,
        'confusion': scoring.confusion(done),
    }
    path.write_text(json.dumps(summary, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
