# SPDX-License-Identifier: Apache-2.0
"""A diagnosis in words."""

from __future__ import annotations

from collections.abc import Sequence

from shipdrag_ros.diagnosis import Candidate, Diagnosis, Verdict

_CHANNELS = {
    'log': 'in the speed log',
    'radar': 'in radar or GNSS',
    'log_radar': 'between log and radar, which of them cannot be told',
    'force': 'in the force on the ship',
}


def sentence(found: Diagnosis) -> str:
    """
    Return the verdict in a sentence.
    """
    match found.verdict:
        case Verdict.NONE:
            return (
                'Model and data agree: nothing is missing that these runs could show '
                f'(probability {found.nothing:.2f}).'
            )
        case Verdict.NAMED:
            sizes = ', '.join(
                f'{effect.name} ({_sizes(effect.parameters)})' for effect in found.effects
            )
            return (
                f'Missing in the model: {sizes}, probability {found.effects[0].probability:.3f}.'
            )
        case Verdict.ONE_OF:
            one_of = _listed(found.candidates)
            return f'Missing is one of {one_of}; these runs cannot tell them apart.'
        case Verdict.UNKNOWN:
            return f'Something is missing that is none of the known effects, {_place(found)}.'


def advice(found: Diagnosis) -> list[str]:
    """
    Return what would decide, a line each.
    """
    lines = []
    for each in found.would_decide:
        known = '' if each.probability is None else f' (would decide in {each.probability:.0%})'
        lines.append(f'What would decide: {each.measure}{known}')
    return lines


def _sizes(parameters: object) -> str:
    assert isinstance(parameters, dict)
    return ', '.join(f'{name} {v.value:.3g} ± {v.sd:.1g}' for name, v in parameters.items())


def _listed(candidates: Sequence[Candidate]) -> str:
    return '; '.join(
        f'{" + ".join(each.names) or "nothing"} ({each.probability:.2f})' for each in candidates
    )


def _place(found: Diagnosis) -> str:
    if found.where is None:
        return 'somewhere'
    where = found.where
    return (
        f'{_CHANNELS[where.channel]}, {where.time_s[0]:.0f} to {where.time_s[1]:.0f} s after the '
        f'stop, at {where.speed_m_s[0]:.1f} to {where.speed_m_s[1]:.1f} m/s'
    )
