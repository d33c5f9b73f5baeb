# SPDX-License-Identifier: Apache-2.0
"""
A learnt effect is data: a formula with units, which is read and never run. `check` refuses
wrong units, names that are not known, poles inside the valid range and all that is no
formula; `list` shows the effects of the library and of the folders given.

Options
-------
FILE
    learnt effect (YAML)

Examples
--------
shipdrag effect check effects/weed.yaml
shipdrag effect list --effects effects
"""

from __future__ import annotations

import argparse
from pathlib import Path

from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table
from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.ship import LearntTerm
from shipdrag_ros.ship.expression import unit_text
from shipdrag_ros.simulation.effects import LIBRARY, terms


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    verbs = parser.add_subparsers(
        title='what to do', metavar='WHAT', dest='what', required=True, help='check or list'
    )
    check = verbs.add_parser('check', help='may a file be used, and if not, why')
    check.add_argument('files', nargs='+', type=Path, metavar='FILE')
    add(check, '--json')
    every = verbs.add_parser('list', help='the effects of the library, and those learnt')
    add(every, '--effects', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Check files, or list effects.
    """
    output = Output(options.json)
    return _check(options.files, output) if options.what == 'check' else _list(output)


def _check(files: list[Path], output: Output) -> int:
    document = []
    refused: list[str] = []
    for path in files:
        try:
            term = LearntTerm.load(path)
        except EffectFileError as error:
            refused += [f'{path}: {problem}' for problem in error.problems]
            continue
        unit = unit_text(term.units[0])
        output.say(f'{path}: {term.name} can be used: {term.term.expression} [{unit}]')
        document.append({'file': str(path), 'name': term.name, 'channel': term.term.channel})
    output.json({'effects': document, 'refused': refused})
    if refused:
        raise EffectFileError('learnt effects', refused)
    return 0


def _list(output: Output) -> int:
    rows, document = [], []
    for effect in LIBRARY.values():
        where = 'learnt' if terms([effect.name]) else 'library'
        sizes = ', '.join(f'{q.name} [{q.unit or "-"}]' for q in effect.parameters)
        rows.append((effect.name, effect.scope.value, sizes, where))
        names = [q.name for q in effect.parameters]
        document.append(
            {'name': effect.name, 'scope': effect.scope.value, 'parameters': names, 'from': where}
        )
    output.table(Table(('effect', 'scope', 'parameters', 'from'), tuple(rows)))
    output.json({'effects': document})
    return 0
