# SPDX-License-Identifier: Apache-2.0
"""The samples of a whole run that are sound, whatever was done in it."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.bags.run import Run
from shipdrag_ros.coastdown import validate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import PARAMETERS_FILE
from shipdrag_ros.samples import Block, Reason, concatenate


def accepted_samples(run: Run) -> tuple[Block, Parameters]:
    """
    Read a run as it would be on board, without looking for a coastdown.

    Parameters
    ----------
    run
        From `open_runs`.

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
    text = run.attachments.get(PARAMETERS_FILE, '')
    parameters = Parameters.from_yaml(text, subject=f'{run.name}: {PARAMETERS_FILE}')
    block = concatenate([item for item in run.inputs() if isinstance(item, Block)])
    accepted = validate(block, parameters) == Reason.ACCEPTED
    return block[np.flatnonzero(accepted)], parameters
