# SPDX-License-Identifier: Apache-2.0
"""The samples of coastdowns that a replay has found, with the steady record before each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.bags.playback import ReplayResult
from shipdrag_ros.coastdown import validate
from shipdrag_ros.coastdown.events import Coastdown
from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Block, Reason, concatenate

_SECOND_NS = 1_000_000_000
_SET_CLOCK_S = 10.0
_CLOCKS_APART_S = 600.0  # what comes late, since the clocks differ, is to be diagnosed


def coast_windows(result: ReplayResult) -> list[tuple[Coastdown, Window]]:
    """
    Read the samples of each coastdown again.

    Parameters
    ----------
    result
        From `replay`.

    Returns
    -------
    list of (coastdown, window)
        In their order; the window holds what was accepted, and the record
        before it. A sensor whose clock is slow is heard too.
    """
    return [(coastdown, _window(result, coastdown)) for coastdown in result.coastdowns]


def _window(result: ReplayResult, coastdown: Coastdown) -> Window:
    parameters = replace(result.parameters, late_s=_CLOCKS_APART_S)
    before_ns = round(parameters.steady_s * _SECOND_NS)
    # the validation looks back; stamps may differ from times of arrival
    margin_s = parameters.frozen_s + parameters.late_s + _SET_CLOCK_S
    margin_ns = round(margin_s * _SECOND_NS)
    first_ns = max(coastdown.start_ns - before_ns - margin_ns, 0)
    inputs = result.run.inputs(start_ns=first_ns, end_ns=coastdown.end_ns + margin_ns)
    block = concatenate([item for item in inputs if isinstance(item, Block)])
    accepted = block[np.flatnonzero(validate(block, parameters) == Reason.ACCEPTED)]
    return Window.from_block(
        accepted,
        coastdown.start_ns,
        coastdown.end_ns,
        before_ns=coastdown.start_ns - before_ns,
    )
