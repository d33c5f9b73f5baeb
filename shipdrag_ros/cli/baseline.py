# SPDX-License-Identifier: Apache-2.0
"""
Learn the baseline of a ship from clean runs: clean hull, calm deep water, no wind. Writes the
ship file with the baseline that they show, in the form that it has, and how well it is known
for a further run: what the runs leave open, and by how much they differ from each other. Five
runs show that well; with one or two the stated relative_sd is kept. Without a baseline in the
ship file, r(v) of the runs is written as a table.

Options
-------
BAG
    MCAP or rosbag2; {PART}
--ship FILE
    ship file (YAML); the baseline in it is taken for what was known before
--out FILE
    ship file to write, with the learnt baseline

Examples
--------
shipdrag baseline clean_1.mcap clean_2.mcap --ship ship.yaml -o learnt.yaml
shipdrag baseline clean_1.mcap --ship ship.yaml -o first.yaml --json baseline.json
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.cli.arguments import add, new_file
from shipdrag_ros.cli.output import Output, stages
from shipdrag_ros.cli.windowed import add_bags, open_windowed
from shipdrag_ros.display import Table
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from shipdrag_ros.diagnosis.learn_baseline import LearntBaseline


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    parser.add_argument('--ship', required=True, type=Path)
    parser.add_argument('-o', '--out', required=True, type=new_file('.yaml'))
    add(parser, '--remap', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Learn, write and show it.
    """
    # what follows takes half a second to import
    from shipdrag_ros.diagnosis.learn_baseline import learn_baseline
    from shipdrag_ros.library.diagnosing import coasts_of
    from shipdrag_ros.library.replaying import refuse_overlaps

    output = Output(options.json)
    if options.out.resolve() == options.ship.resolve():
        raise DiagnosisError(
            f'{str(options.out)!r} is the ship file itself, with what was known before; '
            'write to another file'
        )
    runs = open_windowed(options.bags, remap=options.remap, output=output)
    refuse_overlaps(runs)
    with stages(output) as progress:
        coasts, ship, parameters = coasts_of(output, runs, Ship.load(options.ship), progress)
    found = learn_baseline(coasts, ship, parameters)
    options.out.write_text(found.ship.to_yaml(), encoding='utf-8')
    _show(output, found)
    output.log(f'ship file with the learnt baseline in {options.out}')
    output.json(document(found, options.out))
    return 0


def document(found: LearntBaseline, out: Path) -> dict[str, Any]:
    """
    Return the document of a learnt baseline.
    """
    from shipdrag_ros.diagnosis.learn_baseline import ENOUGH

    enough = len(found.runs) >= ENOUGH
    scatter = found.shared.scatter, found.shared.scatter_low, found.shared.scatter_high
    return {
        'runs': [
            {
                'name': each.name,
                'factor': {'value': 1.0 + each.factor.value, 'sd': each.factor.sd},
                'chi2_per_sample': each.chi2_per_row,
            }
            for each in found.runs
        ],
        'factors': {
            name: {'value': value, 'sd': sd}
            for name, value, sd in zip(
                found.names, found.factors, np.sqrt(np.diag(found.covariance)), strict=True
            )
        },
        'covariance': found.covariance,
        'scatter': dict(zip(('value', 'low', 'high'), scatter if enough else [None] * 3)),
        'relative_sd': {
            'before': None
            if found.stated_sd is None
            else dict(zip(found.names, found.stated_sd, strict=True)),
            'after': dict(zip(found.names, found.relative_sd, strict=True)),
            'correlation': found.correlation,
        },
        'speed_m_s': found.speed_m_s,
        'warnings': found.warnings,
        'output': str(out),
    }


def _show(output: Output, found: LearntBaseline) -> None:
    from shipdrag_ros.diagnosis.learn_baseline import ENOUGH

    low, high = found.speed_m_s
    output.say(
        f'{found.ship.name or "The ship"}: baseline from {len(found.runs)} run(s) over '
        f'{low:.2f} to {high:.2f} m/s.'
    )
    output.heading('Learnt baseline over the one before')
    stated = found.stated_sd
    rows = []
    for i, name in enumerate(found.names):
        before = '-' if stated is None else f'{stated[i]:.1%}'
        sd = float(np.sqrt(found.covariance[i, i]))
        after = f'{found.relative_sd[i]:.1%}'
        rows.append((name, f'{found.factors[i]:.3f}', f'{sd:.3f}', before, after))
    columns = ('', 'factor', 'sd', 'relative_sd before', 'after')
    output.table(Table(columns, tuple(rows)))
    if len(found.runs) >= ENOUGH:
        output.say(
            f'Runs scatter by {found.shared.scatter:.1%} of their resistance '
            f'({found.shared.scatter_low:.1%} to {found.shared.scatter_high:.1%}).'
        )
    if len(found.runs) > 1:
        output.heading('Each run beside the others')
        beside = tuple(
            (
                one.name,
                f'{one.factor.value:+.1%}',
                f'{one.factor.sd:.1%}',
                f'{one.chi2_per_row:.2f}',
            )
            for one in found.runs
        )
        output.table(Table(('', 'resistance', 'sd', 'chi2 a sample'), beside))
    for warning in found.warnings:
        output.say(f'WARNING: {warning}')
