# SPDX-License-Identifier: Apache-2.0
"""Every prior of the noise, as data; docs/results/priors.md has it (`python docs/tables.py`)."""

from __future__ import annotations

from shipdrag_ros.parameter import Declared, log_normal

_REALITY = 'records of many craft, as a range'
_TAKEN = 'judgement'
_FILTERED = 'samples behind a filter err alike'

GUST = Declared('-', 'gusts, of r(u_0)', log_normal(0.011, 1.0), '', _REALITY)
GUST_TIME = Declared(
    '-',
    'gusts, time: over the root of the damping',
    log_normal(18.0, 0.9),
    '',
    '60 to 300 s for ships, seconds for boats',
)
WATER = Declared('-', 'slow motion of the water', log_normal(0.02, 0.8), 'm/s', _REALITY)
WATER_SPEED = Declared('-', 'u_0 below which it is less, in proportion', 5.0, 'm/s', _TAKEN)
WATER_TIME = Declared('-', 'slow motion of the water, time', log_normal(600.0, 0.8), 's', _REALITY)
LOG = Declared('-', 'slow error of a log, of its white noise', log_normal(0.3, 1.0), '', _REALITY)
LOG_LEAST = Declared('-', 'the same of u_0, at least', 1e-3, '', _REALITY)
LOG_TIME = Declared('-', 'slow error of a log, time', log_normal(40.0, 1.1), 's', _REALITY)
PLACE = Declared(
    '-',
    'slow error of a position: white noise of a mean, and of u_0 at least this',
    log_normal(0.1, 1.6),
    's',
    _REALITY,
)
PLACE_TIME = Declared('-', 'slow error of a position, time', log_normal(80.0, 1.2), 's', _REALITY)
WHITE_LOG = Declared('-', 'white of a log, of its scatter', log_normal(1.3, 0.6), '', _FILTERED)
WHITE_GROUND = Declared(
    '-', 'white over ground, of its scatter', log_normal(1.3, 0.6), '', _FILTERED
)
WHITE_PLACE = Declared(
    '-', 'white of positions, of their scatter', log_normal(1.0, 0.4), '', _TAKEN
)
HOLD = Declared(
    '-',
    "damping of the speed by an engine that holds torque, power or revs, of the hull's",
    log_normal(1.4, 0.25),
    '',
    'a ship that is slowed has more thrust: 1 to 2',
)
TABLE = tuple(each for each in vars().copy().values() if isinstance(each, Declared))
"""What docs/results/priors.md prints, in its order."""
LEARNT = tuple(each for each in TABLE if each.sd)
"""Those of a setting, in its order."""
