# SPDX-License-Identifier: Apache-2.0
"""
Scoreboard of a diagnosis, on coastdowns in which the effect is hidden.

    python -m benchmarks.accuracy.diagnosis_score --first 539 --count 191
    python -m benchmarks.accuracy.diagnosis_score --world b --half odd --count 40 [--facts]
    python -m benchmarks.accuracy.diagnosis_score --world b --half odd --count 40 --by oracle
    python -m benchmarks.accuracy.diagnosis_score --by MODULE:FUNCTION

World a is `hidden`; world b, of another hand, is `hidden_b`: its even cases are for choosing
methods, its odd ones for scoring, and `--seed` draws others. Its oracle knows its physics.
`--facts` says what a crew knows (world b). A function is given the ship file's text and the
readings of each run.

Every answer is kept in a file (`--out`) before the truth of its case is asked for; a run
that was broken off goes on where it was.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from inspect import getmembers
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

from benchmarks import _verbs
from benchmarks._asked import asked, pooled
from benchmarks._tables import table as markdown
from benchmarks.worlds.hidden import cases, scoring
from benchmarks.worlds.hidden.recording import Recording
from benchmarks.worlds.hidden_b import cases as cases_b
from benchmarks.worlds.hidden_b import oracle
from benchmarks.worlds.hidden_b import plans as plans_b
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.samples import Block, Channel, in_arrival_order

OUT = Path(__file__).parent / 'out'
WORLDS: dict[str, Any] = {'a': cases, 'b': cases_b}
HALVES = {'all': (0, 1), 'even': (0, 2), 'odd': (1, 2)}  # remainder, divisor
Found = dict[str, Any]
Diagnose = Callable[[cases.Observation], Found]


def drawn(world: str, seed: int = 0) -> Any:
    """
    Return the functions of a world, of world b of another seed than its own where one is given.
    """
    if world == 'a' or not seed:
        return WORLDS[world]
    functions = getmembers(cases_b, lambda each: 'seed' in getattr(each, '__annotations__', ()))
    return SimpleNamespace(SEED=seed, **{n: partial(each, seed=seed) for n, each in functions})


def half_of(world: Any, half: str, first: int) -> list[int]:
    """
    Return the numbers of a half of the cases of a world, from the first on.
    """
    remainder, divisor = HALVES[half]
    return [n for n in range(first, world.count()) if n % divisor == remainder]


def as_block(recording: Recording) -> Block:
    """
    Return the readings of a run as the samples that the monitor is given.
    """
    return in_arrival_order(
        [
            Block.of(Channel[name.upper()], each.stamp_ns, each.value, receive_ns=each.receive_ns)
            for name, each in recording.items()
        ]
    )


def write_bag(path: Path, ship_file: str, recording: Recording) -> Path:
    """
    Write a run with its ship file as a bag; return its path.
    """
    with BagWriter(path) as writer:
        writer.attach('ship.yaml', ship_file)
        writer.write_samples(as_block(recording))
    return path


def write_bags(seen: cases.Observation, folder: Path) -> tuple[Path, list[Path]]:
    """
    Write the ship file and one bag a run; return where they are.
    """
    ship = folder / 'ship.yaml'
    ship.write_text(seen.ship_file, encoding='utf-8')
    runs = enumerate(seen.runs)
    return ship, [write_bag(folder / f'run_{k}.mcap', seen.ship_file, run) for k, run in runs]


def diagnosis(by: str, number: int, hidden: Any, facts: bool = False) -> Diagnose:
    """
    Return the diagnosis that is asked for; the oracle alone knows of the noise.
    """
    if by == 'oracle':
        return lambda seen: oracle.diagnose(seen, hidden.known(number))
    if by != 'command':
        module, _, name = by.partition(':')
        function = getattr(import_module(module), name)
        return lambda seen: function(seen.ship_file, [as_block(run) for run in seen.runs])
    more = plans_b.arguments(hidden.reveal(number).facts) if facts else []

    def command(seen: cases.Observation) -> Found:
        with TemporaryDirectory() as folder:
            ship, bags = write_bags(seen, Path(folder))
            return _verbs.found('diagnose', *map(str, bags), '--ship', str(ship), *more)

    return command


def answer(
    by: str, number: int, world: str = 'a', facts: bool = False, seed: int = 0
) -> dict[str, Any]:
    """
    Diagnose one case.
    """
    hidden = drawn(world, seed)
    seen, diagnose = hidden.observe(number), diagnosis(by, number, hidden, facts)
    start = time.process_time()
    found = diagnose(seen)
    return {'case': number, 'cpu_s': time.process_time() - start, 'found': found}


def _answer(task: tuple[str, int, str, bool, int]) -> dict[str, Any]:
    try:
        return answer(*task)
    except Exception as error:
        return {'case': task[1], 'error': f'{type(error).__name__}: {error}'}


def trials(rows: Sequence[dict[str, Any]], world: str = 'a', seed: int = 0) -> list[scoring.Trial]:
    """
    Reveal the truth of the cases that were answered.
    """
    reveal = drawn(world, seed).reveal
    return [
        scoring.Trial(reveal(row['case']), scoring.parse(row['found']), row['cpu_s'])
        for row in rows
        if 'error' not in row
    ]


def table(done: Sequence[scoring.Trial]) -> Iterator[str]:
    """
    Yield the lines of the scoreboard.
    """
    grouped = {
        text: scoring.scores([t for t in done if str(t.truth.condition) == text])
        for text in sorted({str(trial.truth.condition) for trial in done})
    }
    grouped['all but mis-stated'] = scoring.scores(
        [trial for trial in done if not trial.truth.condition.misstated] or done
    )
    rows = [
        [name, *(_cell(column[name]) for column in grouped.values())]
        for name in grouped['all but mis-stated']
    ]
    yield from markdown(['', *grouped], rows)
    yield '\nhidden: answers (name: how often)'
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
    options = asked(
        __doc__, arguments, by='command', world=tuple(WORLDS), half=tuple(HALVES), first=0,
        count=int, seed=0, facts=False, processes=2, out=Path,
    )  # fmt: skip
    by, world = options.by, options.world
    if world == 'a' and (options.facts or options.seed or by == 'oracle'):
        raise SystemExit('world a has neither facts nor an oracle nor other seeds')
    hidden = drawn(world, options.seed)
    numbers = half_of(hidden, options.half, options.first)[: options.count]
    name = by.replace(':', '_') + '_b' * (world == 'b') + '_facts' * options.facts
    name += f'_{options.seed}' * bool(options.seed)
    out = options.out or OUT / f'diagnosis_{name}.jsonl'
    out.parent.mkdir(parents=True, exist_ok=True)
    kept = _kept(out)
    tasks = [
        (by, number, world, options.facts, options.seed)
        for number in numbers
        if number not in kept
    ]
    with out.open('a', encoding='utf-8') as file:
        for row in pooled(_answer, tasks, options.processes):
            print(json.dumps(row), file=file, flush=True)
            kept[row['case']] = row
    rows = [kept[number] for number in numbers]

    print(f'{len(rows)} of {hidden.count()} cases, seed {hidden.SEED}, answers of {by}')
    failed = [row for row in rows if 'error' in row]
    for row in failed[:10]:
        print(f'case {row["case"]}: {row["error"]}')
    if failed:
        print(f'{len(failed)} cases without an answer, not counted below')
    done = trials(rows, world, options.seed)
    print(*table(done), sep='\n')
    if world == 'b':
        print(f'\nnothing hidden, and named what is always there: {_always(done)}')


def _always(done: Sequence[scoring.Trial]) -> scoring.Share:
    named = [t for t in done if t.truth.kind == 'none' and t.answer.verdict == 'named']
    return scoring.Share.over(set(trial.answer.named) <= set(plans_b.ALWAYS) for trial in named)


def _kept(out: Path) -> dict[int, dict[str, Any]]:
    if not out.exists():
        return {}
    rows = map(json.loads, out.read_text(encoding='utf-8').splitlines())
    return {row['case']: row for row in rows if 'error' not in row}


if __name__ == '__main__':
    main()
