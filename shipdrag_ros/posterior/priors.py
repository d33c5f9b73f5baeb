# SPDX-License-Identifier: Apache-2.0
"""
Every prior of the model, as data.

docs/results/priors.md prints this table (`python docs/tables.py`). Those of the noise stand in
`inference.priors`, those of an effect in `data/effects.yaml` or its module in
`simulation.effects`, with the usual odds in `simulation.effect.Effect`.
"""

from __future__ import annotations

from shipdrag_ros.inference.decision import mixture
from shipdrag_ros.parameter import Declared, half_normal, log_normal, normal

_REALITY = 'records of many craft, as a range'
_TAKEN = 'judgement'

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
# what acts after the stop that no input shows
HELD_FORCE, THRUST_LEFT = 'held force', 'thrust left'
HELD = Declared(
    'h',
    'a force from the stop on that no speed changes, over r there; none is as usual',
    normal(0.5),
    '',
    'lines of tugs 0.1 to 0.4, astern power 0.3 to 1',
)
HELD_CHANCE = Declared('h', 'chance of such a force', 0.03, '', _TAKEN)
LEFT = Declared(
    'l',
    'thrust that is left after the stop, over that before it; none is as usual',
    normal(0.25, mean=0.3),
    '',
    'power taken off in steps; the effect residual_thrust',
)
LEFT_CHANCE = Declared('l', 'chance of it, unless all shafts that are read stand', 0.1, '', _TAKEN)
LEFT_S = Declared('-', 'time in which it falls', 200.0, 's', 'the same')
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
TOLD_CHANCE = Declared(
    't_0', 'chance that such a stop is one, else it is within the hour', 0.9, '', _TAKEN
)
# the instruments
LOG_SCALE = Declared('b_1', 'scale of a log, less one', normal(0.02), '', 'Doppler logs: 2 %')
LOG_OFFSET = Declared('b_0', 'offset of a log', normal(0.02), 'm/s', 'zeroed logs')
LOG_UNFILTERED = Declared('lambda', 'delay of a log without a filter', normal(0.3), 's', _REALITY)
UNFILTERED_CHANCE = Declared('lambda', 'share of logs without a filter', 0.5, '', _REALITY)
LOG_LAG = Declared(
    'lambda', 'filter of a log that has one', normal(4.0, mean=5.0), 's', '3 to 10 s'
)
GROUND_LAG = Declared(
    'lambda_g', 'filter of a speed over ground', normal(3.0, mean=1.0), 's', '1 to 8 s, or none'
)


def any_log_lag() -> tuple[float, float]:
    """
    Return mean and sd of the filter of a log that may have none [s].
    """
    none, some, chance = LOG_UNFILTERED, LOG_LAG, UNFILTERED_CHANCE.mean
    return mixture(((chance, none.mean, none.sd), (1.0 - chance, some.mean, some.sd)))


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
AIR_AREA = Declared(
    'A C',
    'air drag area over V^(2/3), where the ship file states none',
    log_normal(0.5, 0.6),
    '',
    'merchant ships in ballast and laden: 0.25 to 1',
)
DEPTH_READ = Declared('h', 'relative error of an echo sounder', normal(0.03), '', _REALITY)
DEPTH_FORMULA = Declared(
    '-',
    'relative error of what a known depth adds, over all speeds; one in ten three times as wide',
    normal(0.3),
    '',
    'Lackenby (1963) has about half as much again as Raven (2016)',
)
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
SHELTERED = Declared(
    '-',
    'speed at the stop below which current and wind are weaker, by its square',
    5.0,
    'm/s',
    'slow craft are tried in basins',
)


def sheltered(speed_m_s: float) -> float:
    """
    Return by how much current and wind are weaker, 0 .. 1: slow craft are tried in basins.

    Parameters
    ----------
    speed_m_s
        At the stop.
    """
    return min(1.0, speed_m_s / SHELTERED.mean) ** 2


SAME_DAY = Declared(
    '-', 'time between runs from which hull and air may be others', 12.0, 'h', _TAKEN
)
UNNAMED_ODDS = Declared(
    '-',
    'odds of something smooth without a name, in each place where it may be',
    0.015,
    '',
    _TAKEN,
)
SMOOTH_SIZES = (0.015, 0.05, 0.15, 0.5, 1.5)
"""Points of its size in time, relative to r or to the speed, all alike."""
SMOOTH_TAUGHT = SMOOTH_SIZES[1:3]
"""The same while noise is learnt."""
SMALL_COMPONENTS = Declared(
    '-',
    'components of a weak current or wind over those of a usual one, which is as probable',
    0.25,
    '',
    _TAKEN,
)
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
ANOTHER_CHANCE = Declared(
    '-',
    'chance that a craft without a baseline is no displacement ship, or far from clean',
    0.2,
    '',
    _TAKEN,
)
ANOTHER_LEVELS = (1.0, 4.0, 16.0, 64.0)
"""Of its resistance over that of the generic hull, all alike."""
ANOTHER_SHAPES = (0.03, 0.1)
"""Sizes of its s, all alike."""
SHIP_DRY = Declared(
    '-', 'forces of a ship that water does not make, of r at the stop', 1e-3, '', _TAKEN
)

# the diagnosis' other instruments
COMPASS = Declared('-', 'error of a compass, leeway included', normal(0.03), 'rad', _TAKEN)
COURSE = Declared(
    '-',
    'direction through water by the way over ground alone',
    normal(0.1),
    'rad',
    _TAKEN,
)
YAW = Declared('-', 'yaw of a mean over a minute', normal(0.03), 'rad', 'a ship yaws in the waves')
YAW_WANDERS = Declared(
    '-',
    'slow part of that, of ship and compass; her course wanders with it',
    normal(0.04),
    'rad',
    'steady stretches of sailing records',
)
YAW_WANDERS_S = Declared('-', 'the same, time', 300.0, 's', _REALITY)
SHAFT = Declared('-', 'shaft speed in a minute, of the steady one', normal(0.03), '', _TAKEN)
SHAFT_OFF = Declared('-', 'the same of all minutes of a glide', normal(0.05), '', _TAKEN)
SHAFT_FRICTION = Declared(
    '-',
    'speed, over that at the stop, at which friction stops a shaft that is free in the baseline',
    log_normal(0.2, 0.7),
    '',
    '0.1 of bearings alone, 0.2 to 0.5 of a diesel that stays coupled',
)
SHAFT_FALL = Declared(
    'tau',
    'logarithm of the run-down of the thrust over that of a shaft that is seen to stop',
    normal(0.6),
    '',
    'thrust is gone before or after its shaft stands, by the propeller and engine',
)
DRIVEN_SHAFT = Declared(
    '-',
    'share of propellers not locked whose shaft turns on, at no pitch',
    0.13,
    '',
    _TAKEN,
)
# stated errors, and sailing without a coastdown
STATED_POWER = Declared(
    '-', 'power of a stated variance that holds', normal(0.5, mean=1.0), '', _TAKEN
)
SAILING_LOG = Declared(
    '-', 'white and slow error of a log over a usual residual', log_normal(1.0, 1.0), '', _TAKEN
)
SAILING_WATER = Declared('-', 'slow motion of the water', log_normal(0.04, 0.7), 'm/s', _TAKEN)
SAILING_LOG_TIME = Declared('-', 'slow error of a log, time', log_normal(120.0, 0.8), 's', _TAKEN)
SAILING_WATER_TIME = Declared(
    '-', 'slow motion of the water, time', log_normal(1200.0, 0.8), 's', _TAKEN
)
SAILING_SCALE = Declared('-', 'scale of a log in order, less one', normal(0.005), '', _TAKEN)
SAILING_CURRENT = Declared(
    '-', 'steady current that is not worth a word', normal(0.02), 'm/s', _TAKEN
)
UNSTATED_FORM = Declared(
    '-', 'relative sd of a baseline learnt from runs too few to show it', 0.05, '', _TAKEN
)
# several runs, and earlier diagnoses
DIFFERS = Declared('-', 'chance that an effect differs between runs of one day', 0.03, '', _TAKEN)
DIFFERS_LATER = Declared('-', 'the same of runs of other days', 0.3, '', _TAKEN)
DIFFERS_WEATHER = Declared('-', 'the same of the weather of other days', 0.5, '', _TAKEN)
EARLIER_ERRS = Declared(
    '-', 'share of earlier diagnoses that are wrong of an effect', 0.02, '', _TAKEN
)
EARLIER_COUNTS = Declared(
    '-', 'power of the likelihood of an earlier diagnosis', 0.5, '', 'Ibrahim and Chen (2000)'
)
EARLIER_UNSEEN = Declared(
    '-', 'share of the effects there that a diagnosis does not list', 0.5, '', _TAKEN
)
EARLIER_SIZE = Declared(
    '-', 'by which a size that stays differs from the one found', normal(0.1), '', _TAKEN
)

TABLE = tuple(each for each in vars().copy().values() if isinstance(each, Declared))
"""What docs/results/priors.md prints, in its order."""
