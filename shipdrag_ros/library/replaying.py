# SPDX-License-Identifier: Apache-2.0
"""A run, or a window of it, replayed and put into words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.bags import Run
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.library.listener import Listener
from shipdrag_ros.library.windowed import WindowSpan
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import accepted_samples, replay
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.told_stop import Stop
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship

_LATE_S = 10.0
_MOVING_M_S = 0.5


def replay_run(
    each: Run,
    listener: Listener,
    *,
    ship: Ship | None = None,
    parameters: Parameters | None = None,
    window: WindowSpan | None = None,
    stop: Stop | None = None,
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
            replay(
                each, ship=ship, parameters=parameters, window=window, stop=stop, progress=progress
            )
        )
    if not result.coastdowns:
        astern = _astern(each)
        if astern:
            result = replace(result, warnings=(*result.warnings, astern))
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


def _astern(run: Run) -> str:
    """Say that a log reads astern most of the time, which a wrong sign makes too."""
    block, _ = accepted_samples(run)
    speeds = block.value[block.channel == Channel.SPEED_THROUGH_WATER, 0]
    moving = speeds[np.abs(speeds) > _MOVING_M_S]
    share = float(np.mean(moving < 0.0)) if len(moving) else 0.0
    if share <= 0.5:
        return ''
    return (
        f'speed_through_water is negative in {share:.0%} of the samples under way (median '
        f'{np.median(moving):.2f} m/s), as if the ship went astern; if she sailed ahead, the sign '
        'of the log is wrong: give the speed forward as positive'
    )


def _beyond(run: Run, end_s: float) -> str:
    """Say that a window reaches beyond the bag, by more than a sample may come late."""
    assert run.span_ns is not None  # an estimate was made
    length_s = (run.span_ns[1] - run.span_ns[0]) * 1e-9
    if end_s <= length_s + _LATE_S:
        return ''
    return (
        f'the window ends at {end_s:g} s; the bag ends at {length_s:.1f} s, and the window there'
    )
