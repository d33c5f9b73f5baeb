# SPDX-License-Identifier: Apache-2.0
"""What the answers of a diagnosis are worth, once the truth is known."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.worlds.hidden.cases import Truth

LARGEST_SET = 3  # names; nothing and unknown may stand beside them
_SET = 0.9  # what a set holds at least, as the headline has it
_BINS = 10
_LEAST = 0.003  # probability of an answer that is not listed
Names = tuple[str, ...]
UNKNOWN: Names = ('unknown',)


@dataclass(frozen=True)
class Answer:
    """
    A verdict, in the form of `diagnose --json`.

    Attributes
    ----------
    verdict
        `none`, `named`, `one_of` or `unknown`.
    named
        What it names, in alphabetical order.
    candidates
        Names and probability, most probable first; () is none.
    parameters
        Value and standard deviation, by effect and parameter.
    held_out_chi2
        Per sample, after the effect was added.
    """

    verdict: str
    named: Names
    candidates: tuple[tuple[Names, float], ...]
    parameters: Mapping[str, Mapping[str, tuple[float, float]]]
    held_out_chi2: float | None

    @property
    def first(self) -> tuple[Names, float] | None:
        """The most probable candidate."""
        return self.candidates[0] if self.candidates else None

    def holds(self, names: Names) -> bool:
        """
        Say whether it names them, or a small set that holds them.
        """
        if self.verdict == 'named':
            return self.named == names
        found, held = [], 0.0
        for candidate, probability in self.candidates:
            if held >= _SET:
                break
            found.append(candidate)
            held += probability
        listed = [each for each in found if each not in ((), UNKNOWN)]
        return self.verdict == 'one_of' and len(listed) <= LARGEST_SET and names in found


def parse(found: Mapping[str, Any]) -> Answer:
    """
    Read an answer in the form of `diagnose --json`.
    """
    candidates = tuple(
        (_names(item['names']), float(item['probability'])) for item in found['candidates']
    )
    after = (found.get('gap') or {}).get('held_out_after') or {}
    return Answer(
        found['verdict'],
        _names(effect['name'] for effect in found['effects']),
        candidates,
        {
            effect['name']: {
                name: (float(at['value']), float(at['sd']))
                for name, at in effect['parameters'].items()
                if isinstance(at, Mapping) and at.get('sd') is not None
            }
            for effect in found['effects']
        },
        after.get('chi2_per_sample'),
    )


def _names(names: Iterable[str]) -> Names:
    return tuple(sorted(name for name in names if name != 'none'))


@dataclass(frozen=True)
class Trial:
    """
    One case: the truth, the answer, and its CPU time.
    """

    truth: Truth
    answer: Answer
    cpu_s: float


@dataclass(frozen=True)
class Share:
    """
    Count out of a number.
    """

    count: int
    of: int

    @classmethod
    def over(cls, outcomes: Iterable[bool]) -> Share:
        """
        Count what is true.
        """
        listed = [bool(outcome) for outcome in outcomes]
        return cls(sum(listed), len(listed))

    def __str__(self) -> str:
        return f'{100 * self.count / self.of:.1f} % of {self.of}' if self.of else 'none of 0'


def scores(trials: Sequence[Trial]) -> dict[str, Share | float]:
    """
    Return every figure by its name, over the trials given.
    """

    def of(kind: str) -> list[Trial]:
        return [trial for trial in trials if trial.truth.kind == kind]

    ones, pairs, outside, none = (of(kind) for kind in ('one', 'pair', 'outside', 'none'))
    first_shelf = [trial for trial in ones if trial.truth.shelf == 1]
    named, everywhere = (
        [trial for trial in some if trial.answer.verdict == 'named'] for some in (ones, trials)
    )
    right = [trial for trial in named if _right(trial)]
    chi2 = [
        trial.answer.held_out_chi2 for trial in right if trial.answer.held_out_chi2 is not None
    ]

    def said(verdict: str, some: list[Trial]) -> Share:
        return Share.over(trial.answer.verdict == verdict for trial in some)

    return {
        'precision of a name': Share.over(map(_right, named)),
        'precision, whatever is hidden': Share.over(map(_right, everywhere)),
        'named, first shelf': Share.over(map(_right, first_shelf)),
        'name or set of <= 3 with the truth, first shelf': _covered(first_shelf),
        'name or set of <= 3 with the truth, second shelf': _covered(
            [trial for trial in ones if trial.truth.shelf == 2]
        ),
        'most probable is right': Share.over(
            trial.answer.first is not None and trial.answer.first[0] == trial.truth.names
            for trial in ones
        ),
        'alarm, nothing hidden': Share.over(trial.answer.verdict != 'none' for trial in none),
        'false name, nothing hidden': said('named', none),
        'unknown, outside the library': said('unknown', outside),
        'falsely named, outside the library': said('named', outside),
        'pair in the answer': Share.over(map(_has_pair, pairs)),
        'expected calibration error': calibration_error(
            [
                (trial.answer.first[1], trial.answer.first[0] == _answer_sought(trial.truth))
                for trial in trials
                if trial.answer.first is not None
            ]
        ),
        'log probability of the truth, mean': float(
            np.mean([math.log(_stated(trial)) for trial in trials])
        ),
        'held-out chi^2 per sample, median': float(np.median(chi2)) if chi2 else float('nan'),
        'held-out chi^2 per sample <= 1.1': Share.over(value <= 1.1 for value in chi2),
        'parameters within 2 sd': Share.over(
            inside for trial in right for inside in _parameters(trial)
        ),
        'CPU s a case, median': float(np.median([trial.cpu_s for trial in trials])),
        'CPU s a case, 95 % are below': float(np.quantile([t.cpu_s for t in trials], 0.95)),
    }


def _stated(trial: Trial) -> float:
    """Return the probability of the truth; `_LEAST` where it is not listed."""
    sought = _answer_sought(trial.truth)
    listed = dict(trial.answer.candidates).get(sought, 0.0)
    return min(max(listed, _LEAST), 1.0)


def calibration_error(stated: Sequence[tuple[float, bool]]) -> float:
    """
    Return the expected calibration error over ten bins of probability.

    Parameters
    ----------
    stated
        Probability, and whether it was so.
    """
    if not stated:
        return float('nan')
    probability = np.array([p for p, _ in stated])
    was_so = np.array([so for _, so in stated], np.float64)
    place = np.minimum((probability * _BINS).astype(int), _BINS - 1)
    return float(
        sum(
            abs(probability[place == k].mean() - was_so[place == k].mean()) * np.mean(place == k)
            for k in np.unique(place)
        )
    )


def confusion(trials: Sequence[Trial]) -> dict[str, Counter[str]]:
    """
    Count the answers by what was hidden.
    """
    table: dict[str, Counter[str]] = {}
    for trial in trials:
        truth = ' + '.join(trial.truth.names) or 'nothing'
        if trial.truth.kind == 'outside':
            truth = f'({truth})'
        table.setdefault(truth, Counter())[_label(trial)] += 1
    return dict(sorted(table.items()))


def _label(trial: Trial) -> str:
    answer = trial.answer
    match answer.verdict:
        case 'named':
            return ' + '.join(answer.named)
        case 'one_of':
            inside = trial.truth.names in [names for names, _ in answer.candidates]
            return 'a set with it' if inside else 'a set without it'
        case verdict:
            return verdict


def _right(trial: Trial) -> bool:
    return trial.answer.verdict == 'named' and trial.answer.named == trial.truth.names


def _covered(trials: Iterable[Trial]) -> Share:
    return Share.over(trial.answer.holds(trial.truth.names) for trial in trials)


def _has_pair(trial: Trial) -> bool:
    found = [names for names, _ in trial.answer.candidates]
    return trial.truth.names in (trial.answer.named, *found)


def _answer_sought(truth: Truth) -> Names:
    return UNKNOWN if truth.kind == 'outside' else truth.names


def _parameters(trial: Trial) -> Iterable[bool]:
    """Yield of each parameter that is known of both whether it is within 2 sd."""
    for effect, true in trial.truth.parameters.items():
        found = trial.answer.parameters.get(effect, {})
        for name in true.keys() & found.keys():
            value, sd = found[name]
            yield abs(value - true[name]) <= 2.0 * sd
