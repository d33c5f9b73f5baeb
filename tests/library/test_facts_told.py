# SPDX-License-Identifier: Apache-2.0
"""What is told of a run reaches the estimate too, not the diagnosis alone."""

from __future__ import annotations

import shutil
from pathlib import Path

from shipdrag_ros.bags import open_runs
from shipdrag_ros.library.diagnosing import _found
from shipdrag_ros.library.replaying import Notes
from shipdrag_ros.progress import silent
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
