# SPDX-License-Identifier: Apache-2.0
"""The histories, their columns, and the bins that they are told."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.samples import Float64, Int64

KEPT = 300  # histories
ROOM = 1400  # with those born since they were last thinned out
SWITCHES = 12  # that a history remembers

# the state of a history; what changes within a bin: ln u, ln resistance over the curve of a hull,
# gust [m/s^2], slow errors of the log and of the speed over ground [m/s], true way less the way as
# read [m], what a filter of usual lag is behind [m/s]
LN_U, LN_A, GUST, WANDER, EDDY, WAY, LAG = range(7)
# and what does not: the exponent of the resistance over that of the curve, what the regime leaves
# open, current [m/s], ln of the log's own lag over the usual one
POWER, OPEN, CURRENT, LONGER = range(7, 11)
CHANGING, STATES = 7, 11

DRIVEN, LEVEL, GLIDE, BRAKE, TURN, GLIDE_TURN = range(6)
AMID = 6  # amid a manoeuvre under power, as a record may begin and a claimed window may be

HISTORY = np.dtype(
    [
        ('regime', 'i8'),
        ('kind', 'i8'),  # how the screw is dragged, or whether torque is held
        ('liar', 'i8'),  # the input that says nothing true
        ('count', 'i8'),  # of switches
        ('glided', 'i8'),  # whether she has glided
        ('glide_kind', 'i8'),  # how the screw was dragged then
        ('weight', 'f8'),  # logarithm
        ('behind', 'f8'),  # of the best, before births
        ('since', 'f8'),  # of its last switch [s]
        ('before', 'f8'),  # ln u_e before it
        ('ramp_from', 'f8'),  # ln u_e at the start of its ramp
        ('ramp_s', 'f8'),  # length of ramp or run-down [s]
        ('first_a', 'f8'),  # first resistance [m/s^2]
        ('thrust', 'f8'),  # at the stop over that: of balance, or of an engine astern
        ('wind', 'f8'),  # a force that stays, over that, before a turn or a brake in a glide
        ('wind_var', 'f8'),
        ('gust_a', 'f8'),  # resistance under even power, of which gusts are parts [m/s^2]
        ('revs', 'f8'),  # over those expected, or held
        ('free', 'f8'),  # revs over speed of a free screw, or over those of a run-down
        ('a0', 'f8'),  # prior of ln a
        ('a_var', 'f8'),
        ('p0', 'f8'),  # and of the exponent
        ('p_var', 'f8'),
        ('stays', 'f8'),  # where an instrument that says nothing true stays
        ('stays_way', 'f8'),  # and its fixes
        ('stuck', 'f8'),  # chance that a shaft that says nothing true stays
        ('mean_u', 'f8'),  # over the bin, less that at its end
        ('mean_lag', 'f8'),
        ('excess', 'f8'),  # log density of the bin's readings of motion, over its expectation
    ],
    align=True,
)
"""What else is known of a history."""
SWITCH = np.dtype([('at', 'f8'), ('what', 'i8'), ('ramp', 'f8')], align=True)
"""When it was [s since the start], the regime entered and its ramp [s]."""
_PAST = np.dtype([('row', HISTORY), ('switched', SWITCH, (SWITCHES,))])
NOBODY, THE_LOG, THE_TRACK, THE_SHAFTS = range(4)
GOVERNED, TORQUE, FADING = range(3)  # a level: revs are held, or torque; or it falls evenly
WINDMILLS, STANDS, HELD, STUCK = range(4)  # a screw in a glide; the last by its sensor alone

# what a bin says; NaN where nothing
LOG, GROUND, ADVANCE, RATE, HIGH, LOW = range(6)
SHAFTS = 6  # and the three after it: revs times pitch of each shaft [rad/s]
GONE = 10  # when revs over speed fell through those without thrust [s since the start]
RANGES = 11  # and that after it: range of the seconds of log and of speed over ground
RUDDER = 13  # angle [rad]
SAID = 14

# noise in use: gust over resistance, sd and time of the slow error of log and speed over ground,
# white noise of log, speed over ground and fixes, their walk, sd of the rate of turn
N_GUST, N_WANDER, N_WANDER_S, N_EDDY, N_EDDY_S, N_LOG, N_GROUND, N_FIX, N_WALK, N_RATE = range(10)
NOISES = 10


class Histories(NamedTuple):
    """
    The bank; slots from `used[0]` on hold nothing.

    Attributes
    ----------
    used, clock : (1,)
        Histories; bins since the start.
    mean, spread
        (ROOM, STATES) and (ROOM, STATES, STATES): state and covariance.
    row : (ROOM,)
        A `HISTORY` each.
    switched : (ROOM, SWITCHES)
        A `SWITCH` each.
    words : (ROOM, n) int64
        The memory of both, to copy it.
    """

    used: Int64
    clock: Int64
    mean: Float64
    spread: Float64
    row: NDArray[np.void]
    switched: NDArray[np.void]
    words: Int64

    @classmethod
    def fresh(cls) -> Histories:
        """
        Return a bank without a history.
        """
        past = np.zeros(ROOM, _PAST)
        return cls(
            np.zeros(1, np.int64),
            np.zeros(1, np.int64),
            np.zeros((ROOM, STATES)),
            np.zeros((ROOM, STATES, STATES)),
            past['row'],
            past['switched'],
            past.view(np.int64).reshape(ROOM, -1),
        )


class BankSetting(NamedTuple):
    """
    What a bank is told once.

    Attributes
    ----------
    hull
        Of the ship.
    step_s
        Length of a bin [s].
    pace
        By which the times of the table shrink.
    forgets
        Share of what was learnt under power that a bin outdates.
    shafts
        How many are read.
    told_s
        When a person says that the engine was stopped [s since the start]; NaN where nobody does.
    engine
        What an engine may give or take in a window that a person claims [m/s^2]; 0 where a record
        is followed, in which she sails evenly between manoeuvres.
    """

    hull: HullPrior
    step_s: float
    pace: float
    forgets: float
    shafts: int
    told_s: float
    engine: float

    @classmethod
    def of(cls, hull: HullPrior, step_s: float, *, shafts: int = 0) -> BankSetting:
        """
        Return the setting of a bank with bins of `step_s` that follows a record.
        """
        return cls(hull, step_s, 1.0, step_s / n.MEMORY_S, shafts, np.nan, 0.0)
