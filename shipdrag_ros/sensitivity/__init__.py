# SPDX-License-Identifier: Apache-2.0
"""Which parameters of a simulation matter."""

from shipdrag_ros.sensitivity.loss import (
    CHANGES,
    Losses,
    Norm,
    Responses,
    Selection,
    Simulator,
    own_share,
    relative,
    vary,
)

__all__ = [
    'CHANGES',
    'Losses',
    'Norm',
    'Responses',
    'Selection',
    'Simulator',
    'own_share',
    'relative',
    'vary',
]
