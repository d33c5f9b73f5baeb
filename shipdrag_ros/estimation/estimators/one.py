# SPDX-License-Identifier: Apache-2.0
"""The estimator of the one posterior (docs/model.md), live and final."""

from shipdrag_ros.estimation.estimator import Estimator
from shipdrag_ros.estimation.one import NAME, estimate, estimate_live

ESTIMATOR = Estimator(
    name=NAME,
    meaning='one posterior of hull, thrust, instruments and noise',
    estimate=estimate,
    live=estimate_live,
    learns_noise=True,
)
