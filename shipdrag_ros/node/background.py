# SPDX-License-Identifier: Apache-2.0
"""
What runs beside the node: a thread that compiles, and each coastdown diagnosed in a process.

A start that finds nothing kept takes a minute or two until the first estimate
could be made; nobody should have to take that for a node that hangs.

A diagnosis is seconds of compiled code, in which no callback of the same process
could run. A process that ends with it takes no memory between coastdowns, and
whatever goes wrong in it stops no estimate.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import threading
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import Enum
from threading import Lock
from time import monotonic
from typing import Any

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.coastdown.warming import warm
from shipdrag_ros.display import json_text
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.messages.topics import READY_S
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import NO_CLEAN_HULL
from shipdrag_ros.simulation.effects import carrying

COMPILER = 'compiling'


class Compiling:
    """
    Goes on from `begin` to its end.

    Parameters
    ----------
    parameters
        Whose estimator is needed.

    Attributes
    ----------
    estimator
        That is needed.
    failure
        What went wrong, '' if nothing did; what is missing is then compiled when it is called.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.failure = ''
        self.estimator = parameters.estimator
        self._parameters = parameters
        self._began_s: float | None = None
        self._ended_s: float | None = None

    def begin(self) -> None:
        """
        Begin, if that was not done.
        """
        if self._began_s is None:
            self._began_s = monotonic()
            # it cannot be interrupted, and must not be waited for
            threading.Thread(target=self._run, name=COMPILER, daemon=True).start()

    def done(self) -> bool:
        """
        Say whether everything is there.
        """
        return self._ended_s is not None

    @property
    def seconds(self) -> float:
        """How long it took, or has taken so far [s]."""
        if self._began_s is None:
            return 0.0
        return (monotonic() if self._ended_s is None else self._ended_s) - self._began_s

    def _run(self) -> None:
        try:
            warm(self._parameters)
        except Exception:
            self.failure = traceback.format_exc()
        self._ended_s = monotonic()


def leave_if_compiling(status: int) -> None:
    """
    End the process at once if a compiler still runs in it.

    Python would take its modules away under the compiler, which may then crash.

    Parameters
    ----------
    status
        Exit status of the process.
    """
    if any(thread.name == COMPILER for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


_GOES_ON = (
    'The coastdown alone is diagnosed here; `shipdrag diagnose BAG` of the recording holds all of '
    'the glide against the model'
)
LIMIT_S = 900.0  # the first diagnosis of a machine compiles
_NICE = 10  # estimates come first


class DiagnosisState(Enum):
    """How far the diagnosis of the last coastdown is."""

    OFF = 'off'
    IMPOSSIBLE = 'impossible'
    NONE_YET = 'none yet'
    RUNNING = 'running'
    DONE = 'done'
    FAILED = 'failed'


@dataclass(frozen=True)
class DiagnosisStatus:
    """
    Where the diagnosis stands.

    Attributes
    ----------
    state
    reason
        Why there is none.
    coastdown
        The one that it is of, None before the first.
    found
        The document of `shipdrag diagnose --json`, with the times of the coastdown and what was
        not looked at; None unless done.
    """

    state: DiagnosisState
    reason: str = ''
    coastdown: EndedCoastdown | None = None
    found: dict[str, Any] | None = None

    @property
    def caveat(self) -> str:
        """What the diagnosis has not looked at, a sentence; '' where it saw all of a glide."""
        said = '' if self.coastdown is None else self.coastdown.disturbed
        return f'{said[0].upper()}{said[1:]}. {_GOES_ON}' if said else ''


_Task = tuple[Window, Ship, Parameters, bool]
"""What a process is given, and whether the coastdown is still ahead."""
AHEAD_EVERY_S = 1800.0  # of steady sailing: what a coastdown would show is said anew


class Diagnosing:
    """
    Coastdowns diagnosed one after the other, while the caller goes on.

    Parameters
    ----------
    ship
        Without a baseline none is possible, and the status says so.
    enabled
        False: only says that it is off.

    Attributes
    ----------
    status
        Of the last coastdown.
    ahead
        What a coastdown from here would show, a sentence; '' before it is known.
    """

    def __init__(self, ship: Ship, parameters: Parameters, *, enabled: bool) -> None:
        self._ship = carrying(ship)  # terms of this process, in the one that diagnoses
        self._parameters = parameters
        self._queue = ThreadPoolExecutor(max_workers=1, thread_name_prefix='diagnosis')
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._look_again_s = 0.0
        self.ahead = ''
        self.status = DiagnosisStatus(DiagnosisState.NONE_YET)
        if not enabled:
            self.status = DiagnosisStatus(DiagnosisState.OFF, 'the parameter diagnose is false')
        elif ship.baseline is None:
            self.status = DiagnosisStatus(DiagnosisState.IMPOSSIBLE, NO_CLEAN_HULL)
        self._possible = self.status.state is DiagnosisState.NONE_YET

    def begin(self, coastdown: EndedCoastdown, window: Window) -> None:
        """
        Diagnose a coastdown after those that wait; returns at once. None any more once closed.
        """
        if not self._possible:
            return
        if coastdown.estimate is None:
            reason = f'the coastdown gave no estimate: {coastdown.failure}'
            self.status = DiagnosisStatus(DiagnosisState.IMPOSSIBLE, reason, coastdown)
            return
        self.status = DiagnosisStatus(DiagnosisState.RUNNING, coastdown=coastdown)
        task = window, self._ship, self._parameters, False
        self._queue.submit(self._diagnose, task, self.status)

    def look_ahead(self, monitor: Monitor) -> None:
        """
        Find out what a coastdown would show, now and then in steady sailing; returns at once.
        """
        if not self._possible or monotonic() < self._look_again_s:
            return
        if monitor.progress.steady_s < min(READY_S, self._parameters.steady_s):
            return
        window = monitor.steady_window()
        if window is not None:
            self._look_again_s = monotonic() + AHEAD_EVERY_S
            self._queue.submit(self._look, (window, self._ship, self._parameters, True))

    def _look(self, task: _Task) -> None:
        """Wait for a process, in a thread."""
        answer = self._answer(task)
        self.ahead = answer.get('ahead') or f'What a coastdown would show: {answer["reason"]}'

    def close(self) -> None:
        """
        End what runs and drop what waits.
        """
        with self._lock:
            self._possible = False
            if self._process is not None:
                self._process.kill()
        self._queue.shutdown(cancel_futures=True)

    def _diagnose(self, task: _Task, running: DiagnosisStatus) -> None:
        """Wait for a process, in a thread."""
        assert running.coastdown is not None
        answer = self._answer(task)
        if 'reason' in answer:
            state = DiagnosisState(answer['state'])
            self.status = replace(running, state=state, reason=answer['reason'])
            return
        about = {'start_ns': running.coastdown.start_ns, 'end_ns': running.coastdown.end_ns}
        found = {**answer, 'coastdown': about, 'caveat': running.caveat}
        self.status = replace(running, state=DiagnosisState.DONE, found=found)

    def _answer(self, task: _Task) -> dict[str, Any]:
        """Return what a process says, or why it says nothing."""
        try:
            return self._asked(task)
        except Exception as error:  # nobody asks this thread: it would seem to run for ever
            return {'state': 'failed', 'reason': str(error) or type(error).__name__}

    def _asked(self, task: _Task) -> dict[str, Any]:
        with self._lock:
            if not self._possible:
                raise subprocess.SubprocessError('the node has ended')
            self._process = subprocess.Popen(
                [sys.executable, '-c', f'from {__name__} import main; main()'],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,  # the signal that ends the node is not for it
            )
        try:
            answer, complaint = self._process.communicate(pickle.dumps(task), timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            raise
        if self._process.returncode != 0:
            last = complaint.decode(errors='replace').strip().rpartition('\n')[2]
            raise subprocess.SubprocessError(f'exit {self._process.returncode}: {last}')
        found: dict[str, Any] = json.loads(answer)
        return found


def main() -> None:
    """
    Diagnose what comes from stdin, and write the document, or why there is none, to stdout.

    Of a coastdown that is ahead: the sentence that says what it would show.
    """
    os.nice(_NICE)
    from shipdrag_ros.diagnosis import CoastRun, diagnose
    from shipdrag_ros.diagnosis.ahead import look_ahead
    from shipdrag_ros.diagnosis.document import document

    window, ship, parameters, ahead = pickle.load(sys.stdin.buffer)
    run = CoastRun('the coastdown', window)
    try:
        if ahead:
            answer = {'ahead': look_ahead(window, ship, parameters).sentence}
        else:
            answer = document(diagnose([run], ship, parameters), ship)
    except ShipdragError as error:
        answer = {'state': DiagnosisState.IMPOSSIBLE.value, 'reason': str(error)}
    sys.stdout.write(json_text(answer))
