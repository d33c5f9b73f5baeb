# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a bag, and what can be saved of it."""

from shipdrag_ros.bags.salvage.check import FileCheck, check
from shipdrag_ros.bags.salvage.damage import Damage, DamageKind
from shipdrag_ros.bags.salvage.recover import Recovery, recover

__all__ = [
    'Damage',
    'DamageKind',
    'FileCheck',
    'Recovery',
    'check',
    'recover',
]
