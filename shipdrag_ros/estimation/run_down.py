# SPDX-License-Identifier: Apache-2.0
"""The engine stop: when it was, and what is known of the thrust after it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.shaft_fall import Fall, Slowing, find_fall, say
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.posterior.priors import STOP
from shipdrag_ros.samples import SHAFTS
from shipdrag_ros.ship import Ship

_SUDDEN_S = 30.0  # slower than this, a shaft that follows the ship seems to run down
ONSET_SD_S = STOP.sd  # of an onset found from the speed alone: a loose bound, the fit finds it
TURNS = 0.05  # of the shaft speed under power: a shaft that is slower stands
_AT_START = 1.0  # run-downs after the start of a window: a stop by then is at the start
_FALLEN = 5.0  # run-downs after which the shaft turns on by the water, or is driven


@dataclass(frozen=True)
class RunDown:
    """
    What is known of the stop before the motion is fitted.

    Attributes
    ----------
    stop_ns
        Time of the stop [ns].
    stop_sd_s
        Its standard deviation; 0: not fitted.
    run_down_s, run_down_sd_s
        Time constant of the thrust and its standard deviation, for a thrust
        that falls as an exponential; 0: the thrust ended at once. The fit of
        the motion takes `shaft_s` instead.
    shaft_s
        Time constant of the shaft; how the thrust follows it is fitted. 0: the
        thrust ended at once.
    notes
        A sentence each.
    """

    stop_ns: int
    stop_sd_s: float
    run_down_s: float
    run_down_sd_s: float
    shaft_s: float
    notes: tuple[str, ...]

    @classmethod
    def of(cls, window: Window, ship: Ship) -> RunDown:
        """
        Learn of the stop from shafts and pitches, or else take what the ship file states.

        Of several propellers the stop is that of the last; of shaft speed and
        pitch of one, whichever falls first. Without `propulsion` in the ship
        file the thrust may end at any time up to the run-down of the shaft.
        """
        falls = list(_falls(window))
        others = tuple(_others(window, {number for number, _, _ in falls}))
        if falls:
            _, seen, fall = max(falls, key=lambda one: one[2].stop_s)
            others += tuple(_kept(window, falls))
            if window.before is not None or fall.stop_s <= _AT_START * fall.run_down_s:
                return cls._of_fall(window, ship, seen, fall, others)
            # nothing is known of the speed before it
            note = (
                f'{seen} shows an engine stop {fall.stop_s:.3g} s after the start of the window: '
                'r is off by the thrust before it; give a window that begins after it'
            )
            return cls(window.start_ns, 0.0, 0.0, 0.0, 0.0, (note, *others))
        if window.before is None:
            note = 'the thrust is taken to have ended before the window'
            return cls(window.start_ns, 0.0, 0.0, 0.0, 0.0, others or (note,))
        if ship.propulsion is None:
            note = 'the thrust is taken to end at once'
            return cls(window.start_ns, ONSET_SD_S, 0.0, 0.0, 0.0, (note, *others))
        run_down_s = ship.propulsion.run_down_s
        note = (
            f'the thrust is taken to end within about {run_down_s:.3g} s, by the ship file: how '
            'it does is fitted'
        )
        return cls(
            window.start_ns,
            ONSET_SD_S,
            run_down_s,
            ship.propulsion.sd,
            run_down_s,
            (note, *others),
        )

    @classmethod
    def _of_fall(
        cls, window: Window, ship: Ship, seen: str, fall: Fall, others: tuple[str, ...]
    ) -> RunDown:
        notes = [f'{seen} shows the time of the stop']
        if fall.run_down_s > 0.0:
            notes = [
                f'{seen} shows the stop and runs down in {fall.run_down_s:.2g} s; the thrust may '
                'be gone at once or follow it: that is fitted, and in the band'
            ]
        run_down_s, run_down_sd_s = fall.run_down_s, fall.run_down_sd_s
        if ship.propulsion is None:
            run_down_s = run_down_sd_s = 0.5 * run_down_s
        return cls(
            window.start_ns + round(fall.stop_s * 1e9),
            fall.stop_sd_s,
            run_down_s,
            run_down_sd_s,
            fall.run_down_s,
            (*notes, *others),
        )


def _falls(window: Window) -> Iterator[tuple[int, str, Fall]]:
    """Yield number, name and fall of each propeller that shows one."""
    before = window.before
    slowing = Slowing.of(window)
    for number in range(len(SHAFTS)):
        of_propeller = []
        for what, all_of in (('shaft', 'shafts'), ('pitch', 'pitches')):
            earlier = None if before is None else getattr(before, all_of)[number]
            series = getattr(window, all_of)[number]
            by = slowing if what == 'shaft' else None
            fall = find_fall(earlier, series, window.start_ns, by)
            if fall is None and by is not None:  # an engine may hold it while the ship slows down
                fall = find_fall(earlier, series, window.start_ns)
                if fall is not None and fall.run_down_s > _SUDDEN_S:
                    fall = None
            if fall is not None:
                of_propeller.append((number, _name(window, what, number), fall))
        if of_propeller:
            yield min(of_propeller, key=lambda one: one[2].stop_s)


def _kept(window: Window, falls: list[tuple[int, str, Fall]]) -> Iterator[str]:
    """Yield what the shafts show that fell, but go on turning."""
    for number, name, fall in falls:
        after_s = fall.stop_s + _FALLEN * fall.run_down_s
        since_ns = window.start_ns + round(after_s * 1e9)
        shaft = window.shafts[number]
        if fall.kept > TURNS and 'shaft' in name and np.any(shaft.time_ns >= since_ns):
            yield say(name, shaft, window, since_ns)


def _others(window: Window, fallen: set[int]) -> Iterator[str]:
    """Yield what the shafts show that do not fall."""
    for number, shaft in enumerate(window.shafts):
        if len(shaft) and number not in fallen:
            earlier = None if window.before is None else window.before.shafts[number]
            yield say(_name(window, 'shaft', number), shaft, window, window.start_ns, earlier)


def _name(window: Window, what: str, number: int) -> str:
    """Return how to speak of a shaft or pitch."""
    several = sum(len(shaft) > 0 for shaft in window.shafts) > 1
    return f'the {what} of propeller {number + 1}' if several else f'the {what}'
