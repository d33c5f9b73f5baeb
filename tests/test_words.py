# SPDX-License-Identifier: Apache-2.0
"""Pages and the command line are in words that a search finds and a non-native reader follows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
WORDS = {
    r'anew': 'again',
    r'hear(s|d)?': 'receive, subscribe',
    r'h[eo]lds? (\S+ ){0,6}against': 'compare with',
    r'whoever': 'anybody who',
    r'asked too often': 'rate-limit',
    r'betrays nothing': 'constant-time',
    r'collector of garbage': 'garbage collector',
    r'who may look': 'access control',
    r'besides': 'also',
    r'gives way': 'is rejected',
    r'as (it|that) is taken': 'is assumed',
    r'be (they|it) there or not': 'where present',
    r'makes of residuals': 'inverse Cholesky factor of the noise covariance',
    r'that no mixture of': 'orthogonal to all other responses',
    r'look-alikes?': 'confounders',
    r'white noise is told': 'no estimator is given the noise level',
    r'own shares?': 'partial contribution',
}
PATTERN = re.compile(rf'(?<!\.)\b(?:{"|".join(WORDS)})\b', re.IGNORECASE)
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
ROOMS = ('', 'cli', 'library', 'report', 'ship', 'simulation', 'simulation/effects')
CODE = [path for room in ROOMS for path in sorted((ROOT / 'shipdrag_ros' / room).glob('*.py'))]


def archaic(path: Path) -> list[str]:
    """Return the turns that a file has, with what to say instead."""
    found = []
    for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), start=1):
        for match in PATTERN.finditer(line):
            said = next(WORDS[word] for word in WORDS if re.fullmatch(word, match[0].lower()))
            found.append(f'{path.name}:{number}: {match[0]!r}; say {said}')
    return found


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_pages_are_in_plain_words(path: Path) -> None:
    assert archaic(path) == []


def test_the_ground_floor_and_the_faces_are_in_plain_words() -> None:
    assert [line for path in CODE for line in archaic(path)] == []


def test_the_test_can_fail(tmp_path: Path) -> None:
    page = tmp_path / 'page.md'
    page.write_text('The node hears it.\nIt holds the log against the track anew.\n')
    assert len(archaic(page)) == 3
