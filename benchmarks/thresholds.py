# SPDX-License-Identifier: Apache-2.0
"""
Thresholds of a verdict, by the answers that `diagnosis_score.py` kept.

    python benchmarks/diagnosis_score.py --by command --count 300
    python benchmarks/diagnosis_score.py --by command --world b --half even --count 300
    python benchmarks/thresholds.py diagnosis_command.jsonl --check diagnosis_command_b.jsonl

For a name, risk control: the lowest probability from which (wrong + 1) / (named + 1) is at most
the risk, on the answers of the first file (world a); below it nothing is named. For a set, split
conformal: the share of the named probability that holds the truth in the part wanted of those
answered with a set. Both hold on average over files like the first. Beside them stands what holds
with a confidence for this one: the limits are tried from the strictest on, each by an exact
binomial test, and the last before the first that fails is taken. All are then counted on the
other file.

Sources: Angelopoulos et al. (2024), Conformal risk control; Romano, Sesia and Candes (2020),
Classification with valid and adaptive coverage; Angelopoulos et al. (2025), Learn then Test.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import trials
from hidden.scoring import Share, Trial
from scipy.stats import beta, binom

from shipdrag_ros.inference.decision import CERTAIN, LISTED

GRID = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.92, 0.94, 0.96, 0.98, 0.99, 0.995, 0.999)
SHARES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98, LISTED)


def named_from(done: Sequence[Trial], threshold: float) -> Share:
    """
    Count the right ones of those that would be named from a probability on.

    A set whose first is more probable than a name must be is one of confounders that nothing
    separates, and is never named.
    """
    chosen = []
    for trial in done:
        if trial.answer.first is None or trial.answer.verdict not in ('named', 'one_of'):
            continue
        names, probability = trial.answer.first
        apart = trial.answer.verdict == 'named' or probability < CERTAIN
        if names and apart and probability >= threshold:
            chosen.append(names == trial.truth.names)
    return Share.over(chosen)


def name_threshold(done: Sequence[Trial], *, risk: float) -> float | None:
    """
    Return the lowest threshold whose names are wrong in at most a share; None: no threshold is.
    """
    for threshold in GRID:
        found = named_from(done, threshold)
        if (found.of - found.count + 1) / (found.of + 1) <= risk:
            return threshold
    return None


def share_needed(trial: Trial) -> float:
    """
    Return the share of the named probability that the truth is reached with; 1: it is not.
    """
    unnamed = {('unknown',)}
    found = [(names, p) for names, p in trial.answer.candidates if names not in unnamed]
    total = sum(p for _, p in found) / LISTED
    before = 0.0
    for names, probability in found:
        if names == trial.truth.names:
            return before / total
        before += probability
    return 1.0


def set_share(done: Sequence[Trial], *, part: float) -> float | None:
    """
    Return the share of the named probability that sets must hold; None: too few answers to say.
    """
    needed = sorted(share_needed(trial) for trial in sets(done))
    place = math.ceil((len(needed) + 1) * part)
    return needed[place - 1] if 0 < place <= len(needed) else None


def held_with(done: Sequence[Trial], share: float) -> Share:
    """
    Count the sets that would hold the truth, were they to hold a share of the named probability.
    """
    return Share.over(share_needed(trial) < share for trial in sets(done))


def wrong_at_most(found: Share, *, confidence: float) -> float:
    """
    Return the share of wrong ones that is not exceeded, after Clopper and Pearson.
    """
    if found.count == 0:
        return 1.0
    return float(beta.ppf(confidence, found.of - found.count + 1, found.count))


def needed(wrong: int, *, risk: float, confidence: float) -> int:
    """
    Return how many answers show that at most a share is wrong, if so many of them are.
    """
    number = wrong + 1
    while binom.cdf(wrong, number, risk) > 1.0 - confidence:
        number += 1
    return number


def sure_limit(by_limit: Mapping[float, Share], *, risk: float, confidence: float) -> float | None:
    """
    Return the loosest limit that is sure to hold; None: the strictest is not.

    Parameters
    ----------
    by_limit
        Right ones of those that a limit lets through, the strictest limit last.
    risk
        Share of wrong ones that is allowed.
    confidence
        With which it holds, whichever limit is taken: they are tried in one order.
    """
    taken = None
    for limit, found in reversed(by_limit.items()):
        if wrong_at_most(found, confidence=confidence) > risk:
            break
        taken = limit
    return taken


def sets(done: Sequence[Trial]) -> list[Trial]:
    """
    Return what was answered with a set, where something of the library is hidden.
    """
    known = ('one', 'pair')
    return [t for t in done if t.answer.verdict == 'one_of' and t.truth.kind in known]


def held(done: Sequence[Trial]) -> Share:
    """
    Count the sets that hold the truth.
    """
    return Share.over(
        trial.truth.names in [names for names, _ in trial.answer.candidates]
        for trial in sets(done)
    )


def read(path: Path, world: str) -> list[Trial]:
    """
    Read answers, and ask for the truth of their cases; mis-stated baselines are left out.
    """
    rows = [json.loads(line) for line in path.read_text(encoding='utf-8').splitlines()]
    done = trials([row for row in rows if 'error' not in row], world)
    return [trial for trial in done if not trial.truth.condition.misstated]


def print_sure(done: Sequence[Trial], *, risk: float, part: float, confidence: float) -> None:
    """
    Print what is sure of names and of sets, and how many answers would show what is wanted.
    """
    names = {limit: named_from(done, limit) for limit in GRID}
    holding = {limit: held_with(done, limit) for limit in SHARES}
    for what, by_limit, wanted, used in (
        ('names from', names, risk, CERTAIN),
        ('sets of', holding, 1.0 - part, LISTED),
    ):
        limit = sure_limit(by_limit, risk=wanted, confidence=confidence)
        print(f'with {confidence:.0%} confidence on a: {what} {_or_none(limit)}')
        found = by_limit[used]
        wrong, most = found.of - found.count, wrong_at_most(found, confidence=confidence)
        print(f'  {what} {used:g}, in use: wrong {wrong} of {found.of}, at most {most:.1%}')
        least = [needed(number, risk=wanted, confidence=confidence) for number in (0, wrong)]
        print(f'  {wanted:.0%} needs {least[0]} without a wrong one, {least[1]} with {wrong}')


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Print what is chosen, and what it gives.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('chosen_on', type=Path, help='answers about world a')
    parser.add_argument('--check', type=Path, help='answers about world b')
    parser.add_argument('--risk', type=float, default=0.02, help='of a wrong name')
    parser.add_argument('--part', type=float, default=0.95, help='of sets that hold the truth')
    parser.add_argument('--confidence', type=float, default=0.9, help='of the binomial bound')
    options = parser.parse_args(arguments)
    groups = {'a': read(options.chosen_on, 'a')}
    if options.check is not None:
        groups['b'] = read(options.check, 'b')
    for world, done in groups.items():
        print(f'world {world}: {len(done)} cases')
        for threshold in GRID:
            print(f'  named from {threshold:g}: right {named_from(done, threshold)}')
        reach = [share_needed(trial) for trial in sets(done)]
        if reach:
            share = float(np.quantile(reach, options.part))
            print(f'  sets that hold the truth: {held(done)}; share needed {share:.3f}')
    name = name_threshold(groups['a'], risk=options.risk)
    share_of_set = set_share(groups['a'], part=options.part)
    print(f'by risk control on a: names from {_or_none(name)}, in use {CERTAIN:g}')
    print(f'by split conformal on a: sets of {_or_none(share_of_set)}, in use {LISTED:g}')
    print_sure(groups['a'], risk=options.risk, part=options.part, confidence=options.confidence)


def _or_none(value: float | None) -> str:
    return 'nowhere (too few answers, or too many wrong)' if value is None else f'{value:.3f}'


if __name__ == '__main__':
    main()
