# SPDX-License-Identifier: Apache-2.0
"""
A curve of specific resistance as an engineer reads it: force, power, percent.

Force is mass times r; effective power is force times speed; the share over the
clean hull is force over that of the ship file's baseline, less one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.display import force_unit, plus_minus, power_unit, ship_speed
from shipdrag_ros.estimation.result import Estimate, ForceCurve
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship

USUAL_SHARE = 0.75  # of the speed at the stop


@dataclass(frozen=True)
class Force:
    """
    Resistance in newtons against speed, beside that of the clean hull.

    Attributes
    ----------
    mass_kg
        Of the ship.
    speed_m_s : (m,)
        Ascending [m/s].
    newtons, sigma_n : (m,)
        Resistance and its standard deviation [N].
    clean_n : (m,)
        The baseline of the ship file [N]; NaN where none is stated.
    over, over_sd : (m,)
        newtons / clean_n - 1 and its standard deviation, in which both curves
        count; NaN where no baseline is stated.
    """

    mass_kg: float
    speed_m_s: Float64
    newtons: Float64
    sigma_n: Float64
    clean_n: Float64
    over: Float64
    over_sd: Float64

    @classmethod
    def of(cls, curve: ForceCurve, ship: Ship) -> Force:
        """
        Take a curve in N/kg.

        Parameters
        ----------
        curve
            Specific resistance, ascending in speed.
        ship
            For the mass, and for the clean hull.
        """
        speed, mass = curve.speed_m_s, ship.mass_kg
        newtons, sigma = mass * curve.resistance_m_s2, mass * curve.sigma_m_s2
        clean, clean_sd = clean_hull(ship, speed)
        ratio = newtons / clean
        # a baseline that coastdowns have shown errs with n_r as this curve does
        shared = ship.baseline is not None and ship.baseline.relative_sd_of == 'retardation'
        own = mass * curve.sigma_repeatable_m_s2 if shared else sigma
        spread = np.abs(ratio) * np.hypot(own / newtons, clean_sd / clean)
        return cls(mass, speed, newtons, sigma, clean, ratio - 1.0, spread)

    def near(self, speed_m_s: float) -> int:
        """
        Return the place nearest to a speed [m/s], if it can be where the clean hull is known.
        """
        known = np.flatnonzero(np.isfinite(self.over))
        places = known if len(known) else np.arange(len(self.over))
        return self.shown(int(places[np.argmin(np.abs(self.speed_m_s[places] - speed_m_s))]))

    def shown(self, place: int) -> int:
        """
        Return the place whose figures are those of all speeds that are one in text.
        """
        texts = [ship_speed(speed, self.mass_kg) for speed in self.speed_m_s.tolist()]
        alike = [i for i, text in enumerate(texts) if text == texts[place]]
        return next(filter(self.has_clean, alike), alike[0])

    def cells(self, place: int) -> tuple[str, str, str, str]:
        """
        Return speed, resistance, effective power and the share over the clean hull as text.

        Parameters
        ----------
        place
            Of the point.

        Returns
        -------
        tuple of str
            ± is two standard deviations; '' where the clean hull is not known.
        """
        speed, newtons = float(self.speed_m_s[place]), float(self.newtons[place])
        spread = 2.0 * float(self.sigma_n[place])
        force, force_name = force_unit(self.mass_kg)
        power, power_name = power_unit(self.mass_kg)
        return (
            ship_speed(speed, self.mass_kg),
            f'{plus_minus(newtons / force, spread / force)} {force_name}',
            f'{plus_minus(newtons * speed / power, spread * speed / power)} {power_name}',
            over_text(*self.over_at(place)) if self.has_clean(place) else '',
        )

    def at(self, place: int) -> str:
        """
        Say what a point of the curve is, with two standard deviations.
        """
        speed, resistance, power, over = self.cells(place)
        said = f'At {speed}: resistance {resistance}, effective power {power}'
        return f'{said}, {over}.' if over else f'{said}.'

    def has_clean(self, place: int) -> bool:
        """
        Say whether the clean hull is known at a point.
        """
        return bool(np.isfinite(self.over[place]))

    def over_at(self, place: int) -> tuple[float, float]:
        """
        Return the share over the clean hull at a point, and its sd.
        """
        return float(self.over[place]), float(self.over_sd[place])


def clean_hull(ship: Ship, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """
    Return the baseline resistance and its standard deviation [N].

    Parameters
    ----------
    ship
        With a baseline or without.
    speed_m_s : (m,)
        Through water [m/s].

    Returns
    -------
    newtons, sd_n : (m,)
        NaN where no baseline is stated.
    """
    newtons, sd = np.full_like(speed_m_s, np.nan), np.full_like(speed_m_s, np.nan)
    base = ship.baseline
    if base is None:
        return newtons, sd
    low, high = ship.baseline_range_m_s
    inside = (speed_m_s >= low) & (speed_m_s <= high) & (speed_m_s > 0.0)
    speed = speed_m_s[inside]
    newtons[inside] = ship.resistance_n(speed)
    if isinstance(base, CoefficientBaseline):
        viscous = base.viscous(speed * ship.length_m / ship.water.kinematic_viscosity_m2_s)
        wave = base.wave(ship.froude(speed))
        known = base.relative_sd
        first, second = known.friction * viscous, known.wave * wave
        square = first**2 + second**2 + 2.0 * known.correlation * first * second
        relative = np.sqrt(square) / (viscous + wave)
    else:
        relative = np.full_like(speed, base.relative_sd)
    sd[inside] = np.hypot(relative, base.run_scatter) * newtons[inside]
    return newtons, sd


def usual_speed_m_s(estimates: Sequence[Estimate], ship: Ship | None) -> float:
    """
    Return the speed at which the figures of a ship are stated [m/s].

    Parameters
    ----------
    estimates
        Of one ship, at least one.
    ship
        Her `service_speed_m_s` (`economics`) holds where every run reaches it.

    Returns
    -------
    float
        Otherwise 0.75 of the speed at the stop, the median over runs.
    """
    spans = [(each.curve.speed_m_s[0], each.curve.speed_m_s[-1]) for each in estimates]
    return usual_within(np.array(spans), ship)


def usual_within(spans_m_s: Float64, ship: Ship | None) -> float:
    """
    Return the speed at which figures are stated, of curves that are known over these spans.

    Parameters
    ----------
    spans_m_s : (n, 2)
        Lowest and highest speed of each curve.
    ship
        As for `usual_speed_m_s`.
    """
    low, high = spans_m_s[:, 0].max(), spans_m_s[:, 1]
    service = None
    if ship is not None and ship.economics is not None:
        service = ship.economics.service_speed_m_s
    if service is not None and low <= service <= high.min():
        return service
    return USUAL_SHARE * float(np.median(high))


def over_text(over: float, sd: float) -> str:
    """
    Say how much a resistance is over that of the clean hull.

    Parameters
    ----------
    over, sd
        Share of the clean hull's resistance, and its standard deviation.
    """
    value, _, spread = plus_minus(100.0 * over, 200.0 * sd).partition(' ± ')
    side = 'below' if over < 0.0 else 'over'
    said = f'{value.lstrip("-")} ± {spread} % {side} the clean hull'
    return said if abs(over) > 2.0 * sd else f'{said} (no difference that shows)'


def no_clean_text(ship: Ship, force: Force) -> str:
    """
    Say why a curve is not held against the clean hull; '' where it is.
    """
    if np.isfinite(force.over).any():
        return ''
    if ship.baseline is None:
        return (
            'The ship file states no baseline, so nothing is said of the clean hull; `shipdrag '
            'baseline` learns one from clean runs.'
        )
    low, high = (ship_speed(speed, ship.mass_kg) for speed in ship.baseline_range_m_s)
    return (
        f'The baseline of the ship file is stated from {low} to {high} and this curve is outside '
        'of it, so nothing is said of the clean hull; add points to the baseline.'
    )
