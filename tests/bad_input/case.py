# SPDX-License-Identifier: Apache-2.0
"""One kind of bad input: how it is made, and what the user sees."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from unittest.mock import patch

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli import main
from shipdrag_ros.messages import EncodedMessage, encode
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

ROOT = Path(__file__).resolve().parents[2]
SHIP_FILE = ROOT / 'config' / 'vitus_bering.yaml'
SECOND_NS = 1_000_000_000
STEADY_S = 300.0


@dataclass(frozen=True)
class Case:
    """
    A kind of bad input.

    Attributes
    ----------
    area, kind
        What is bad about what.
    line
        Makes it in a new folder; returns the command line of `shipdrag`.
    status
        Exit code that is right.
    says
        What the user must read, to the letter.
    """

    area: str
    kind: str
    line: Callable[[Path], list[str]]
    status: int
    says: tuple[str, ...]


@dataclass(frozen=True)
class Seen:
    """What came of it: exit code and everything printed, without the folder's name."""

    status: int
    text: str


def run(case: Case, folder: Path) -> Seen:
    """
    Make the bad input and run the command; what is no user error is raised.
    """
    line = case.line(folder)
    output = StringIO()
    usage_in_a_line = patch.dict(os.environ, COLUMNS='200')
    with redirect_stdout(output), redirect_stderr(output), usage_in_a_line:
        try:
            status = main(line)
        except SystemExit as end:
            status = int(end.code or 0)
    return Seen(status, output.getvalue().replace(f'{folder}/', ''))


@cache
def steady() -> Block:
    """
    Return 300 s of steady sailing: log, position, heading and shaft at 1 Hz.
    """
    return _sail(STEADY_S, 1.0)


@cache
def coastdown() -> Block:
    """
    Return 600 s of steady sailing and 1200 s of a coastdown, the log alone.
    """
    block = _sail(600.0, 1200.0)
    return block[block.channel == Channel.SPEED_THROUGH_WATER]


def _sail(lead_in_s: float, duration_s: float) -> Block:
    truth = simulate(
        Ship.load(SHIP_FILE), Scenario(speed_m_s=8.0, lead_in_s=lead_in_s, duration_s=duration_s)
    )
    sensors = (
        Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.05),
        Sensor(channel=Channel.POSITION, sd=10.0),
        Sensor(channel=Channel.HEADING, sd=0.01),
        Sensor(channel=Channel.SHAFT, sd=0.02),
    )
    return sense(truth, sensors, seed=1, start_ns=START_NS)


def write(path: Path, block: Block, *, ship: bool = True, namespace: str = '') -> Path:
    """
    Write samples as a bag, small chunks in it.
    """
    return write_messages(path, list(encode(block, namespace=namespace)), ship=ship)


def write_messages(path: Path, messages: list[EncodedMessage], *, ship: bool = True) -> Path:
    """
    Write messages as a bag, small chunks in it.
    """
    with BagWriter(path, chunk_bytes=16384) as bag:
        if ship:
            bag.attach('ship.yaml', SHIP_FILE.read_text(encoding='utf-8'))
        for message in messages:
            bag.put(
                EncodedMessage(
                    message.topic,
                    message.type,
                    message.payload,
                    log_ns=message.log_ns,
                    publish_ns=message.publish_ns,
                )
            )
    return path
