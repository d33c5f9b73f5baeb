# SPDX-License-Identifier: Apache-2.0
"""One live line in a terminal: state, speed, last figure, inputs."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from typing import Any, TextIO

from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.messages.heard import OK, Health, health_of

_CLEAR = '\x1b[K'


def terminal_line(stream: TextIO) -> Callable[[Any], None] | None:
    """
    Return what shows each message of /diagnostics on a terminal; None where there is none.

    Parameters
    ----------
    stream
        Of the log; the line is left of the cursor, so that a log line writes over it.
    """
    if not stream.isatty():
        return None

    def show(message: Any) -> None:
        for health in health_of(message.status):
            width = shutil.get_terminal_size().columns
            text = line(health)
            stream.write(f'{text[: width - 1]}{_CLEAR}\r')
            stream.flush()

    return show


def line(health: Health) -> str:
    """
    Return a node's health in a line.
    """
    state, estimate = health.of('state'), health.of('estimate')
    monitor = '' if state is None else state.values.get('monitor', '')
    said = [monitor or 'not active']
    if state is not None and monitor == 'steady':
        lead_s, used_s = state.number('steady lead'), state.number('steady lead used at most')
        if lead_s is not None and used_s is not None:
            said[0] = f'steady {lead_s / 60.0:.0f} of {used_s / 60.0:.0f} min'
    if state is not None and state.level != OK and not state.message.startswith(f'{monitor};'):
        said[0] = state.message  # inputs that are not well are named behind it
    if estimate is not None:
        speed = estimate.number('speed through water')
        r = estimate.number('specific resistance')
        sigma = estimate.number('standard deviation of it')
        if speed is not None and r is not None and sigma is not None:
            band = f' ± {200.0 * sigma / r:.0f} %' if r > 0.0 else ''
            said.append(f'last at {speed / M_S_PER_KNOT:.1f} kn: r {r:.4f} m/s²{band}')
    heard = [status for status in health.inputs if status.number('messages')]
    bad = [status.input for status in heard if status.level != OK]
    said.append(f'{len(heard)} inputs' + (f', not well: {", ".join(bad)}' if bad else ''))
    return ' | '.join(said)
