# SPDX-License-Identifier: Apache-2.0
"""
Every prior of the model, as data.

docs/model.md prints this table (`python docs/tables.py`). Those of the noise stand in
`inference.learning`, those of an effect in `data/effects.yaml` or its module in
`simulation.effects`, with the usual odds in `simulation.effect.Effect`.
"""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.parameter import Prior, half_normal, log_normal, normal


@dataclass(frozen=True)
class Declared:
    """
    A prior with its letter, unit and source.

    Attributes
    ----------
    letter
        As in docs/model.md.
    meaning
    prior
        A number where it is taken as known.
    unit
        '' for a pure number.
    source
        A publication, or the records that it was learnt from.
    """

    letter: str
    meaning: str
    prior: Prior | float
    unit: str
    source: str

    @property
    def mean(self) -> float:
        """Mean of a normal prior, median of a log-normal one, or the number."""
        return self.prior.first if isinstance(self.prior, Prior) else self.prior

    @property
    def sd(self) -> float:
        """Standard deviation, of the logarithm of a log-normal one; 0 of a number."""
        return self.prior.second if isinstance(self.prior, Prior) else 0.0


_REALITY = 'records of many craft, as a range'

# the law of the hull
GENERIC_FRICTION = Declared(
    'theta_f',
    'friction over ITTC-57 with k = 0.2, less one, without a baseline; wetted surface from '
    'length and volume',
    normal(0.6, mean=0.4),
    '',
    'form factors 0.1 to 0.5, roughness, dragged propeller, appendages',
)
GENERIC_WAVE = Declared(
    'theta_w',
    'wave part over C_W = 0.0008 (Fr / 0.22)^4, less one, without a baseline',
    normal(1.0),
    '',
    'C_W of 25 model tests at Fr 0.22: 0 to 0.002',
)
GENERIC_HUMPS = Declared(
    's_w',
    'humps of that wave part, relative to it, at each Fr/50 by itself',
    normal(0.2),
    '',
    'C_W of model tests about a power of Fr: half to twice',
)
LAW_ERROR = Declared(
    's',
    'size of the error of the law, relative to r, in every hypothesis',
    half_normal(0.015),
    '',
    'residuals of model tests about two parts: 0.5 to 2 %',
)
SHAPE_OF_MORE = Declared(
    's',
    'size of s beside more friction, relative to it: what is added is seldom in proportion',
    0.2,
    '',
    'roughness, locked propellers and shallow water over the speed, as formulas',
)
# the thrust
THRUST = Declared(
    'q',
    'law of the thrust: 0 the square of the shaft speed, -1 as the shaft, 1 gone at once, '
    '1.2 a propeller that brakes once it turns slowly',
    normal(0.8, mean=0.2),
    '',
    'four-quadrant open-water data of B4-70',
)
RUN_DOWN = Declared(
    'tau',
    'time of the run-down of the shaft where neither ship file nor shaft says it',
    log_normal(3.0, 1.0),
    's',
    _REALITY,
)
RUN_DOWN_SHAPE = Declared(
    'tau',
    'error of a run-down that is seen or stated, relative: no shaft falls as an exponential',
    normal(0.15),
    '',
    _REALITY,
)
STOP = Declared(
    't_0',
    'time of the stop, of an onset that no shaft shows',
    normal(30.0),
    's',
    'dates of onsets found from the speed',
)
TOLD = Declared(
    't_0', 'time of a stop that a person tells', normal(5.0), 's', 'said within some seconds'
)
TOLD_CHANCE = 0.9
"""That a stop that a person tells is one; else it is some time within the hour."""
# the instruments
LOG_SCALE = Declared('b_1', 'scale of a log, less one', normal(0.02), '', 'Doppler logs: 2 %')
LOG_OFFSET = Declared('b_0', 'offset of a log', normal(0.02), 'm/s', 'zeroed logs')
LOG_UNFILTERED = Declared(
    'lambda', 'delay of a log without a filter: half of the logs', normal(0.3), 's', _REALITY
)
LOG_LAG = Declared(
    'lambda', 'filter of a log that has one', normal(4.0, mean=5.0), 's', '3 to 10 s'
)
GROUND_LAG = Declared(
    'lambda_g', 'filter of a speed over ground', normal(3.0, mean=1.0), 's', '1 to 8 s, or none'
)
# the water
CURRENT = Declared('c', 'current along the track', normal(0.4), 'm/s', 'steady 0.1 to 0.8 m/s')
WRONG = Declared(
    'epsilon',
    'chance that a reading is anything within the range of its input',
    0.01,
    '',
    _REALITY,
)
CALM_CURRENT = Declared(
    'c', 'the same where none is missing', normal(0.05), 'm/s', 'still water is seldom still'
)
# the weather
LIGHT_AIR = Declared(
    'w', 'true wind where little blows, ahead and across', normal(1.2), 'm/s', _REALITY
)
WINDY = Declared(
    'w',
    'chance that more blows, as much as the effect has it, where neither anemometer nor fact says',
    0.5,
    '',
    'mean winds at sea of 4 to 9 m/s; crews choose calm days for trials',
)
WIND_OFFSET = Declared(
    'w', 'error of a true wind from an anemometer', normal(0.6), 'm/s', 'a hull bends the flow'
)
WIND_GAIN = Declared('w', 'gain of an anemometer, less one', normal(0.05), '', _REALITY)
WIND_TURNED = Declared('w', 'by which a vane is turned', normal(0.05), 'rad', _REALITY)
YAW = Declared('-', 'heading of a minute about its course', normal(0.03), 'rad', 'yaw in waves')
YAW_WANDERS = Declared(
    '-',
    'slow part of that, of ship and compass',
    normal(0.04),
    'rad',
    'steady stretches of sailing records',
)
YAW_WANDERS_S = Declared('-', 'the same, time', 300.0, 's', _REALITY)
AIR_AREA = Declared(
    'A C',
    'air drag area over V^(2/3), where the ship file states none',
    log_normal(0.5, 0.6),
    '',
    'merchant ships in ballast and laden: 0.25 to 1',
)
DEPTH_READ = Declared('h', 'relative error of an echo sounder', normal(0.03), '', _REALITY)
LENGTH_OVER_BREADTH = Declared(
    'L/B', 'for the effect of the depth, where the ship file states no breadth', 6.5, '', _REALITY
)
BLOCK = Declared('C_B', 'the same where it states no draught', 0.7, '', _REALITY)
FREE_SHAFT = Declared(
    '-',
    'shaft speed of a propeller that the water turns, over that under power',
    normal(0.15, mean=0.5),
    '',
    'four-quadrant open-water data of B4-70',
)
_SHELTERED_M_S = 5.0


def sheltered(speed_m_s: float) -> float:
    """
    Return by how much current and wind are weaker, 0 .. 1: slow craft are tried in basins.

    Parameters
    ----------
    speed_m_s
        At the stop.
    """
    return min(1.0, speed_m_s / _SHELTERED_M_S) ** 2


SAME_DAY_S = 12 * 3600.0
"""Between runs: farther apart the hull may be another, and the air is."""
UNNAMED_ODDS = 0.015
"""Prior odds of something smooth without a name, in each place where it may be."""
SMOOTH_SIZES = (0.015, 0.05, 0.15, 0.5, 1.5)
"""Points of its size in time, relative to r or to the speed, all alike."""
SMALL_COMPONENTS = 0.25
"""Size of the components of a weak current or wind, which is as probable as a usual one."""
# what a hull may differ by: probabilities, and points of what a size is averaged over
NOTHING, FRICTION_ALONE, SMOOTH = 'nothing', 'friction', 'smooth in u'
CHANCES = {NOTHING: 0.4, FRICTION_ALONE: 0.3, SMOOTH: 0.3}
"""Prior probability of each, where a baseline is stated."""
HALF_NORMAL = ((0.4, 0.6), (1.4, 0.4))
"""Points and weights of a half-normal size, in its standard deviation."""
LOG_UNIFORM = (0.03, 0.1, 0.3)
"""Points of a size in which the hull differs from the baseline, all alike: of more friction, or of
friction, waves and s where something smooth in u is missing."""
WIDE = (0.01, 0.03, 0.1)
"""The same without a baseline."""
ANOTHER_CRAFT = 'another craft'
ANOTHER_CHANCE = 0.2
"""Of a craft without a baseline that is no displacement ship, or far from clean."""
ANOTHER_LEVELS = (1.0, 4.0, 16.0, 64.0)
"""Of its resistance over that of the generic hull, all alike."""
ANOTHER_SHAPES = (0.03, 0.1)
"""Sizes of its s, all alike."""
SHIP_DRY = 1e-3
"""Size of forces of a ship that water does not make, of r at the stop."""
UNFILTERED_CHANCE = 0.5
"""Of a log."""

TABLE: tuple[Declared, ...] = (
    GENERIC_FRICTION,
    GENERIC_WAVE,
    GENERIC_HUMPS,
    LAW_ERROR,
    SHAPE_OF_MORE,
    THRUST,
    RUN_DOWN,
    RUN_DOWN_SHAPE,
    STOP,
    TOLD,
    LOG_SCALE,
    LOG_OFFSET,
    LOG_UNFILTERED,
    LOG_LAG,
    GROUND_LAG,
    CURRENT,
    CALM_CURRENT,
    FREE_SHAFT,
    WRONG,
    LIGHT_AIR,
    WINDY,
    WIND_OFFSET,
    WIND_GAIN,
    WIND_TURNED,
    YAW,
    YAW_WANDERS,
    YAW_WANDERS_S,
    AIR_AREA,
    DEPTH_READ,
    LENGTH_OVER_BREADTH,
    BLOCK,
)
"""What docs/model.md prints, in its order."""
