# SPDX-License-Identifier: Apache-2.0
"""S1 as published: speed and position jointly."""

from shipdrag_ros.studies.s1.estimate import published

ESTIMATOR = published('s1_joint', 'orthogonal polynomial, speed and position jointly')
