# SPDX-License-Identifier: Apache-2.0
"""Imported by the fork server alone: compiled code is loaded once, and each node has it."""

import shipdrag_ros.node.main  # noqa: F401
from shipdrag_ros.coastdown.warming import warm
from shipdrag_ros.parameters import Parameters

warm(Parameters())
