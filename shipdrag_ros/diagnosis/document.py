# SPDX-License-Identifier: Apache-2.0
"""The JSON document of `diagnose` and of `~/diagnosis`, whose keys others rely on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.result import (
    DiagnosisResult,
    EffectEstimate,
    Gap,
    RunSize,
    SeenRun,
    WeighedEarlier,
    WeighedFact,
)
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find


def document(found: DiagnosisResult, ship: Ship | None) -> dict[str, Any]:
    """
    Return the document of a diagnosis.

    The candidate `none` says that nothing is missing, `unknown` that it is
    something without a name.
    """
    return {
        'sentence': words.sentence(found),
        'question': found.question or None,
        'verdict': str(found.verdict),
        'effects': sized(found.effects),
        'candidates': candidates(found),
        'would_decide': [each.measure for each in found.would_decide],
        'resolves': {each.measure: each.probability for each in found.would_decide},
        'advice': [
            {**asdict(each), 'text': line}
            for each, line in zip(found.would_decide, words.advice(found), strict=True)
        ],
        'limits': _limits(found),
        'where': None if found.where is None else asdict(found.where),
        'gap': {
            'before': _gap(found.before),
            'after': _gap(found.after) or {},
            'held_out_before': _gap(found.held_out_before),
            'held_out_after': _gap(found.held_out_after),
        },
        'baseline': found.baseline,
        'coastdowns_used': found.coastdowns_used,
        'examined': list(found.examined),
        'no_coastdown': found.no_coastdown or None,
        'notes': list(found.notes),
        'runs_differ': sizes_of_runs(found.runs_differ),
        'facts': [_fact(each) for each in found.facts],
        'ship': None
        if ship is None
        else {
            'name': ship.name,
            'length_m': ship.length_m,
            'effects': [effect.name for effect in ship.effects],
        },
        'runs': _runs(found.runs),
        'earlier': [_earlier(each) for each in found.earlier],
    }


def _limits(found: DiagnosisResult) -> dict[str, dict[str, Any]]:
    return {
        name: {
            'parameter': each.parameter,
            each.bound: each.value,
            'would_be_named': each.would_be_named,
            'percent_of_r': each.percent_of_r,
        }
        for name, each in found.limits.items()
    }


def _fact(weighed: WeighedFact) -> dict[str, Any]:
    return {
        **asdict(weighed.fact),
        'bag': weighed.run or None,
        'wrong': weighed.wrong,
        'contradicted': weighed.contradicted,
        'against': list(weighed.against),
    }


def _runs(runs: Sequence[SeenRun]) -> list[dict[str, Any]]:
    return [{'bag': run.name, 'time_ns': run.time_ns} for run in runs]


def _earlier(given: WeighedEarlier) -> dict[str, Any]:
    return {
        'file': given.name,
        'used': given.used,
        'runs': _runs((*given.runs, *given.before)),
        'effects': [{**asdict(each), 'contradicted': each.contradicted} for each in given.effects],
        'unused': list(given.unused),
    }


def sizes_of_runs(sizes: Sequence[RunSize]) -> list[dict[str, Any]]:
    """
    Return the size of an effect in each of some runs that differ.
    """
    return [
        {
            'bag': each.run,
            'effect': each.effect,
            'parameter': each.parameter,
            'value': each.size.value,
            'sd': each.size.sd,
        }
        for each in sizes
    ]


def sized(effects: Sequence[EffectEstimate]) -> list[dict[str, Any]]:
    """
    Return effects with their probabilities and sizes.
    """
    return [
        {
            'name': effect.name,
            'probability': effect.probability,
            'parameters': dict(_sizes(effect)),
        }
        for effect in effects
    ]


def _sizes(effect: EffectEstimate) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the sizes of an effect by name, as figures and in words."""
    declared = {quantity.name: quantity for quantity in find(effect.name).parameters}
    for name, size in effect.parameters.items():
        text = f'{words.quantity_text(declared[name])}: {words.size(declared[name], size)}'
        yield name, {'value': size.value, 'sd': size.sd, 'text': text}


def candidates(found: DiagnosisResult) -> list[dict[str, Any]]:
    """
    Return the candidates, each with its sizes.
    """
    return [
        {
            'names': list(each.names) or ['none'],
            'probability': each.probability,
            'effects': sized(each.effects),
        }
        for each in found.candidates
    ]


def _gap(gap: Gap | None) -> dict[str, Any] | None:
    return None if gap is None else asdict(gap)
