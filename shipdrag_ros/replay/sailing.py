# SPDX-License-Identifier: Apache-2.0
"""The samples of a whole run that are sound, whatever was done in it."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.bags.run import Run
from shipdrag_ros.coastdown import validate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import recorded_parameters
from shipdrag_ros.samples import KIND, Block, Channel, Reason, concatenate


def accepted_samples(run: Run, *, zeros: bool = False) -> tuple[Block, Parameters]:
    """
    Read a run as it would be on board, without looking for a coastdown.

    Parameters
    ----------
    run
        From `open_runs`.
    zeros
        A log that reads exactly 0 for long is no frozen one: below some speed a
        wheel stands still.

    Returns
    -------
    block, parameters
        Accepted samples in arrival order; the parameters attached to the bag,
        by which they are accepted.

    Raises
    ------
    ParameterError
        If those attached cannot be used.
    """
    parameters = recorded_parameters(run)
    block = concatenate([item for item in run.inputs() if isinstance(item, Block)])
    reason = validate(block, parameters)
    accepted = reason == Reason.ACCEPTED
    if zeros:
        of_log = KIND[block.channel] == Channel.SPEED_THROUGH_WATER
        accepted |= (reason == Reason.FROZEN) & of_log & (block.value[:, 0] == 0.0)
    return block[np.flatnonzero(accepted)], parameters
