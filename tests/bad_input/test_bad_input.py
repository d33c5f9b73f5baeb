# SPDX-License-Identifier: Apache-2.0
"""No kind of bad input ends in a traceback or a silent success."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bad_input import bags, files, messages, tables, use
from tests.bad_input.case import Case, Seen, run

CASES: tuple[Case, ...] = (*bags.CASES, *files.CASES, *messages.CASES, *tables.CASES, *use.CASES)


def faults(case: Case, seen: Seen) -> list[str]:
    """Say what is not as it should be."""
    found = [f'does not say {phrase!r}' for phrase in case.says if phrase not in seen.text]
    if seen.status != case.status:
        found.append(f'exit code {seen.status}, expected {case.status}')
    if 'Traceback' in seen.text:
        found.append('a traceback')
    if not case.says:
        found.append('nothing is expected of it')
    return found


@pytest.mark.parametrize('case', CASES, ids=[f'{c.area}: {c.kind}' for c in CASES])
def test_the_user_is_told_what_is_wrong_and_what_to_do(case: Case, tmp_path: Path) -> None:
    if case.area == 'Node':
        pytest.importorskip('rclpy')
    assert faults(case, run(case, tmp_path)) == []


def test_the_kinds_are_many_and_named_once() -> None:
    names = [(case.area, case.kind) for case in CASES]
    assert len(names) == len(set(names)) >= 45
