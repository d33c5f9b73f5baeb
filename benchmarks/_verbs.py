# SPDX-License-Identifier: Apache-2.0
"""Verbs of the command line, run in this process as a user would run them."""

from __future__ import annotations

import contextlib
import io
import json
from typing import Any

from shipdrag_ros import cli


def run(*words: str) -> str:
    """
    Run a verb and return what it printed.

    Raises
    ------
    RuntimeError
        With what it said, if it fails.
    """
    written, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(written), contextlib.redirect_stderr(said):
        try:
            status = cli.main(list(words))
        except SystemExit as ended:  # wrong usage
            status = ended.code
    if status:
        raise RuntimeError(f'shipdrag {words[0]} ended with {status}: {said.getvalue().strip()}')
    return written.getvalue()


def found(*words: str) -> dict[str, Any]:
    """
    Run a verb and return its JSON.
    """
    result: dict[str, Any] = json.loads(run(*words, '--json'))
    return result
