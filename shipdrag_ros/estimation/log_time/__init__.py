# SPDX-License-Identifier: Apache-2.0
"""r(v) from polynomials in u = ln(1 + t/t_c), averaged over models: the estimate while it runs."""

from shipdrag_ros.estimation.log_time.estimate import NAME, estimate

__all__ = ['NAME', 'estimate']
