# SPDX-License-Identifier: Apache-2.0
"""What is wrong alike in all runs of a ship: ship file, light air, currents, errors of the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.worlds.hidden_b.hulls import Array, Hull
from benchmarks.worlds.hidden_b.oracle_sail import Stated
from benchmarks.worlds.hidden_b.setting import Setting

Change = Callable[[Setting], None]
_WEATHER = (  # a standard deviation of each: in m/s, of the flow over the speed
    ('wind', (0.65, 0.0)), ('wind', (0.0, 0.65)),
    ('flow', (1.6e-3, 0.0)), ('flow', (0.0, 1.6e-3)),
    ('tide', (6e-3, 0.0, 0.0)), ('tide', (0.0, 6e-3, 0.0)),
    ('tide', (6e-3, 0.0, -np.pi / 2)), ('tide', (0.0, 6e-3, -np.pi / 2)),
)  # fmt: skip
_SCALE, _OFFSET = 1.7e-3, 7e-4  # of the log; over the speed


def shared(row: Callable[[Change, Hull], Array], stated: Stated) -> Array:
    """
    Return what a standard deviation of each changes, a column each: (n, m).

    Parameters
    ----------
    row
        Returns what would be seen of a hull in settings that are changed.
    stated
    """
    hull = stated.hull
    plain = row(_nothing, hull)
    hulls = [replace(hull, still_n=hull.still_n + miss) for miss in stated.misses]
    hulls.append(replace(hull, n_r=hull.n_r + stated.added_sd))
    changes = [_run_down(1.0 + stated.run_down_sd)]
    for name, value in _WEATHER:
        size = hull.speed_m_s if name == 'flow' else 1.0
        changes.append(_blowing(name, tuple(size * each for each in value)))
    changes += [_faulty('scale', _SCALE), _faulty('offset_m_s', _OFFSET * hull.speed_m_s)]
    rows = [row(_nothing, each) for each in hulls] + [row(change, hull) for change in changes]
    return np.stack([each - plain for each in rows], axis=1)


def _nothing(_: Setting) -> None:
    """Change nothing."""


def _run_down(late: float) -> Change:
    def change(setting: Setting) -> None:
        screw = setting.screw
        setting.screw = replace(
            screw, inertia_s=screw.inertia_s * late, ramp_s=screw.ramp_s * late
        )

    return change


def _blowing(name: str, value: tuple[float, ...]) -> Change:
    def change(setting: Setting) -> None:
        setting.weather = replace(setting.weather, **{name: value})  # type: ignore[arg-type]

    return change


def _faulty(name: str, size: float) -> Change:
    def change(setting: Setting) -> None:
        more = getattr(setting.faults, name) + size
        setting.faults = replace(setting.faults, **{name: more})

    return change
