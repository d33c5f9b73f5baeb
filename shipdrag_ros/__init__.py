# SPDX-License-Identifier: Apache-2.0
"""
Hydrodynamic resistance of a ship from its coastdowns, live and from bags.

    import shipdrag_ros as sd

    record = sd.read('coastdown.mcap', ship='ship.yaml')
    sd.estimate(record).plot()
    sd.diagnose(record).summary()

Names are imported when they are first used, so that the command line and the
node pay for none of them. docs/python.md shows how they go together.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shipdrag_ros.errors import ShipdragError
    from shipdrag_ros.library.diagnosis import Diagnosis, diagnose, learn
    from shipdrag_ros.library.record import Coastdown, Record, Resistance, estimate, read
    from shipdrag_ros.library.simulated import simulate
    from shipdrag_ros.library.trends import Trends, trends
    from shipdrag_ros.parameters import Parameters
    from shipdrag_ros.ship import Ship

# before anything imports numba: the same machine code, and so the same bits, in every process and
# on every computer of a kind
os.environ.setdefault('NUMBA_CPU_NAME', 'generic')

__version__ = '0.5.0'

__all__ = [
    'Coastdown',
    'Diagnosis',
    'Parameters',
    'Record',
    'Resistance',
    'Ship',
    'ShipdragError',
    'Trends',
    'diagnose',
    'estimate',
    'learn',
    'read',
    'simulate',
    'trends',
]

_HOME = {
    'Coastdown': 'library.record',
    'Diagnosis': 'library.diagnosis',
    'Parameters': 'parameters',
    'Record': 'library.record',
    'Resistance': 'library.record',
    'Ship': 'ship',
    'ShipdragError': 'errors',
    'Trends': 'library.trends',
    'diagnose': 'library.diagnosis',
    'estimate': 'library.record',
    'learn': 'library.diagnosis',
    'read': 'library.record',
    'simulate': 'library.simulated',
    'trends': 'library.trends',
}


def __getattr__(name: str) -> Any:
    """Import an exported name on its first use."""
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    door = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    globals()[name] = door
    return door


def __dir__() -> list[str]:
    """List the doors alone, so that completion shows nothing else."""
    return list(__all__)
