# SPDX-License-Identifier: Apache-2.0
"""S1 as published: speed alone."""

from shipdrag_ros.studies.s1.estimate import published

ESTIMATOR = published('s1_speed', 'orthogonal polynomial, speed alone')
