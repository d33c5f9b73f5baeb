# SPDX-License-Identifier: Apache-2.0
"""Tables of a diagnosis as text, the same in the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.result import Compared, DiagnosisResult, EffectEstimate, RunTrace
from shipdrag_ros.display import TRACK_LABELS, Table, plus_minus
from shipdrag_ros.simulation.effects import find


def probabilities(found: DiagnosisResult) -> Table:
    """
    Show how probable each answer is.
    """
    rows = tuple(
        (each.words, words.probability(each.probability)) for each in words.answers(found)
    )
    return Table(('what is missing', 'probability'), rows)


def parameters(effects: Sequence[EffectEstimate]) -> Table:
    """
    Show how large effects are; the names are those of `simulate --effect`.
    """
    rows = tuple((effect.name, *row) for effect in effects for row in _parameters(effect))
    return Table(('effect', 'parameter', 'value', 'sd', 'meaning'), rows)


def sizes(found: DiagnosisResult) -> Table:
    """
    Show how large what is named is, or each candidate would be, were it the one.
    """
    if found.effects:
        return parameters(found.effects)
    rows = tuple(
        (words.names_text(each.names), words.probability(each.probability), *row)
        for each in found.candidates
        for effect in each.effects
        for row in _parameters(effect)
    )
    return Table(('candidate', 'probability', 'parameter', 'value', 'sd', 'meaning'), rows)


def limits(found: DiagnosisResult) -> Table:
    """
    Show how large each effect that is not named can be, and from what size on it would be named.
    """
    rows = [
        (
            words.names_text([name]),
            quantity.name,
            f'{"at least" if each.bound == "lower_95" else "at most"} {each.value:.2g}',
            '-' if least is None else f'{least:.2g}' if least else 'any size',
            '-' if math.isnan(each.percent_of_r) else f'{each.percent_of_r:.1f} %',
        )
        for name, each in found.limits.items()
        for quantity, least in [(find(name).parameters[0], each.would_be_named)]
    ]
    heads = ('effect', 'parameter', 'if it is there, 95 %', 'would be named from', 'of r')
    return Table(heads, tuple(rows))


def _parameters(effect: EffectEstimate) -> Iterator[tuple[str, ...]]:
    """Yield name, value, sd and meaning of each parameter; what was a choice has no sd."""
    for quantity in find(effect.name).parameters:
        found = effect.parameters[quantity.name]
        value, sd = words.size(quantity, found), '-'
        if found.sd != 0.0:
            value, _, sd = plus_minus(found.value, found.sd).partition(' ± ')
        yield quantity.name, value, sd, quantity.meaning


def facts(found: DiagnosisResult) -> Table:
    """
    Show the facts that were stated, and how probable it is that each is wrong.
    """
    rows = [
        (
            str(each.fact),
            each.run or 'all',
            f'{each.fact.words}',
            '-' if each.wrong is None else words.probability(each.wrong),
        )
        for each in found.facts
    ]
    return Table(('fact', 'of run', 'says', 'wrong with probability'), tuple(rows))


def gaps(found: DiagnosisResult) -> Table:
    """
    Show how far model and data are apart.
    """
    named = 'a constant part'  # where no effect has a size
    if found.best:
        named = words.names_text([effect.name for effect in found.best])
    known = {
        words.model(found): found.before,
        f'with {named}': found.after,
        f'each run predicted, {words.model(found)}': found.held_out_before,
        f'each run predicted, with {named} learnt from the others': found.held_out_after,
    }
    rows = [
        (
            name,
            _number(gap.rms_speed_m_s, '.3f'),
            _number(gap.rms_position_m, '.1f'),
            '-' if math.isnan(gap.chi2_per_sample) else f'{gap.chi2_per_sample:.2f}',
        )
        for name, gap in known.items()
        if gap is not None
    ]
    return Table(
        ('', 'speed rms [m/s]', 'position rms [m]', 'chi² a sample; noise: 1'), tuple(rows)
    )


def noise(traces: Sequence[RunTrace]) -> Table:
    """
    Show what the noise of each measurement is, and what is left of it.
    """
    rows = [
        (f'{trace.name}: {label.lower()} [{unit}]', *_noise(compared))
        for trace in traces
        for compared in trace.compared
        for label, unit in (TRACK_LABELS[compared.quantity],)
    ]
    heads = ('', 'sd in steady sailing', 'at the end', 'left over before', 'left over after')
    return Table(heads, tuple(rows))


def _noise(compared: Compared) -> tuple[str, ...]:
    steady = compared.time_s < 0.0
    figures = (
        float(np.median(compared.sd[steady if steady.any() else ...])),
        float(compared.sd[-1]),
        *(
            float(np.sqrt(np.mean((compared.measured - simulated) ** 2)))
            for simulated in (compared.before, compared.after)
        ),
    )
    return tuple(f'{figure:.0f}' if figure >= 100.0 else f'{figure:.2g}' for figure in figures)


def _number(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)
