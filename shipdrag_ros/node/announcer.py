# SPDX-License-Identifier: Apache-2.0
"""
What the log keeps of the health: each change, once.

/diagnostics is sent every second and kept by nobody; the log is what is read
the day after.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from shipdrag_ros.coastdown.events import Event
from shipdrag_ros.node.compiling import Compiling
from shipdrag_ros.node.health import InputState
from shipdrag_ros.node.judging import Level
from shipdrag_ros.node.log_lines import line_of
from shipdrag_ros.samples import MOTION_INPUTS

SILENCE_SAID_AFTER_S = 10.0
COMPILING_SAID_AFTER_S = 3.0  # to load what was kept is faster
AGAIN_S = 10.0  # a finding that comes and goes is said this often at most


class Announcer:
    """
    Writes changes into the log of a node.

    Parameters
    ----------
    logger
        Of rclpy.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._levels: dict[str, bytes] = {}
        self._inputs: dict[str, tuple[Level, float]] = {}
        self._silent_since_s: float | None = None
        self._silence_said = False
        self._compiling_said = False
        self._compiled: Compiling | None = None

    def compiling(self, work: Compiling | None, waiting: int) -> None:
        """
        Say that it takes a while until the first estimate can be made, and its end.

        Parameters
        ----------
        waiting
            Messages that wait for it.
        """
        if work is None or work is self._compiled:
            return
        if work.done():
            self._compiled = work
            if work.failure:
                self._logger.error(f'compiling failed:\n{work.failure}')
            after = f'ready to estimate, {work.seconds:.0f} s after the start'
            self._logger.info(f'{after}; {waiting} messages waited')
        elif work.seconds > COMPILING_SAID_AFTER_S and not self._compiling_said:
            self._compiling_said = True
            self._logger.info(
                'compiling, as on the first start of each version: one to three minutes without '
                'an estimate. What is heard is recorded, waits and is then used; `make warm` '
                'compiles beforehand'
            )

    def event(self, event: Event) -> None:
        """
        Say what the monitor reports.
        """
        line = line_of(event)
        if line is not None:
            self._say(line.text, warning=line.warning)

    def status(self, status: DiagnosticStatus) -> None:
        """
        Say that a part of the node is worse or better than before.
        """
        before = self._levels.get(status.name, DiagnosticStatus.OK)
        self._levels[status.name] = status.level
        if status.level == before:
            return
        if status.level == DiagnosticStatus.ERROR:
            self._logger.error(status.message)
        else:
            self._say(status.message, warning=status.level == DiagnosticStatus.WARN)

    def inputs(self, states: Sequence[InputState]) -> None:
        """
        Report an input that was heard and is worse or better than before.
        """
        now_s = time.monotonic()
        for state in states:
            topic, finding = state.topic, state.finding
            before, said_s = self._inputs.get(topic.name, (Level.OK, -AGAIN_S))
            if topic.age_s is None or finding.level is before or now_s < said_s + AGAIN_S:
                continue
            self._inputs[topic.name] = (finding.level, now_s)
            self._say(f'{topic.name}: {finding.text}', warning=finding.level is not Level.OK)

    def silence(self, states: Sequence[InputState], candidates: str) -> None:
        """
        Say, once, that no input of the motion is heard, and that one is again.

        Parameters
        ----------
        candidates
            Topics that may be meant.
        """
        now_s = time.monotonic()
        if any(state.fresh for state in states if state.topic.name in MOTION_INPUTS):
            if self._silence_said:
                self._logger.info('an input of the motion is heard')
            self._silent_since_s, self._silence_said = None, False
            return
        if self._silent_since_s is None:
            self._silent_since_s = now_s
        if self._silence_said or now_s < self._silent_since_s + SILENCE_SAID_AFTER_S:
            return
        self._silence_said = True
        names = ', '.join(MOTION_INPUTS)
        hint = candidates or (
            'no topic has a type that fits; is the driver running, in this ROS domain and '
            'discovery range?'
        )
        self._logger.warning(f'no input heard on any of {names}: {hint}')

    def _say(self, text: str, *, warning: bool) -> None:
        # rclpy raises where one line of source logs with two severities
        if warning:
            self._logger.warning(text)
        else:
            self._logger.info(text)
