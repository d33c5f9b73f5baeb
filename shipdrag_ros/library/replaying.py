# SPDX-License-Identifier: Apache-2.0
"""A run, or a window of it, replayed and put into words."""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.bags import Run
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.library.listener import Listener
from shipdrag_ros.library.windowed import WindowSpan
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import replay
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.ship import Ship

_LATE_S = 10.0


def replay_run(
    each: Run,
    listener: Listener,
    *,
    ship: Ship | None = None,
    parameters: Parameters | None = None,
    window: WindowSpan | None = None,
) -> RunResult:
    """
    Replay one run; its progress is shown.

    Raises
    ------
    EstimationError
        If a window was given and nothing can be estimated from it.
    """
    with listener.progress(f'replaying {each.name}') as progress:
        result = RunResult.of(
            replay(each, ship=ship, parameters=parameters, window=window, progress=progress)
        )
    if window is not None:
        for coastdown in result.coastdowns:
            if coastdown.estimate is None:
                raise EstimationError(
                    f'{each.name!r}: no estimate from {window[0]:g} to {window[1]:g} s: '
                    f'{coastdown.failure}; give another --window'
                )
        beyond = _beyond(each, window[1])
        if beyond:
            result = replace(result, warnings=(*result.warnings, beyond))
    return result


def _beyond(run: Run, end_s: float) -> str:
    """Say that a window reaches beyond the bag, by more than a sample may come late."""
    assert run.span_ns is not None  # an estimate was made
    length_s = (run.span_ns[1] - run.span_ns[0]) * 1e-9
    if end_s <= length_s + _LATE_S:
        return ''
    return (
        f'the window ends at {end_s:g} s; the bag ends at {length_s:.1f} s, and the window there'
    )
