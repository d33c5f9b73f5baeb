# SPDX-License-Identifier: Apache-2.0
"""No attack on a file or the NMEA input succeeds; `benchmarks/attacks.py` tries the node too."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import _attacks_files, _attacks_nmea

ATTACKS = (*_attacks_files.ATTACKS, *_attacks_nmea.ATTACKS)


@pytest.mark.parametrize('attack', ATTACKS, ids=[f'{a.area}: {a.kind}' for a in ATTACKS])
def test_no_attack_succeeds(attack: _attacks_files.Attack, tmp_path: Path) -> None:
    assert attack.run(tmp_path.resolve())  # raises `Succeeded`
