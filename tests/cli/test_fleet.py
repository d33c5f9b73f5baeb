# SPDX-License-Identifier: Apache-2.0
"""`shipdrag fleet` in a file: how far it is, now and then; tests/fleet/ tries the rest."""

from __future__ import annotations

import pytest

from shipdrag_ros.cli import fleet, main


def test_progress_is_told_now_and_then_with_the_time_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [100.0]
    monkeypatch.setattr('shipdrag_ros.cli.fleet.time.monotonic', lambda: clock[0])
    said: list[str] = []
    lines = fleet._Lines(said.append)
    for done in range(1, 5):
        lines.tell('replaying', done, 10)
        clock[0] += 10.0
    assert said == ['replaying: 3 of 10, 46.67 s left']  # 20 s for 3 of 10


@pytest.mark.parametrize('given', ['0', '-1', 'two', '1025'])
def test_a_number_of_workers_that_is_none_is_refused(
    given: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['fleet', 'x', '-o', 'y', f'--workers={given}'])
    assert ended.value.code == 2
    assert 'expected a whole number from 1 to 1024' in capsys.readouterr().err
