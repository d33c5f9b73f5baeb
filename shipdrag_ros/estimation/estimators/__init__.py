# SPDX-License-Identifier: Apache-2.0
"""
The estimators: every module in this folder is one.

A new estimator is a new module with an `ESTIMATOR` of its own name. The parameter `estimator`,
the report and the documentation find it here; a module is imported when it is asked for.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib import import_module

from shipdrag_ros.estimation.estimator import Estimator
from shipdrag_ros.estimation.shield import shielded
from shipdrag_ros.parameters import FORMER_ESTIMATORS


@cache
def named(name: str) -> Estimator:
    """
    Return an estimator by its name, or by one that it had before.

    Parameters
    ----------
    name
        One of `parameters.ESTIMATORS`, or of `parameters.FORMER_ESTIMATORS`.
    """
    known = FORMER_ESTIMATORS.get(name, name)
    found = import_module(f'{__name__}.{known}').ESTIMATOR
    assert isinstance(found, Estimator)
    live = None if found.live is None else shielded(found.live)
    return replace(found, estimate=shielded(found.estimate), live=live)
