# SPDX-License-Identifier: Apache-2.0
"""S1 as published: position alone."""

from shipdrag_ros.studies.s1.estimate import published

ESTIMATOR = published('s1_position', 'orthogonal polynomial, position alone')
