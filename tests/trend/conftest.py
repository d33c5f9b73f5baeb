# SPDX-License-Identifier: Apache-2.0
"""A row of the store: one coastdown, that has so much added resistance."""

import numpy as np

START_NS = 1_700_000_000_000_000_000
DAY_NS = 86_400_000_000_000
SPEED = np.linspace(1.0, 10.0, 46)
CLEAN = 1e-3 * SPEED**2


def row(days=0.0, added=0.1, **changes):
    valid = (SPEED >= 2.0) & (SPEED <= 8.0)
    return {
        'ship': 'Test',
        'bag': f'{days}.mcap',
        'time_ns': START_NS + round(days * DAY_NS),
        'speed_at_stop_m_s': 8.0,
        'speed_m_s': SPEED.tolist(),
        'clean_m_s2': CLEAN.tolist(),
        'resistance_m_s2': np.where(valid, (1.0 + added) * CLEAN, np.nan).tolist(),
        'sigma_m_s2': (0.03 * CLEAN).tolist(),
        'sigma_repeatable_m_s2': (0.01 * CLEAN).tolist(),
        'displaced_volume_m3': 1000.0,
        'water_density_kg_m3': 1025.0,
        'water_temperature_c': None,
        'length_m': 80.0,
        'error': None,
        **changes,
    }
