# SPDX-License-Identifier: Apache-2.0
"""What is told of a run reaches the estimate too, not the diagnosis alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

import shipdrag_ros as sd
from shipdrag_ros.bags import open_runs
from shipdrag_ros.library.diagnosing import _found
from shipdrag_ros.library.replaying import Notes
from shipdrag_ros.progress import silent
from shipdrag_ros.replay.playback import ship_of
from shipdrag_ros.ship import Fact


def test_the_estimate_knows_of_facts_of_the_command_and_of_the_run(bag: Path, tmp_path: Path):
    own = tmp_path / 'run.mcap'
    shutil.copy(bag, own)
    own.with_suffix('.run.yaml').write_text('facts: [calm]\n')
    runs = [(run, None) for run in open_runs([own])]
    found = _found(Notes(), runs, None, silent, None, (Fact('deep_water'),))
    (estimate,) = found.estimates
    assert estimate.reference.unknown == ()
    assert found.ship.facts == ()  # of the run and of the command, not of the ship


def test_the_estimate_is_of_the_ship_as_she_was_as_that_of_a_replay(bag: Path, tmp_path: Path):
    own = tmp_path / 'run.mcap'
    shutil.copy(bag, own)
    (run,) = sd.read(own).runs
    volume = 0.9 * ship_of(run, None).displaced_volume_m3
    own.with_suffix('.run.yaml').write_text(f'facts: [calm]\ndisplaced_volume_m3: {volume}\n')
    (found,) = _found(Notes(), [(run, None)], None, silent, None).estimates
    (replayed,) = sd.estimate(sd.read(own)).coastdowns
    np.testing.assert_array_equal(found.curve.resistance_m_s2, replayed.curve.resistance_m_s2)


def test_the_ship_is_that_of_the_first_run_that_has_one(bag: Path, tmp_path: Path):
    other = Path(shutil.copy(bag, tmp_path / 'other.mcap'))
    (bare,), (own,) = sd.read(other).runs, sd.read(bag).runs
    bare.attachments = {}  # as a log has none
    found = _found(Notes(), [(bare, None), (own, None)], None, silent, None)
    assert found.ship == ship_of(own, None)
    assert len(found.coasts) == 2
