# SPDX-License-Identifier: Apache-2.0
"""
The estimators: every module in this folder is one, and in that of a study.

A new estimator is a new module with an `ESTIMATOR` of its own name. The parameter `estimator`,
the report and the documentation find it; a module is imported when it is asked for. One of
another package is an entry point of the group `shipdrag.estimators`, `NAME = PACKAGE:ESTIMATOR`.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from shipdrag_ros.errors import EstimationError, ShipdragError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.imports import LEFT_OUT, load
from shipdrag_ros.parameters import ESTIMATOR_POINTS, FORMER_ESTIMATORS, Parameters
from shipdrag_ros.ship import Ship

_P = ParamSpec('_P')
_R = TypeVar('_R')

_log = logging.getLogger(__name__)
_logged: set[tuple[str, int]] = set()  # file and line of defects whose trace is in the log


WindowEstimator = Callable[[Window, Ship, Parameters], Estimate]
"""
From one window to r(v): a pure function, without memory, random numbers or clock.

It raises `EstimationError` if the window does not hold a coastdown that can be estimated.
"""


@dataclass(frozen=True)
class Estimator:
    """
    A way from a window to r(v).

    Attributes
    ----------
    name
        Value of the parameter `estimator`, and of `Estimate.estimator`.
    meaning
        What it is, for a report.
    estimate
    live
        The same in less time, while a coastdown runs; None where it takes none.
    learns_noise
        Whether slow disturbances are learnt, or a note says that they are not.
    constant_order
        Number of coefficients that make r the same at every speed; None where
        orders are averaged.
    caveat
        What its band does not hold; '' for nothing.
    """

    name: str
    meaning: str
    estimate: WindowEstimator
    live: WindowEstimator | None = None
    learns_noise: bool = False
    constant_order: int | None = None
    caveat: str = ''


def shielded(
    call: Callable[_P, _R],
    what: str = 'estimator',
    remedy: str = ', or set `estimator` to another',
) -> Callable[_P, _R]:
    """
    Return a function whose every error is an `EstimationError`.

    Parameters
    ----------
    call
        Any; a defect in it is logged once, with its trace.
    what, remedy
        What failed, and what the user can do besides a report of the defect.
    """

    @wraps(call)
    def guarded(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return call(*args, **kwargs)
        except EstimationError:
            raise
        except ShipdragError as error:
            raise EstimationError(str(error)) from error
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = (last.filename, last.lineno or 0)
            if place not in _logged:
                _logged.add(place)
                _log.exception('the %s failed; this is a defect of the program', what)
            raise EstimationError(
                f'the {what} failed ({type(error).__name__}: {error}), which is a defect of '
                f'the program: report it with the trace in the log{remedy}'
            ) from error

    return guarded


@cache
def named(name: str) -> Estimator:
    """
    Return an estimator by its name, or by one that it had before.

    Parameters
    ----------
    name
        One of `parameters.ESTIMATORS`, or of `parameters.FORMER_ESTIMATORS`.

    Raises
    ------
    EstimationError
        If it cannot be loaded.
    """
    found = _load(FORMER_ESTIMATORS.get(name, name))
    live = None if found.live is None else shielded(found.live)
    return replace(found, estimate=shielded(found.estimate), live=live)


def _load(name: str) -> Estimator:
    point = ESTIMATOR_POINTS[name]
    found = load([point], Estimator)
    if name not in found:
        why = LEFT_OUT.get(point, f'{point.value} has another name')
        raise EstimationError(f'the estimator {name!r} cannot be used: {why}')
    return found[name][1]
