# SPDX-License-Identifier: Apache-2.0
"""What the diagnosis says, for the page: from the node's health, or from a diagnosis itself."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shipdrag_ros.messages.heard import Status

if TYPE_CHECKING:  # slow to import, and needed only once there is one
    from shipdrag_ros.diagnosis import DiagnosisResult

_NO_SIZE = re.compile(r'probability|mean square|standard deviation|coastdown')
_OPTION = re.compile(r' \(--fact [^)]*\)')  # of the command line, which a bridge has not
_SETS_SIZED = 3  # candidates whose sizes are shown


@dataclass(frozen=True)
class VerdictView:
    """
    A verdict, ready to be shown.

    Attributes
    ----------
    state
        As the node has it: `none yet`, `running`, `done`, ...
    sentence
    sizes
        Name and text of each size; of a set, what each candidate would have.
    probabilities
        Name and share of each candidate.
    decide
        What would decide, a line each.
    """

    state: str
    sentence: str
    sizes: tuple[tuple[str, str], ...] = ()
    probabilities: tuple[tuple[str, float], ...] = ()
    decide: tuple[str, ...] = ()


def of_status(status: Status) -> VerdictView:
    """
    Read the status `diagnosis` of a node.
    """
    values = status.values
    sizes, probabilities, decide = [], [], []
    for key, text in values.items():
        name, _, unit = key.partition(' [')
        unit = unit.rstrip(']').removesuffix('1')
        if name.startswith('note '):
            continue
        if name.startswith('advice'):
            decide.append(_OPTION.sub('', text))
        elif name.startswith(('probability of ', 'probability that ')):
            try:
                share = float(text)
            except ValueError:
                continue
            probabilities.append((re.sub('^probability (of|that) ', '', name), share))
        elif ', ' in name and not _NO_SIZE.match(name):
            sd = status.number(f'standard deviation of {name}')
            spread = f' ± {2.0 * sd:.2g}' if sd else ''
            sizes.append((name.replace('_', ' '), f'{text}{spread} {unit}'.strip()))
    probabilities.sort(key=lambda each: -each[1])
    return VerdictView(
        values.get('state', ''),
        status.message,
        tuple(sizes),
        tuple(probabilities),
        tuple(decide),
    )


def of_diagnosis(found: DiagnosisResult, caveat: str = '') -> VerdictView:
    """
    Take a diagnosis.

    Parameters
    ----------
    found
    caveat
        What it has not looked at, a sentence.
    """
    from shipdrag_ros.diagnosis import words
    from shipdrag_ros.simulation.effects import LIBRARY

    sized = [(effect.name, effect) for effect in found.effects]
    if not sized:
        sized = [
            (
                f'if {" + ".join(each.names)}' + (f', {effect.name}' if each.names[1:] else ''),
                effect,
            )
            for each in found.candidates[:_SETS_SIZED]
            for effect in each.effects
        ]
    sizes = [
        (
            f'{before}, {words.quantity_text(quantity)}'.replace('_', ' '),
            words.size(quantity, effect.parameters[quantity.name]),
        )
        for before, effect in sized
        for quantity in LIBRARY[effect.name].parameters
    ]
    return VerdictView(
        'done',
        ' '.join(filter(None, [words.sentence(found), caveat])),
        tuple(sizes),
        tuple((each.words, each.probability) for each in words.answers(found)),
        tuple(_OPTION.sub('', line) for line in words.advice(found)),
    )
