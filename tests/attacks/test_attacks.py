# SPDX-License-Identifier: Apache-2.0
"""No attack on a file or the NMEA input succeeds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.attacks import files, nmea
from tests.attacks.attack import Attack

ATTACKS = (*files.ATTACKS, *nmea.ATTACKS)


@pytest.mark.parametrize('attack', ATTACKS, ids=[f'{a.area}: {a.kind}' for a in ATTACKS])
def test_no_attack_succeeds(attack: Attack, tmp_path: Path) -> None:
    assert attack.run(tmp_path.resolve())  # raises `Succeeded`
