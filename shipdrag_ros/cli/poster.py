# SPDX-License-Identifier: Apache-2.0
"""
Stopping without engine, from the store of `shipdrag fleet`: time and way from speed to speed
with bands of 90 %, of all runs of each ship. One page to print, beside the wheelhouse poster
of IMO Resolution A.601(15), Appendix 2.

Options
-------
--report FILE.html
    write the page with its pictures to one HTML file

Examples
--------
shipdrag poster store --report poster.html
shipdrag poster store --json poster.json
"""

from __future__ import annotations

import argparse

from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output
from shipdrag_ros.imports import need
from shipdrag_ros.ship import Ship

SHIP_FILE = 'ship.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add(parser, 'store', '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Show the table of each ship.
    """
    need('pyarrow')
    from shipdrag_ros.fleet.store import read_coastdowns, ship_texts
    from shipdrag_ros.trend.poster import poster, table, write_poster

    output = Output(options.json)
    rows = read_coastdowns(options.store).to_pylist()
    texts = ship_texts(options.store)
    posters = []
    for name in dict.fromkeys(row['ship'] for row in rows):
        text = texts.get(name, {}).get(SHIP_FILE)
        if text is None:
            output.say(f'{name}: no table, as the store keeps no ship file of her for n_r.')
            continue
        ship = Ship.from_yaml(text, subject=f'{name}: {SHIP_FILE}')
        found = poster(ship, [row for row in rows if row['ship'] == name])
        posters.append(found)
        output.heading(name)
        if found.steps:
            output.table(table(found))
        else:
            output.say(f'None of {len(found.runs)} coastdowns has a curve over a step of speed.')
    if not rows:
        output.say('The store holds no coastdown: no table.')
    if options.report is not None:
        write_poster(options.report, posters)
        output.log(f'page in {options.report}')
    output.json(
        {
            'ships': [
                {
                    'name': each.ship.name,
                    'coastdowns': len(each.runs),
                    'steps': [
                        {
                            'from_m_s': step.from_m_s,
                            'to_m_s': step.to_m_s,
                            'runs': step.runs,
                            'time_s': step.time_s._asdict(),
                            'distance_m': step.way_m._asdict(),
                        }
                        for step in each.steps
                    ],
                }
                for each in posters
            ]
        }
    )
    return 0
