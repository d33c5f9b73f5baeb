# SPDX-License-Identifier: Apache-2.0
"""The estimator of a coastdown that runs."""

from shipdrag_ros.estimation.estimator import Estimator
from shipdrag_ros.estimation.log_time.estimate import NAME, estimate

ESTIMATOR = Estimator(
    name=NAME,
    meaning='all inputs, polynomials in the logarithm of time averaged over models',
    estimate=estimate,
)
