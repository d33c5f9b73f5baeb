# SPDX-License-Identifier: Apache-2.0
"""The effects that the diagnosis has a name for."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.worlds.hidden_b import effects

FREE = ('declutched', 'electric')
LIBRARY: dict[str, tuple[Callable[[effects.Draw], effects.Hidden], tuple[str, ...]]] = {
    'fouling': (effects.fouling, ()),
    'shallow_water': (effects.shallow_water, ()),
    'towed_cable': (effects.towed_cable, ()),
    'locked_propeller': (effects.locked_propeller, FREE),
    'windmilling_propeller': (effects.windmilling_propeller, ('declutched',)),
    'residual_thrust': (effects.residual_thrust, FREE),
    'wind': (effects.wind, ()),
    'waves': (effects.waves, ()),
    'current': (effects.current, ()),
    'log_scale': (effects.log_scale, ()),
    'log_offset': (effects.log_offset, ()),
    'radar_scale': (effects.radar_scale, ()),
    'turning': (effects.turning, ()),
    'log_lag': (effects.log_lag, ()),
    'log_dead_band': (effects.log_dead_band, ()),
    'time_offset': (effects.time_offset, ()),
    'current_change': (effects.current_change, ()),
    'added_mass': (effects.added_mass, ()),
    'displacement': (effects.displacement, ()),
}
"""Its maker by name, and the drives that it needs."""
SECOND = ('log_lag', 'log_dead_band', 'time_offset', 'current_change', 'added_mass',
          'displacement')  # fmt: skip
"""The rarer ones."""
