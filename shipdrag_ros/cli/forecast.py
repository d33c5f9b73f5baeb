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

from shipdrag_ros.cli.arguments import add, add_bags, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.replay import replayed
from shipdrag_ros.display import clock
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
        output.json(stopped.to_dict())
        return 0
    found = forecasts.forecast(results, options.after)
    for each in found.made:
        _show(output, each)
    for bag, why in found.without:
        output.heading(bag)
        output.say(why)
    output.json(found.to_dict())
    return 0


def _show(output: Output, each: forecasts.GlideForecast) -> None:
    output.heading(f'{each.bag}, {clock(each.after_s)} after the stop')
    output.say(forecasts.Forecasts((each,)).summary())
    if each.checked is not None:
        output.table(each.table())
