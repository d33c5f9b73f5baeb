# SPDX-License-Identifier: Apache-2.0
"""
Twenty-four strangers: twelve plain ones, alike in every run, and twelve that are not.

A plain one acts in one place (a force, the log) through one variable (speed, time since the stop,
heading) by one plain curve. Of the others some differ from run to run, some have two variables or
are two at once, some have a rhythm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.worlds.hidden_b import strangers as b
from benchmarks.worlds.hidden_b.effects import Draw, Hidden, changed, hidden
from benchmarks.worlds.hidden_b.hulls import SEA, Array
from benchmarks.worlds.hidden_b.setting import Setting

Make = Callable[[Draw], Hidden]
_HALF_RHO = 0.5 * SEA[0]


def _forward(u: Array) -> Array:
    return np.tanh(u / 0.02)


def _rising(x: Array, width: float) -> Array:
    """Return what grows from 0 to 1 about 0."""
    return 0.5 * (1.0 + np.tanh(x / width))


def _acting(name: str, law: Callable[[Array, Array], Array], **sizes: float) -> Hidden:
    return hidden(name, 'hull', sizes, timed=law)


def _drag(area: float, u: Array) -> Array:
    return _HALF_RHO * area * u * np.abs(u)


def kelp_below(d: Draw) -> Hidden:
    """Weed streams flat at speed and stands up below one."""
    area, below = d.area(d.rng.uniform(0.3, 0.8) * d.size), d.rng.uniform(0.4, 0.7)
    below *= d.hull.speed_m_s

    def law(t: Array, u: Array) -> Array:
        return _drag(area, u) * _rising(below - u, 0.03 * d.hull.speed_m_s)

    return _acting('kelp_below', law, area_m2=area, speed_m_s=below)


def rail_above(d: Draw) -> Hidden:
    """A spray rail that bites above a speed."""
    area, above = d.area(d.rng.uniform(0.15, 0.4) * d.size), d.rng.uniform(0.45, 0.75)
    above *= d.hull.speed_m_s

    def law(t: Array, u: Array) -> Array:
        return _drag(area, u) * _rising(u - above, 0.03 * d.hull.speed_m_s)

    return _acting('rail_above', law, area_m2=area, speed_m_s=above)


def dry_friction(d: Draw) -> Hidden:
    """A line over a sheave: the same force at any speed."""
    force = d.first_n * d.rng.uniform(0.05, 0.15) * d.size
    return _acting('dry_friction', lambda t, u: force * _forward(u), force_n=force)


def film(d: Draw) -> Hidden:
    """A viscous film: as the speed."""
    slope = d.first_n * d.rng.uniform(0.08, 0.25) * d.size / d.hull.speed_m_s
    return _acting('film', lambda t, u: slope * u, slope_n_s_m=slope)


def steep(d: Draw) -> Hidden:
    """A bow that buries itself: as the fourth power."""
    first, force = d.hull.speed_m_s, d.first_n * d.rng.uniform(0.1, 0.35) * d.size
    return _acting('steep', lambda t, u: force * (u / first) ** 3 * np.abs(u) / first)


def hump(d: Draw) -> Hidden:
    """Waves of ship and towed pontoon add up about one speed."""
    force = d.first_n * d.rng.uniform(0.1, 0.3) * d.size
    at, wide = (d.rng.uniform(*each) * d.hull.speed_m_s for each in ((0.45, 0.8), (0.06, 0.12)))
    return _acting(
        'hump', lambda t, u: force * np.exp(-0.5 * ((u - at) / wide) ** 2), force_n=force
    )


def bubbles(d: Draw) -> Hidden:
    """What the screw sucked on to the stern at the stop washes off."""
    area = d.area(d.rng.uniform(0.3, 0.8) * d.size)
    tau = d.rng.uniform(0.12, 0.35) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        return _drag(area, u) * np.exp(-np.maximum(t, 0.0) / tau) * (t > 0.0)

    return _acting('bubbles', law, area_m2=area, decay_s=tau)


def flooding(d: Draw) -> Hidden:
    """A scoop drops at the stop and fills: the drag grows evenly, and stays."""
    area, takes = d.area(d.rng.uniform(0.4, 1.0) * d.size), d.rng.uniform(0.3, 0.7) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        return _drag(area, u) * np.clip(t / takes, 0.0, 1.0)

    return _acting('flooding', law, area_m2=area, takes_s=takes)


def flap(d: Draw) -> Hidden:
    """A flap falls open a fixed time after the engine stops."""
    area, at = d.area(d.rng.uniform(0.4, 1.0) * d.size), d.rng.uniform(0.15, 0.4) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        return _drag(area, u) * _rising(t - at, 0.02 * d.coast_s)

    return _acting('flap', law, area_m2=area, after_s=at)


def pull_of_the_earth(d: Draw) -> Hidden:
    """A constant pull towards one bearing."""
    force, bearing = d.first_n * d.rng.uniform(0.06, 0.15) * d.size, d.rng.uniform(0, 2 * np.pi)

    def apply(setting: Setting) -> None:
        along = force * np.cos(setting.heading_rad - bearing)
        setting.timed.append(lambda t, u: -along * _forward(u))

    return Hidden('pull_of_the_earth', 'earth', {'force_n': force}, apply)


def drag_of_the_earth(d: Draw) -> Hidden:
    """Drag as the square of the speed, by which way she heads in a swell."""
    area, bearing = d.area(d.rng.uniform(0.15, 0.4) * d.size), d.rng.uniform(0, 2 * np.pi)

    def apply(setting: Setting) -> None:
        mine = area * (1.0 + np.cos(setting.heading_rad - bearing))
        setting.timed.append(lambda t, u: _drag(mine, u))

    return Hidden('drag_of_the_earth', 'earth', {'area_m2': area}, apply)


def log_recovers(d: Draw) -> Hidden:
    """The log's gain is off under the wash and recovers after the stop."""
    share = d.sign * d.rng.uniform(0.04, 0.12) * d.size
    tau = d.rng.uniform(0.12, 0.35) * d.coast_s

    def law(t: Array) -> Array:
        return share * np.exp(-np.maximum(t, 0.0) / tau)

    return changed('log_recovers', 'sensor', {'share': share, 'decay_s': tau}, swing=law)


def sloshing(d: Draw) -> Hidden:
    """Water in a tank swings to and fro after the stop, and dies down."""
    force = d.first_n * d.rng.uniform(0.2, 0.5) * d.size
    period, dies = d.rng.uniform(0.1, 0.25) * d.coast_s, d.rng.uniform(0.2, 0.4) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        since = np.maximum(t, 0.0)
        return force * np.sin(2 * np.pi * since / period) * np.exp(-since / dies)

    return _acting('sloshing', law, force_n=force)


def late_and_slow(d: Draw) -> Hidden:
    """A brake that needs both: time since the stop, and a low speed."""
    area, tau = d.area(d.rng.uniform(0.6, 1.5) * d.size), d.rng.uniform(0.1, 0.3) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        slow = 1.0 - np.clip(u / d.hull.speed_m_s, 0.0, 1.0)
        return _drag(area, u) * slow * (1.0 - np.exp(-np.maximum(t, 0.0) / tau))

    return _acting('late_and_slow', law, area_m2=area)


def never_alike(d: Draw) -> Hidden:
    """A raft of weed that is larger or smaller in every run."""
    area = d.area(d.rng.uniform(0.15, 0.4) * d.size) * np.exp(0.8 * d.rng.standard_normal())
    power = d.rng.uniform(1.0, 3.0)
    first = d.hull.speed_m_s

    def law(t: Array, u: Array) -> Array:
        return _HALF_RHO * area * first**2 * np.maximum(u / first, 0.0) ** power

    return replace(_acting('never_alike', law, area_m2=area), scope='run')


def two_at_once(d: Draw) -> Hidden:
    """A constant pull, and a drag that comes about one speed alone."""
    one, other = dry_friction(d), hump(d)

    def apply(setting: Setting) -> None:
        one.apply(setting)
        other.apply(setting)

    return Hidden('two_at_once', 'hull', {**one.parameters, **other.parameters}, apply)


# where a plain one acts, by which variable, and by which curve
_KINDS = (
    (kelp_below, 'force', 'speed', 'step'),
    (rail_above, 'force', 'speed', 'step'),
    (dry_friction, 'force', 'speed', 'constant'),
    (film, 'force', 'speed', 'power'),
    (steep, 'force', 'speed', 'power'),
    (hump, 'force', 'speed', 'hump'),
    (bubbles, 'force', 'time', 'decay'),
    (flooding, 'force', 'time', 'ramp'),
    (flap, 'force', 'time', 'step'),
    (pull_of_the_earth, 'force', 'heading', 'periodic'),
    (drag_of_the_earth, 'force', 'heading', 'periodic'),
    (log_recovers, 'log', 'time', 'decay'),
)
PLAIN: dict[str, Make] = {make.__name__: make for make, *_ in _KINDS}
CURVES = {make.__name__: tuple(kind) for make, *kind in _KINDS}
OTHER: dict[str, Make] = {
    **b.OUTSIDE,
    **{each.__name__: each for each in (sloshing, late_and_slow, never_alike, two_at_once)},
}
STRANGERS = PLAIN | OTHER
