# SPDX-License-Identifier: Apache-2.0
"""Whatever goes wrong in an estimator is a failure with words, and ends nothing else."""

from __future__ import annotations

import logging
import traceback
from functools import wraps

from shipdrag_ros.errors import EstimationError, ShipdragError
from shipdrag_ros.estimation.estimator import WindowEstimator
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

_log = logging.getLogger(__name__)
_logged: set[tuple[str, int]] = set()  # file and line of defects whose trace is in the log


def shielded(estimator: WindowEstimator) -> WindowEstimator:
    """
    Return an estimator whose every error is an `EstimationError`.

    Parameters
    ----------
    estimator
        Any; a defect in it is logged once, with its trace.
    """

    @wraps(estimator)
    def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        try:
            return estimator(window, ship, parameters)
        except EstimationError:
            raise
        except ShipdragError as error:
            raise EstimationError(str(error)) from error
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = (last.filename, last.lineno or 0)
            if place not in _logged:
                _logged.add(place)
                _log.exception('an estimator failed; this is a defect of the program')
            raise EstimationError(
                f'the estimator failed ({type(error).__name__}: {error}), which is a defect of '
                'the program: report it with the trace in the log, or set `estimator` to another'
            ) from error

    return estimate
