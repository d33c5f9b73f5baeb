# SPDX-License-Identifier: Apache-2.0
"""r(v) by a fit of the equation of motion, with what disturbs it learnt apart."""

from shipdrag_ros.estimation.ode_fit.estimate import NAME, estimate

__all__ = ['NAME', 'estimate']
