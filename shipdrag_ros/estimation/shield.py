# SPDX-License-Identifier: Apache-2.0
"""A defect in an estimate or a forecast is a failure with words, and ends nothing else."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from shipdrag_ros.errors import EstimationError, ShipdragError

_P = ParamSpec('_P')
_R = TypeVar('_R')

_log = logging.getLogger(__name__)
_logged: set[tuple[str, int]] = set()  # file and line of defects whose trace is in the log


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
