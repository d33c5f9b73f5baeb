# SPDX-License-Identifier: Apache-2.0
"""
Every number of the regimes: priors, hazards, shares, and what a decision costs.

One table, so that a vessel which behaves otherwise changes a prior here and nothing
else. A craft shorter than `CRAFT_M` has bins shorter than `BIN_S`; `SHORTEST_S`
shrinks with them, in a window that a person claims all times but the hazards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64


class Number(NamedTuple):
    """
    A row of the table.

    Attributes
    ----------
    name
        Of the constant in its module.
    values
        One, the points of a grid, or values with their shares, as text.
    unit
        '1' for ratios.
    source
        What it was learnt from, or why it is so.
    """

    name: str
    values: str
    unit: str
    source: str


Shares = tuple[tuple[float, float], ...]
"""Values, each with its share."""


class NumberTable(list[Number]):
    """
    A table of numbers, in the order in which the docs list them; each is returned as it is listed.
    """

    def number(self, name: str, value: float, unit: str, source: str) -> float:
        """List one number."""
        self.append(Number(name, f'{value:g}', unit, source))
        return value

    def grid(self, name: str, values: tuple[float, ...], unit: str, source: str) -> Float64:
        """List the points of a grid, or numbers that go together."""
        self.append(Number(name, ', '.join(f'{value:g}' for value in values), unit, source))
        return np.array(values)

    def shares(self, name: str, parts: Shares, unit: str, source: str) -> Shares:
        """List values with their shares."""
        said = ', '.join(f'{value:g} ({share:g})' for value, share in parts)
        self.append(Number(name, said, unit, source))
        return parts

    def table(self) -> str:
        """
        Return all of them as a table of Markdown.
        """
        rows = (f'| {" | ".join(each)} |' for each in self)
        return '\n'.join(['| number | value | unit | source |', '|---|---|---|---|', *rows])


NUMBERS = NumberTable()
_number, _grid = NUMBERS.number, NUMBERS.grid

BIN_S = _number('BIN_S', 5.0, 's', 'the filter of a log is 2 to 10 s')
BIN_LENGTH_M = _number('BIN_LENGTH_M', 150.0, 'm', 'of a ship of that bin in a claimed window')
CRAFT_M = _number('CRAFT_M', 60.0, 'm', 'a craft that is shorter has shorter bins, by the root')
LOG_LAG_S = _number('LOG_LAG_S', 4.0, 's', 'middle of the filters of logs')
LOG_LAG_MOST = _number('LOG_LAG_MOST', 30.0, 's', 'no filter of a log is longer')
LOG_LAG_SD = _number('LOG_LAG_SD', 0.9, 'ln', 'of the filter of one log, or GNSS')
GROUND_LAG_S = _number('GROUND_LAG_S', 1.0, 's', 'filter of a GNSS speed')

# the hull
RESISTANCE = _grid(
    'RESISTANCE', (0.20, 0.28), 'ln', 'over the curve by length and volume: mean, sd; wind, sea'
)
RESISTANCE_FILE = _grid(
    'RESISTANCE_FILE', (0.05, 0.25), 'ln', 'over the baseline of the ship file: mean, sd'
)
DRAGGED = _grid(
    'DRAGGED',
    (0.05, 0.5, 0.9, 0.05),
    'ln',
    'more in a glide: the screw windmills, stands, has no pitch, or its revs say nothing',
)
DRAGGED_SHARE = _grid('DRAGGED_SHARE', (0.68, 0.2, 0.1, 0.02), '1', 'of these')
DRAGGED_SD = _grid('DRAGGED_SD', (0.2, 0.5, 0.8, 0.2), 'ln', 'of each')
DRAGGED_EXPONENT = _grid(
    'DRAGGED_EXPONENT',
    (0.0, 0.0, -0.6, 0.0),
    'of that ln',
    'a screw that turns without pitch drags as u does',
)
DRAGGED_EXPONENT_SD = _number('DRAGGED_EXPONENT_SD', 0.2, '1', 'a propeller drags by another law')
WIND_SD = _number('WIND_SD', 0.06, 'of the first resistance', 'a force that stays as she slows')
KEPT_SD = _number('KEPT_SD', 0.15, 'ln', 'of a resistance learnt under power, taken to a glide')
WAVES = _number('WAVES', 0.28, 'Froude', 'where waves slow a hull as much as friction does')
EXPONENT = _grid('EXPONENT', (0.0, 0.35), '1', 'over that of the curve: mean, sd')
EXPONENT_FILE = _grid('EXPONENT_FILE', (0.1, 0.3), '1', 'over that of the baseline: mean, sd')
EXPONENT_WALK = _number('EXPONENT_WALK', 0.4, '1', 'per root of ln u: no law is one power')
NO_THRUST = _number('NO_THRUST', 1.8, '1', 'advance without thrust over that of service')
NO_THRUST_SEEN = _number('NO_THRUST_SEEN', 1.5, '1', 'the same where 5 % of it is left')

# what disturbs her
GUST = _grid('GUST', (0.03, 0.08, 0.2), 'of the resistance', 'sd: wind of 13 %, wave groups')
GUST_S = _number('GUST_S', 40.0, 's', 'wave groups')
WANDER = _grid('WANDER', (0.005, 0.012, 0.03, 0.07, 0.14), 'm/s', 'sd of the slow error of a log')
WANDER_S = _grid('WANDER_S', (12.0, 60.0), 's', 'its time')
WHITE = _grid('WHITE', (0.4, 1.0), '1', 'white noise over the spread of differences of bins')
WHITE_FLOOR = _number('WHITE_FLOOR', 0.0015, 'of the speed', 'no log resolves less')
CURRENT = _grid('CURRENT', (0.3, 0.03), 'm/s', 'sd at first, and of its change')
CURRENT_S = _number('CURRENT_S', 600.0, 's', 'time of its change: eddies of 5 to 60 min')
POWER_DRIFT = _number('POWER_DRIFT', 0.01, 'ln in 10 min', 'sd of the speed under even power')
MEMORY_S = _number('MEMORY_S', 1200.0, 's', 'over which noise is learnt')
BAD = _number('BAD', 0.01, '1', 'share of readings that are something else')
BAD_DENSITY = _number('BAD_DENSITY', 0.1, 's/m', 'their density')
WIDE = _grid('WIDE', (0.05, 3.0), '1', 'share of readings that scatter more, and by what factor')
LIES = _number('LIES', 0.05, '1/h', 'an instrument begins to say nothing true')
SHAFT_DIES = _number('SHAFT_DIES', 0.01, '1/h', 'the same of the sensor of a shaft')
LIES_FIRST = _number('LIES_FIRST', 0.01, '1', 'it has never said anything true')
JOINED = _number('JOINED', 0.001, '1/h', 'another record follows, and nobody says so')
STUCK = _number('STUCK', 0.5, '1', 'share of what is not true that stays where it was')
AMID = _grid(
    'AMID',
    (0.05, 0.1, 12.0),
    '1, of what moves it in a minute, 1/h',
    'a record, or a switch, begins a manoeuvre: share, change of its acceleration, its end',
)
SAILS = _grid('SAILS', (0.17, 0.7), 'Froude, ln', 'speed at first: median, sd')

# switches, each an hour
STOP = _number('STOP', 0.5, '1/h', 'driven to gliding')
TOLD = _grid(
    'TOLD',
    (priors.TOLD_CHANCE.mean, priors.TOLD.sd),
    '1, s',
    'a stop that a person tells is one: chance, and error',
)
LEVEL = _number('LEVEL', 0.5, '1/h', 'driven to another level')
TURN = _number('TURN', 1.0, '1/h', 'driven to turning')
MANOEUVRE = _number('MANOEUVRE', 6.0, '1/h', 'all three within `MANOEUVRING_S` of a switch')
MANOEUVRING_S = _number('MANOEUVRING_S', 1800.0, 's', 'manoeuvres come in groups')
OF_MANOEUVRES = _grid('OF_MANOEUVRES', (0.3, 0.5, 0.2), '1', 'stop, level, turn')
AFTER_KICK = _number('AFTER_KICK', 0.6, '1', 'of switches after one from a glide: stops')
BRAKED = _number('BRAKED', 0.2, '1', 'of stops: at once astern')
GLIDE_LEVEL = _number('GLIDE_LEVEL', 4.0, '1/h', 'gliding to a level')
GLIDE_BRAKE = _number('GLIDE_BRAKE', 0.5, '1/h', 'gliding to braked')
GLIDE_TURN = _number('GLIDE_TURN', 0.5, '1/h', 'gliding to turning without thrust')
BRAKE_GLIDE = _number('BRAKE_GLIDE', 6.0, '1/h', 'braked to gliding')
BRAKE_LEVEL = _number('BRAKE_LEVEL', 2.0, '1/h', 'braked to a level')
TURN_OUT = _number('TURN_OUT', 40.0, '1/h', 'turning to what was before')
FADE_OUT = _number('FADE_OUT', 4.0, '1/h', 'power that is taken off evenly to a level')
SETTLED_S = _number('SETTLED_S', 900.0, 's', 'a level that is held so long is sailing')

# shapes of switches
RUN_DOWN_S = _grid('RUN_DOWN_S', (3.0, 10.0, 24.0, 60.0), 's', 'fuel cut, pitch, controlled')
RUN_DOWN_SHARE = _grid('RUN_DOWN_SHARE', (0.55, 0.22, 0.18, 0.05), '1', 'short by default')
RUN_DOWN_FILE_SD = _number('RUN_DOWN_FILE_SD', 0.5, 'ln', 'of what a ship file says of it')
LEVELS = _grid('LEVELS', (1.15, 0.88, 0.72, 0.58, 0.45, 0.32), '1', 'steps of a telegraph')
LEVELS_SHARE = _grid('LEVELS_SHARE', (0.1, 0.3, 0.25, 0.2, 0.1, 0.05), '1', 'of these')
LEVELS_SD = _grid('LEVELS_SD', (0.3, 0.12, 0.12, 0.12, 0.12, 0.12), 'ln', 'of each')
LEVEL_RAMP_S = _grid('LEVEL_RAMP_S', (15.0, 60.0), 's', 'from level to level')
FADES = _grid('FADES', (0.1, 0.4), 'of u_e in 10 min', 'power that is taken off evenly')
FADES_SHARE = _number('FADES_SHARE', 0.15, '1', 'of switches to another level: evenly to less')
FADES_DRIFT = _number('FADES_DRIFT', 0.3, 'ln in 10 min', 'sd of the rate')
FADES_SD = _number('FADES_SD', 0.6, 'ln', 'of each')
ENGAGE_S = _number('ENGAGE_S', 10.0, 's', 'from no thrust to a level')
BRAKES = _grid('BRAKES', (0.4, 1.0, 2.5), 'of the first resistance', 'astern power, tugs')
BRAKES_SD = _number('BRAKES_SD', 0.47, 'ln', 'a factor of 1.6 either way')
STOPPERS = _grid('STOPPERS', (8.0, 30.0), 'of the first resistance', 'lines, wheels, a quay')
TURNS = _grid('TURNS', (0.12, 0.4, 1.1, 3.0), 'of the resistance', 'helm')
TURNS_SD = _number('TURNS_SD', 0.35, 'ln', 'of each')
TURNS_DRIFT = _number('TURNS_DRIFT', 0.3, 'ln', 'of each in a minute')
TURN_RATE = _number('TURN_RATE', 0.2, 'ship lengths', 'rate of turn over u / L')
STEADY_TURNS = _number('STEADY_TURNS', 0.03, '1', 'share of bins with a yaw like that of a turn')

# what a person claims
ANY_BODY = _grid('ANY_BODY', (0.5, 0.7), 'ln', 'over the friction of a hull: mean, sd')
ODD = _grid('ODD', (0.0, -2.0, 2.5), 'ln', 'over that: a hull ahead, on wheels, or sideways')
ODD_SHARE = _grid('ODD_SHARE', (0.8, 0.1, 0.1), '1', 'of these')
ANY_EXPONENT = _grid('ANY_EXPONENT', (0.0, 0.9), '1', 'over that of friction: wheels to waves')
ANY_WIND_SD = _number('ANY_WIND_SD', 0.15, 'of the first resistance', 'slow craft, wheels')
ANY_GUST = _grid('ANY_GUST', (0.01, 0.03, 0.08, 0.2), 'of the resistance', 'and in a basin')
ENGINE = _grid('ENGINE', (0.01, 0.3, 0.3, 0.3), 'of the resistance', 'what it gives over it: sd')
ENGINE_GUST = _grid('ENGINE_GUST', (0.0, 0.02, 0.15, 1.0), 'the same', 'how it is handled: sd')
ENGINE_MOVES = _grid('ENGINE_MOVES', (0.01, 0.01, 0.1, 0.3), '1', 'bins in which its revs change')
RUDDER = _grid('RUDDER', (0.08, 0.5), 'rad', 'angle of one that keeps a course, that turns: sd')

# the shaft, revs times pitch over those of steady sailing
SHAFT_TEMPER = _number('SHAFT_TEMPER', 0.35, '1', 'of its log likelihood: errors last a minute')
SHAFT_SD = _grid('SHAFT_SD', (0.015, 0.04), '1', 'its own error, and that of an expectation')
SHAFT_FIRST_SD = _number('SHAFT_FIRST_SD', 0.12, '1', 'of what a level should have')
WINDMILL = _grid('WINDMILL', (0.5, 0.13, 0.85), '1', 'over u / U: mean, sd, most; 108 glides')
STOPS_TURNING = _number(
    'STOPS_TURNING', 0.01, '1', 'of bins: friction holds a screw; propulsion 101, 102'
)
CREEPS = _number('CREEPS', 0.1, '1', 'revs that give a hundredth of the thrust')
SHAFT_LIES = _number('SHAFT_LIES', 0.002, '1', 'least density')

# what is made of it: the only loss
ANNOUNCE = _grid(
    'ANNOUNCE',
    (0.6, 0.03, 0.002),
    '1',
    'P(gliding) above; below, with that of the glide announced: an end is not taken back',
)
CLAIM = _number(
    'CLAIM', 0.35, '1', 'what is kept of a claimed window has more; at 0.5 car_michelin60a is cut'
)
SHORTEST_S = _number('SHORTEST_S', 30.0, 's', 'of a coastdown')

EXPLAINED_SHARE = _grid(
    'EXPLAINED_SHARE', (0.0, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0), '1', 'of the records learnt on'
)
EXPLAINED = _grid(
    'EXPLAINED',
    (-1.27, -0.18, -0.12, -0.06, 0.0, 0.05, 0.09, 0.28),
    'nats a reading',
    'by which these are explained less well: log density over its expectation',
)
