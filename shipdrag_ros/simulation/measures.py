# SPDX-License-Identifier: Apache-2.0
"""What can be done to separate effects, and what it costs the crew."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum


class Measure(StrEnum):
    """What can be done to separate two effects, as it is advised."""

    RECIPROCAL_RUN = 'a run on the reciprocal heading'
    ANOTHER_COURSE = 'a leg on another course'
    OTHER_SPEED = 'a run that begins or ends at another speed'
    ANOTHER_RUN = 'another run of the same ship'
    RADAR = 'radar or GNSS positions'
    LOG = 'a speed log'
    WIND = 'an anemometer (wind_apparent)'
    DEPTH = 'an echo sounder (depth)'
    DEEP_WATER = 'a run in deep water'
    HEADING = 'a compass (heading)'
    SHAFT = 'the shaft speed (shaft)'
    RUDDER = 'the rudder angle (rudder)'
    THIRD_SPEED = 'a third source of speed, GNSS beside log and radar'
    WITHOUT_CABLE = 'a run without the cable'
    FREE_PROPELLER = 'a run with the propeller turning freely'
    CLEAN_HULL = 'a run after the hull is cleaned'
    DRAUGHT = 'the draughts, read on both sides fore and aft'
    FAST_CHANGE = 'a quick change of speed at a known time'


class Cost(StrEnum):
    """What a measure costs the crew."""

    LOOK = 'a look'
    LEG = 'a few minutes on another course'
    RUN = 'another run'
    GEAR = 'gear to be rigged or hauled in'
    PASSAGE = 'a passage elsewhere'
    DIVE = 'a diver or a dock'

    @property
    def hours(self) -> float:
        """About as many hours of the ship."""
        return _HOURS[self]


_HOURS = {
    Cost.LOOK: 0.1,
    Cost.LEG: 0.3,
    Cost.RUN: 1.0,
    Cost.GEAR: 2.0,
    Cost.PASSAGE: 6.0,
    Cost.DIVE: 48.0,
}
COSTS: Mapping[Measure, Cost] = {
    Measure.RECIPROCAL_RUN: Cost.RUN,
    Measure.ANOTHER_COURSE: Cost.LEG,
    Measure.OTHER_SPEED: Cost.RUN,
    Measure.ANOTHER_RUN: Cost.RUN,
    Measure.RADAR: Cost.GEAR,
    Measure.LOG: Cost.GEAR,
    Measure.WIND: Cost.GEAR,
    Measure.DEPTH: Cost.LOOK,
    Measure.DEEP_WATER: Cost.PASSAGE,
    Measure.HEADING: Cost.LOOK,
    Measure.SHAFT: Cost.LOOK,
    Measure.RUDDER: Cost.LOOK,
    Measure.THIRD_SPEED: Cost.GEAR,
    Measure.WITHOUT_CABLE: Cost.GEAR,
    Measure.FREE_PROPELLER: Cost.GEAR,
    Measure.CLEAN_HULL: Cost.DIVE,
    Measure.DRAUGHT: Cost.LOOK,
    Measure.FAST_CHANGE: Cost.RUN,
}
