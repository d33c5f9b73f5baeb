# SPDX-License-Identifier: Apache-2.0
"""
Every number by which log and track vouch for each other: priors, shares, and what a doubt costs.

A value in brackets is its share. docs/results/regimes_numbers.txt prints the table.
"""

from __future__ import annotations

from shipdrag_ros.coastdown.regimes.numbers import NumberTable

NUMBERS = NumberTable()
_number, _shares = NUMBERS.number, NUMBERS.shares

# her motion
LEVEL = _shares('LEVEL', ((0.1, 0.2), (6.0, 0.8)), 'm/s', 'she lies still, or sails')
INERTIA = _shares(
    'INERTIA', ((0.01, 0.7), (0.1, 0.2)), 'm/s in 1 s', 'her change, by the root of time'
)
QUICK = _number('QUICK', 0.1, '1', 'share of minutes in which a quick craft is handled ...')
QUICK_M_M_S = _number('QUICK_M_M_S', 10.0, 'm x m/s in 1 s', '... over her length')
ASTERN = _number('ASTERN', 0.005, '1', 'share of minutes in which she makes way astern')
# the water
CURRENT = _shares('CURRENT', ((0.4, 0.7), (1.0, 0.3)), 'm/s', 'between log and ground')
TURNS = _number('TURNS', 0.1, '1', 'chance that she turns in it')
SWING_S = _number('SWING_S', 40.0, 's', 'in which it is another one then, or in an eddy')
TURN_S = _number('TURN_S', 60.0, 's', 'the same in a long record')
ANOTHER = _number('ANOTHER', 0.2, '1', 'chance that it was another one up to a turn')
DRIFTS = _shares(
    'DRIFTS', ((0.002, 0.5), (0.01, 0.5)), 'm/s in 1 s', 'its change; over a minute the last'
)
# a source that measures her
NOISE = _shares(
    'NOISE', ((0.03, 0.4), (0.1, 0.35), (0.3, 0.25)), 'm/s', 'of 5 s of a log, a speed over ground'
)
TRACK_NOISE = _shares(
    'TRACK_NOISE', ((0.03, 0.3), (0.1, 0.3), (0.3, 0.2), (1.0, 0.2)), 'm/s', 'radar: 4 to 10 m'
)
SLOW = _number('SLOW', 0.15, 'm/s', 'an offset; half of it by its filter while she slows')
JITTER = _number('JITTER', 0.2, 'm/s', 'of a log in one second')
OFFSET = _number('OFFSET', 0.1, 'm/s', 'of a log, always')
PLACE = _shares('PLACE', ((1.0, 0.5), (8.0, 0.5)), 'm', 'of a way made good')
LEAST = _number('LEAST', 0.03, 'm/s', 'of a way made good that lasts long')
SOUND = _shares('SOUND', ((0.02, 0.8), (0.06, 0.2)), 'ln', 'scale: a Doppler log, a paddle wheel')
# one that does not
ANYWHERE = _shares('ANYWHERE', ((0.1, 0.4), (8.0, 0.6)), 'm/s', 'dead, or anything')
WANDERS = _shares('WANDERS', ((0.0, 0.3), (0.3, 0.7)), 'm/s in 1 s', 'still, or wandering')
JUMPS = _shares(
    'JUMPS',
    ((0.03, 0.15), (0.1, 0.2), (0.3, 0.25), (1.0, 0.2), (3.0, 0.2)),
    'm/s',
    'smooth to jumping',
)
WRONG_LOG = _number('WRONG_LOG', 0.04, '1', 'share of minutes: a log fouls')
WRONG_FIX = _number('WRONG_FIX', 0.003, '1', 'the same of a fix: hardly ever')
SCALED_LOG = _number('SCALED_LOG', 0.5, '1', 'of these: the ship in a wrong scale')
SCALED_FIX = _number('SCALED_FIX', 0.1, '1', 'the same; of a track: in kilometres')
REVERSED = _number('REVERSED', 0.05, '1', 'of logs in a wrong scale: a wrong sign')
WIDE = _number('WIDE', 0.5, 'ln', 'a scale that is wrong ...')
UNITS = _number('UNITS', 0.5, '1', '... but for the share that is in another unit')
UNIT = _number('UNIT', 0.04, 'ln', 'which is as near to it')
TOGETHER = _number('TOGETHER', 0.5, '1', 'share with one driver, setting or aerial')
STILL = _number('STILL', 0.5, '1', 'share of minutes after one in which it was wrong')
# what is said and done
WRONG = _number('WRONG', 0.9, '1', 'chance that is said: a false alarm costs nine misses')
UNUSED = _number('UNUSED', 0.75, '1', 'chance to say nothing of her, to be left out ...')
LASTS_S = _number('LASTS_S', 70.0, 's', '... if it lasts: the filter of a radar that jumps')
HOLD_S = _number('HOLD_S', 300.0, 's', 'of agreement after which it is used again')
DISTINCT = _number('DISTINCT', 0.9, '1', 'of the readings of a shaft that is not coarse')
