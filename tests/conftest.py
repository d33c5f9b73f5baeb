# SPDX-License-Identifier: Apache-2.0
"""
What holds for all tests.

Property tests try the same examples each time, new ones with
`--hypothesis-profile=default`. What was skipped for want of a browser is told.
"""

from __future__ import annotations

import pytest
from hypothesis import settings

settings.register_profile('repeatable', derandomize=True)
settings.load_profile('repeatable')

NO_BROWSER = 'no browser'


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Count what no browser has opened, in one line."""
    skipped = [
        report
        for report in terminalreporter.stats.get('skipped', [])
        if isinstance(report.longrepr, tuple) and NO_BROWSER in report.longrepr[2]
    ]
    if skipped:
        terminalreporter.write_line(
            f'{len(skipped)} tests skipped: {NO_BROWSER}; with Chromium (apt-get install '
            'chromium) they open every kind of page'
        )
