# SPDX-License-Identifier: Apache-2.0
"""`shipdrag node`: the onboard node, started without a ROS tool."""

from __future__ import annotations

import argparse
from pathlib import Path

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.ship import Ship


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument(
        '--ship', required=True, type=Path, metavar='FILE', help='ship file (YAML)'
    )
    parser.add_argument(
        '--out',
        required=True,
        type=Path,
        metavar='DIR',
        help='where recordings are written; made if missing, nothing there is overwritten',
    )
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help='last: the rest goes to ROS, for instance -p window_s:=1800.0 or -r position:=/gps',
    )


def run(options: argparse.Namespace) -> int:
    """
    Run the node until SIGINT or SIGTERM.
    """
    Ship.load(options.ship)  # here its problems are told before ROS starts
    try:
        from shipdrag_ros.node import main
    except ModuleNotFoundError as error:
        raise no_ros(error) from error
    return main.run(options.ship, options.out, ros_arguments=options.ros_args)


def no_ros(error: ModuleNotFoundError) -> ShipdragError:
    """
    Say how to install what is missing.
    """
    return ShipdragError(
        f'ROS 2 is not installed here (no module {error.name!r}); run `pip install .[ros]` in '
        'the source tree, or source the set-up file of a ROS 2 Jazzy installation'
    )
