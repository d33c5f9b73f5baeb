# SPDX-License-Identifier: Apache-2.0
"""What a ship file says of a hull: as tests found it, within stated errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.hidden_b.hulls import AIR, GRAVITY, SEA, Array, Hull, ittc57
from benchmarks.worlds.hidden_b.screws import Screw


@dataclass(frozen=True)
class Stated:
    """
    What is stated, and wrong by what is drawn here.

    Attributes
    ----------
    table
        The baseline is a table of resistance.
    friction_sd, wave_sd, added_sd, run_down_sd
        Stated standard deviations; of added mass itself, of the others relative.
    misses
        Standard normal numbers that make the errors.
    """

    table: bool
    friction_sd: float
    wave_sd: float
    added_sd: float
    run_down_sd: float
    misses: tuple[float, ...]


def draw_stated(rng: np.random.Generator) -> Stated:
    """
    Draw how well a ship is known.
    """
    return Stated(
        table=bool(rng.random() < 0.5),
        friction_sd=rng.uniform(0.015, 0.04),
        wave_sd=rng.uniform(0.08, 0.2),
        added_sd=rng.uniform(0.01, 0.025),
        run_down_sd=rng.uniform(0.15, 0.35),
        misses=tuple(rng.standard_normal(6).tolist()),
    )


def ship_file(
    hull: Hull,
    screw: Screw,
    steady: tuple[float, float],
    run_down_s: float,
    stated: Stated,
    number: int,
) -> str:
    """
    Return the ship file.

    Parameters
    ----------
    hull, screw, steady
        The ship as she usually is; the drag of her stopped propeller is in the baseline.
    run_down_s
        In which the thrust falls to a third.
    stated
    number
        Of the case, for the name.
    """
    miss = stated.misses
    state = {'locked': 'locked', 'folding': 'none'}.get(screw.drive, 'free')
    n_r = max(0.01, hull.n_r + stated.added_sd * miss[0])
    down = run_down_s * float(np.clip(1.0 + stated.run_down_sd * miss[1], 0.3, 2.0))
    lines = [
        f'name: {hull.family} {number}',
        f'length_m: {hull.length_m:.6g}',
        f'displaced_volume_m3: {hull.volume_m3:.6g}',
        f'breadth_m: {hull.breadth_m:.6g}',
        f'draught_m: {hull.draught_m:.6g}',
        f'wetted_surface_m2: {hull.wetted_m2:.6g}',
        f'added_mass: {{model: constant, value: {n_r:.4f}, sd: {stated.added_sd:.4f}}}',
        f'air: {{frontal_area_m2: {hull.frontal_m2:.6g}, drag_coefficient: {hull.air_drag:.4f}}}',
        f'propeller: {{diameter_m: {screw.diameter_m:.5g}, state_in_baseline: {state}}}',
        f'propulsion: {{run_down_s: {down:.4g}, sd: {stated.run_down_sd * down:.4g}}}',
        'baseline:',
        '  source: trials and tests',
    ]

    def usual(speed: Array) -> Array:
        """Return the resistance of hull and stopped propeller."""
        return np.interp(speed, hull.grid_m_s, hull.still_n) + screw.drag_n(speed, steady)

    baseline = None
    if not stated.table and screw.drive not in ('locked', 'direct', 'cpp'):
        baseline = _coefficients(hull, usual, stated)
    return '\n'.join(lines + (baseline or _table(hull, usual, stated)))


Law = Callable[[Array], Array]


def _table(hull: Hull, usual: Law, stated: Stated) -> list[str]:
    share = np.array([0.0, 0.05, 0.1, 0.15, *np.arange(0.2, 1.11, 0.075), 1.15, 1.3])
    speed = share * hull.speed_m_s
    miss = stated.misses
    wrong = stated.friction_sd * (0.8 * miss[2] + 0.6 * miss[3] * np.cos(np.pi * share))
    found = usual(speed) / (1.0 + wrong)
    found = np.maximum.accumulate(found)
    return [
        f'  speed_m_s: [{", ".join(f"{v:.5g}" for v in speed)}]',
        f'  resistance_n: [{", ".join(f"{v:.6g}" for v in found)}]',
        f'  relative_sd: {stated.friction_sd:.3g}',
        '',
    ]


def _coefficients(hull: Hull, usual: Law, stated: Stated) -> list[str] | None:
    """Return a baseline of coefficients, None where they would be no sensible ones."""
    share = np.array([0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95, 1.05, 1.15, 1.3])
    speed = share * hull.speed_m_s
    pressure = 0.5 * SEA[0] * hull.wetted_m2 * speed**2
    air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag * speed**2
    total = (usual(speed) - air) / pressure
    line = ittc57(speed * hull.length_m / SEA[1])
    allowance = 2e-4
    # what is left at the slowest speeds is friction
    form = float(np.min((total - allowance)[:5] / line[:5])) - 1.0
    if not 0.0 <= form <= 0.8:
        return None
    wave = np.maximum(total - (1.0 + form) * line - allowance, 0.0)
    miss = stated.misses
    friction = 1.0 + stated.friction_sd * miss[2]
    wave = wave / max(0.4, 1.0 + stated.wave_sd * miss[3])
    froude = speed / np.sqrt(GRAVITY * hull.length_m)
    return [
        f'  form_factor: {(1.0 + form) / friction - 1.0:.5g}',
        f'  correlation_allowance: {allowance / friction:.4g}',
        f'  wave_froude: [0.0, {", ".join(f"{f:.5g}" for f in froude)}]',
        f'  wave_coefficient: [0.0, {", ".join(f"{c:.5g}" for c in wave)}]',
        f'  relative_sd: {{friction: {stated.friction_sd:.3g}, wave: {stated.wave_sd:.3g}}}',
        '',
    ]
