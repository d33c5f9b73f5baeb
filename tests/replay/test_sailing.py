# SPDX-License-Identifier: Apache-2.0
"""Of a whole run is kept what is sound, and zeros of a log that stands still where asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.replay.sailing import accepted_samples
from shipdrag_ros.samples import Block, Channel
from tests.runs import write_run

STAMPS = 10**18 + np.arange(1200) * 10**9


@pytest.mark.parametrize('channel', [Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2])
def test_zeros_of_any_log_are_kept_where_asked_for(tmp_path: Path, channel: Channel) -> None:
    speed = np.linspace(8.0, -8.0, len(STAMPS))
    speed += 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    speed = np.maximum(speed, 0.0)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', Block.of(channel, STAMPS, speed))])
    sound, _ = accepted_samples(run)
    every, _ = accepted_samples(run, zeros=True)
    assert len(sound) < 1000
    assert len(every) == len(STAMPS)
