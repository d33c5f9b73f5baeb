# SPDX-License-Identifier: Apache-2.0
"""The estimator of a coastdown that has ended."""

from shipdrag_ros.estimation.estimator import Estimator
from shipdrag_ros.estimation.ode_fit import NAME, estimate

ESTIMATOR = Estimator(
    name=NAME,
    meaning='fit of the equation of motion',
    estimate=estimate,
    learns_noise=True,
)
