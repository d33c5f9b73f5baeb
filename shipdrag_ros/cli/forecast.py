# SPDX-License-Identifier: Apache-2.0
"""
Find the coastdowns in bags and foretell the rest of each, from what was known some time after
its stop: when she has each lower speed and how far on, with bands of 90 %, beside what
followed.

Options
-------
BAG
    bag; {PART}
--after S
    when forecasts are made, from each stop on [s] (default: {AFTER})
--if-stopped-now
    the glide that would begin at the end of the last bag, from the hull as last known: the last
    coastdown in the bags, or else the ship file; of BAG@START:END, now is END

Examples
--------
shipdrag forecast run.mcap --after 120 300
shipdrag forecast run.mcap --ship ship.yaml --json forecast.json
shipdrag forecast run.mcap --if-stopped-now
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from shipdrag_ros.cli.arguments import add, add_bags, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.replay import replayed
from shipdrag_ros.display import clock
from shipdrag_ros.forecast.followed import Passed
from shipdrag_ros.forecast.result import NO_WAY
from shipdrag_ros.library import forecasts

AFTER = ' '.join(f'{each:g}' for each in forecasts.AFTER_S)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    add(parser, '--ship', '--parameters')
    when = parser.add_mutually_exclusive_group()
    when.add_argument('--after', nargs='+', type=_after, default=forecasts.AFTER_S)
    when.add_argument('--if-stopped-now', action='store_true')
    add(parser, '--stop', '--remap', '--json')


def _after(text: str) -> float:
    try:
        return number(0.0, unit='s', above=True)(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(
            f'{error}; a bag stands before --after or behind --, as in --after 60 300 -- BAG'
        ) from error


def run(options: argparse.Namespace) -> int:
    """
    Foretell, and say what followed.
    """
    output = Output(options.json)
    # a window says when `now` is, not that she glides in it
    results = replayed(options, output, parts=options.if_stopped_now)
    for result in results:
        output.log(*(f'{result.bag}: {warning}' for warning in result.run.warnings))
    if options.if_stopped_now:
        stopped = forecasts.if_stopped_now(results)
        output.heading(stopped.bag)
        output.say(stopped.summary())
        if stopped.passed:
            output.table(stopped.table())
        output.json(document_of_stop(stopped))
        return 0
    found = forecasts.forecast(results, options.after)
    for each in found.made:
        _show(output, each)
    for bag, why in found.without:
        output.heading(bag)
        output.say(why)
    output.json(document(found))
    return 0


def _show(output: Output, each: forecasts.GlideForecast) -> None:
    output.heading(f'{each.bag}, {clock(each.after_s)} after the stop')
    output.say(forecasts.Forecasts((each,)).summary())
    if each.checked is not None:
        output.table(each.table())


def document(found: forecasts.Forecasts) -> dict[str, Any]:
    """
    Return the document of the verb; a forecast that was not made says why under `not_made`.
    """
    made: list[dict[str, Any]] = []
    not_made: list[tuple[object, ...]] = []
    for each in found.made:
        if each.checked is None:
            not_made.append((each.bag, each.stop_ns, each.after_s, each.why))
            continue
        made.append(
            {
                'bag': each.bag,
                'stop_ns': each.stop_ns,
                'made_ns': each.checked.forecast.made_ns,
                'over_ground': each.checked.forecast.over_ground,
                'speeds': [_milestone(one) for one in each.checked.milestones],
                'inside': each.checked.inside,
                'interval_score': each.checked.interval_score,
                'not_compared': each.why or None,
            }
        )
    not_made += [(bag, None, None, why) for bag, why in found.without]
    keys = ('bag', 'stop_ns', 'after_s', 'reason')
    return {'forecasts': made, 'not_made': [dict(zip(keys, each)) for each in not_made]}


def document_of_stop(found: forecasts.IfStopped) -> dict[str, Any]:
    """
    Return the document of `--if-stopped-now`: a forecast of which nothing has followed.
    """
    return {
        'if_stopped_now': {
            'bag': found.bag,
            'made_ns': found.forecast.made_ns,
            'speed_m_s': float(found.forecast.speed_m_s[0]),
            'measured': found.measured,
            'hull': found.hull,
            'gliding': found.gliding,
            'over_ground': found.forecast.over_ground,
            'speeds': [_milestone(each) for each in found.passed],
            'why': None if found.passed else NO_WAY,
        }
    }


def _milestone(one: Passed) -> Mapping[str, Any]:
    return {
        'speed_m_s': one.foretold.speed_m_s,
        'time_s': {**one.foretold.time_s._asdict(), 'was': one.was_s},
        'distance_m': {**one.foretold.distance_m._asdict(), 'was': one.was_m},
    }
