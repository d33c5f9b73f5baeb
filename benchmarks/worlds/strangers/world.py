# SPDX-License-Identifier: Apache-2.0
"""Ships, each with ten runs: eight to learn from, one that is kept, one of another day."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from benchmarks.worlds.hidden_b import cases as world_b
from benchmarks.worlds.hidden_b.effects import FREE, Draw, Hidden
from benchmarks.worlds.hidden_b.hulls import Array
from benchmarks.worlds.hidden_b.instruments import INPUTS, Kit, Recording, read
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.shipfile import draw_stated, ship_file
from benchmarks.worlds.hidden_b.voyage import sail
from benchmarks.worlds.hidden_b.weather import draw_weather
from benchmarks.worlds.strangers.hidden import STRANGERS

SEED = 88_003
LEARNT, KEPT, LATER = range(8), 8, 9
_NONE = 99  # in place of a stranger's number


@dataclass(frozen=True)
class Case:
    """
    A ship with one stranger, or with none.

    Attributes
    ----------
    ship_file
    kit
    plain, settings
        Ten runs each, without the stranger and with it.
    parameters
        Of the stranger in the first run.
    """

    ship_file: str
    kit: Kit
    plain: tuple[Setting, ...]
    settings: tuple[Setting, ...]
    parameters: dict[str, float]

    def recording(self, run: int) -> Recording:
        """
        Return what the instruments say of a run.
        """
        setting = self.settings[run]
        start = world_b.EPOCH_NS + round((setting.clock_s - setting.lead_s) * 1e9)
        return read(sail(setting), setting, self.kit, INPUTS, start)

    def shown(self, run: int) -> tuple[Array, Array, Array, Array]:
        """
        Return, without noise, times since the stop [s], what the stranger changes of the log
        and of the speed of the track [m/s], and the speed without it.
        """
        found = []
        for settings in (self.plain, self.settings):
            track = sail(world_b.quiet(settings[run]))
            found.append((track.t, *world_b.seen(track, settings[run], self.kit)))
        (t, log, ground), (_, log_with, ground_with) = found
        return t, log_with - log, ground_with - ground, ground


@lru_cache(maxsize=4)
def case(stranger: str, ship: int, seed: int = SEED) -> Case:
    """
    Return a ship with a stranger on board; '' for none.
    """
    number = list(STRANGERS).index(stranger) if stranger else _NONE
    rng = np.random.default_rng([seed, number, ship])
    board, kit = world_b.draw_ship(rng, FREE, (1500.0, 900.0))
    hull = board['hull']
    if stranger == 'gyro_ballistic':
        kit = replace(kit, fix='radar', fix_every_s=3.0)
    clock = rng.uniform(6.0, 14.0) * 3600.0
    first = rng.uniform(-np.pi, np.pi)
    days = [draw_weather(rng, hull.time_s, hull.speed_m_s) for _ in range(3)]
    bases = [
        Setting(
            **board,
            weather=days[2 if run == LATER else run % 2],
            speed_m_s=hull.speed_m_s * (1.0 if run == 0 else rng.uniform(0.65, 1.0)),
            heading_rad=first if run == 0 else rng.uniform(-np.pi, np.pi),
            first_rad=first,
            clock_s=clock + run * 86400.0,
            seed=(seed, number, ship, run),
            depth_m=float(max(12.0 * hull.draught_m, 15.0)) * rng.uniform(1.0, 2.0),
        )
        for run in range(10)
    ]
    for which in (0, 1, 2):
        legs = tuple(base for base in bases if base.weather is days[which])
        weather, kit, _ = world_b.calm(legs[:3], kit)
        bases = [replace(b, weather=weather) if b.weather is days[which] else b for b in bases]
    key, steady = (seed, number, ship), world_b.steady_of(bases[0])
    text = ship_file(
        hull, board['screw'], steady, world_b.run_down_s(bases[0]), draw_stated(rng), ship
    )
    settings = [world_b.fresh(base) for base in bases]
    hidden: Hidden | None = None
    if stranger:
        size, _ = world_b.matters(
            lambda size: _made(stranger, size, bases[0], steady, key, 0),
            bases[0],
            kit,
            1.5 * world_b.LEAST,
        )
        for run, setting in enumerate(settings):
            made = _made(stranger, size, bases[0], steady, key, run)
            hidden = hidden or made
            made.apply(setting)
    found = {} if hidden is None else hidden.parameters
    return Case(text, kit, tuple(bases), tuple(settings), found)


def _made(
    name: str,
    size: float,
    base: Setting,
    steady: tuple[float, float],
    key: tuple[int, ...],
    run: int,
) -> Hidden:
    """Return a stranger as it is in a run; one that is of the run is drawn for each."""
    make = STRANGERS[name]
    for place in (0, 1 + run):
        rng = np.random.default_rng([*key, 7, place])
        found = make(Draw(rng, base.hull, base.screw, size, base.coast_s, steady))
        if found.scope != 'run':
            break
    return found
