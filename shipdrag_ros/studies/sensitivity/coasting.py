# SPDX-License-Identifier: Apache-2.0
"""
Which values of a ship file matter to a coastdown, and to its diagnosis.

Motions are counted in standard deviations of the usual instruments, so that a
value matters as far as a record can show that it is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from shipdrag_ros.errors import SensitivityError, ShipdragError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship, TableAddedMass, TableBaseline
from shipdrag_ros.simulation import STANDARD_SD, Action, Effect, Frame, Scenario, simulate_columns
from shipdrag_ros.simulation.effects import effects_of
from shipdrag_ros.studies.sensitivity.loss import CHANGES, Losses, Responses, Selection, vary


@dataclass(frozen=True)
class Particular:
    """
    A value of a ship file.

    Attributes
    ----------
    key
        With its section.
    value
        NaN where it is more than one number.
    sd
        Stated standard deviation, relative to the value; NaN: none is stated.
    scaled
        From a ship and a factor to the ship with this value so many times as
        large.
    """

    key: str
    value: float
    sd: float
    scaled: Callable[[Ship, float], Ship]


def particulars(ship: Ship, *, speed_m_s: float) -> tuple[Particular, ...]:
    """
    List the values that act in a coastdown; what is 0 or not given is left out.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s
        At which the uncertainty of n_r is made a relative one.
    """
    return tuple(one for one in _listed(ship, speed_m_s) if one.value != 0.0)


def _listed(ship: Ship, speed_m_s: float) -> Iterator[Particular]:
    base = ship.baseline
    yield _field('length_m', ship)
    yield _field('displaced_volume_m3', ship)
    if isinstance(base, CoefficientBaseline):
        yield _field('wetted_surface_m2', ship)
    yield _field('water.density_kg_m3', ship)
    if isinstance(base, CoefficientBaseline):
        yield _field('water.kinematic_viscosity_m2_s', ship)
    n_r = float(ship.n_r(speed_m_s))
    # where coastdowns have shown the retardation, the error of n_r is no part of it
    counts = base is None or base.relative_sd_of == 'resistance'
    yield Particular(
        'added_mass', n_r, ship.added_mass.sd / n_r if counts else np.nan, _added_mass
    )
    if ship.air is not None:
        yield _field('air.frontal_area_m2', ship)
        yield _field('air.drag_coefficient', ship)
    if ship.propulsion is not None and ship.propulsion.run_down_s > 0.0:
        sd = ship.propulsion.sd / ship.propulsion.run_down_s
        yield _field('propulsion.run_down_s', ship, sd=sd or np.nan)
    if isinstance(base, CoefficientBaseline):
        yield _field('baseline.form_factor', ship)
        yield _field('baseline.correlation_allowance', ship)
        yield Particular('baseline.C_V', np.nan, base.relative_sd.friction, _viscous)
        if any(base.wave_coefficient):
            yield _field('baseline.wave_coefficient', ship, sd=base.relative_sd.wave)
    elif isinstance(base, TableBaseline):
        yield _field('baseline.resistance_n', ship, sd=base.relative_sd)
    for effect in ship.effects:
        for name, stated in effect.parameters.items():
            sd = stated.sd / abs(stated.value) if stated.sd and stated.value else np.nan
            scaled = partial(_effect, name=effect.name, parameter=name)
            yield Particular(f'effects.{effect.name}.{name}', stated.value, sd, scaled)


def _field(key: str, ship: Ship, *, sd: float = np.nan) -> Particular:
    """Return a number of the ship or of a section of hers, or all numbers of a table there."""
    section, _, name = key.rpartition('.')

    def scaled(changed: Ship, factor: float) -> Ship:
        part: Any = getattr(changed, section) if section else changed
        value = getattr(part, name)
        is_table = isinstance(value, tuple)
        value = tuple(factor * each for each in value) if is_table else factor * value
        part = replace(part, **{name: value})
        return replace(changed, **{section: part}) if section else part

    value = getattr(getattr(ship, section) if section else ship, name)
    return Particular(key, np.nan if isinstance(value, tuple) else float(value), sd, scaled)


def _added_mass(ship: Ship, factor: float) -> Ship:
    model = ship.added_mass
    rows = tuple(tuple(factor * c for c in row) for row in model.coefficients)
    return replace(ship, added_mass=TableAddedMass(coefficients=rows, sd=model.sd))


def _viscous(ship: Ship, factor: float) -> Ship:
    base = ship.baseline
    assert isinstance(base, CoefficientBaseline)
    changed = replace(
        base,
        form_factor=factor * (1.0 + base.form_factor) - 1.0,
        correlation_allowance=factor * base.correlation_allowance,
    )
    return replace(ship, baseline=changed)


def _effect(ship: Ship, factor: float, *, name: str, parameter: str) -> Ship:
    effect = next(one for one in ship.effects if one.name == name)
    stated = effect.parameters[parameter]
    values = {**effect.parameters, parameter: Parameter(factor * stated.value, stated.sd)}
    changed = replace(effect, parameters=values)
    others = (changed if one is effect else one for one in ship.effects)
    return replace(ship, effects=tuple(others))


KIND = 'coastdown'
LOG_SD_M_S = STANDARD_SD[Channel.SPEED_THROUGH_WATER]
POSITION_SD_M = STANDARD_SD[Channel.POSITION]
SPEED_FRACTION = 0.7  # of the highest that the baseline reaches: room for a ship half as long
SLOWED = 0.35  # part of the speed at which the record ends, if nothing ends it before
FROUDE_MIN = 0.05
_ABOVE = 1.1  # times the lowest speed of the baseline
_LEAST = 0.9  # part of the speed that a record ends at, or is too short
_LEAD_IN_S = 300.0
_SAMPLES = 400  # from the stop on
_LONGEST_S = 6 * 3600.0


@dataclass(frozen=True)
class Coast:
    """
    A coastdown of a ship, as it is read.

    Attributes
    ----------
    scenario
    time_s : (n,)
        Of the record, the steady part included.
    """

    scenario: Scenario
    time_s: Float64

    @property
    def name(self) -> str:
        """As `parse_coast` reads it."""
        return f'{KIND}:{self.scenario.speed_m_s:.4g}'

    @property
    def after_stop(self) -> slice:
        """The samples from the stop on."""
        return slice(int(np.searchsorted(self.time_s, self.scenario.lead_in_s)), None)

    def read(
        self, ship: Ship, actions: Sequence[Action], *, speed_m_s: float | None = None
    ) -> Float64:
        """
        Return what log and positions read (k, n, 3), in their standard deviations.

        Log, place ahead and place abeam of where the record begins; NaN where
        the simulation leaves the baseline's table. `speed_m_s` before the stop
        is the scenario's by default.
        """
        columns = simulate_columns(ship, self.scenario, actions, self.time_s, speed_m_s=speed_m_s)
        place = columns.radar_position_m / POSITION_SD_M
        return np.concatenate([columns.log_m_s[..., None] / LOG_SD_M_S, place], axis=-1)


def coast_from(ship: Ship, speed_m_s: float | None = None) -> Coast:
    """
    Return the coastdown from a speed down to a third of it, if it may go so far.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s
        `SPEED_FRACTION` of the highest of the baseline by default.

    Raises
    ------
    ShipdragError
        If the ship has no baseline.
    SensitivityError
        If it is not within the baseline, or too low to slow down from.
    """
    low, high = _slowest_m_s(ship), ship.baseline_range_m_s[1]
    speed = SPEED_FRACTION * high if speed_m_s is None else speed_m_s
    # written so that NaN fails
    if not low <= speed <= high:
        raise SensitivityError(
            f'the coastdown begins at {speed:.4g} m/s, expected {low:.4g}..{high:.4g} m/s: within '
            f'the baseline, and room to slow down above Froude number {FROUDE_MIN:g}'
        )
    speeds = np.linspace(max(SLOWED * speed, _LEAST * low), speed, 200)
    slowness = ship.mass_kg * (1.0 + ship.n_r(speeds)) / ship.resistance_n(speeds)
    duration = float(np.trapezoid(slowness, speeds))
    if ship.propulsion is not None:
        duration += ship.propulsion.run_down_s
    duration = min(duration, _LONGEST_S)
    scenario = Scenario(speed_m_s=speed, lead_in_s=_LEAD_IN_S, duration_s=duration)
    steady = np.arange(0.0, _LEAD_IN_S, duration / (_SAMPLES - 1))
    coasting = np.linspace(_LEAD_IN_S, scenario.length_s, _SAMPLES)
    return Coast(scenario, np.concatenate([steady, coasting]))


def _slowest_m_s(ship: Ship) -> float:
    """Return the lowest speed that a coastdown may begin at."""
    low = ship.baseline_range_m_s[0]
    return max(_ABOVE * low, float(ship.speed(FROUDE_MIN))) / _LEAST


def parse_coast(ship: Ship, text: str) -> Coast:
    """
    Read `coastdown` or `coastdown:8.2`, the speed before the stop in m/s.

    Raises
    ------
    SensitivityError
        If it is neither, or the speed is not possible.
    ShipdragError
        If the ship has no baseline.
    """
    kind, separator, size = text.partition(':')
    try:
        speed = float(size) if separator else None
    except ValueError:
        kind = ''
    if kind != KIND:
        raise SensitivityError(
            f'manoeuvre {text!r}: the ship of a ship file coasts, expected {KIND} or '
            f'{KIND}:SPEED [m/s]; for zigzag and turn leave out --ship'
        )
    return coast_from(ship, speed)


WORST = 0.5  # relative error beyond which no value is thought to be wrong
_SPEED_STEP = 1e-3
_NOTHING = 1e-6  # sd by which an effect moves nothing


@dataclass(frozen=True)
class Mimic:
    """
    The wrong value that looks most like an effect, as JSON has it.

    Attributes
    ----------
    effect
        Its name.
    size
        Value of its first parameter.
    distance_sd
        How far it moves the record, root mean square in standard deviations,
        beyond what an unknown speed and place at the start do.
    value
        Key of the ship file.
    wrong_by
        Relative error of the value, within `WORST`, that comes nearest to it.
    left
        Part of the distance that this leaves: 0, no record separates the two.
    """

    effect: str
    size: float
    distance_sd: float
    value: str
    wrong_by: float
    left: float


def mimics(
    ship: Ship, coast: Coast, listed: Sequence[Particular], slopes: Float64
) -> tuple[Mimic, ...]:
    """
    Find the value that looks most like each effect that can act on a ship.

    Parameters
    ----------
    ship, coast
    listed
        The p values.
    slopes : (p, m)
        Change of the whole reading by each, per relative error.

    Returns
    -------
    tuple of Mimic
        The most alike first; without effects that the ship file states, or
        that move nothing in this coastdown.
    """
    stated = {effect.name for effect in ship.effects}
    effects = [
        e for e in effects_of(ship).values() if not e.missing(ship) and e.name not in stated
    ]
    frame = Frame(ship, coast.scenario, coast.scenario.heading_rad)
    sizes = [_usual_values(effect, ship) for effect in effects]
    actions = [effect.action(frame, *size) for effect, size in zip(effects, sizes)]
    moved = coast.read(ship, [Action(), *actions])
    axes = _never_known(ship, coast, moved[0])
    values = slopes - (slopes @ axes) @ axes.T
    squares = np.einsum('pm,pm->p', values, values)
    seen = np.flatnonzero(np.isfinite(squares) & (squares > 0.0))
    traces = _flat(moved[1:] - moved[0])
    found = []
    for effect, size, trace in zip(effects, sizes, traces - (traces @ axes) @ axes.T):
        distance = float(np.linalg.norm(trace))
        rms = distance / math.sqrt(len(coast.time_s))
        if not len(seen) or not (math.isfinite(rms) and rms > _NOTHING):
            continue
        errors = np.clip(values[seen] @ trace / squares[seen], -WORST, WORST)
        left = np.linalg.norm(trace - errors[:, None] * values[seen], axis=1) / distance
        best = int(np.argmin(left))
        key, error = listed[seen[best]].key, float(errors[best])
        found.append(Mimic(effect.name, size[0], rms, key, error, float(left[best])))
    return tuple(sorted(found, key=lambda mimic: mimic.left))


def _never_known(ship: Ship, coast: Coast, reading: Float64) -> Float64:
    """Return axes of what is never known beforehand: speed and place at the start."""
    speed = coast.scenario.speed_m_s * (1.0 - _SPEED_STEP)
    slower = coast.read(ship, [Action()], speed_m_s=speed)[0]
    rows = np.zeros((3, *reading.shape))
    rows[0] = slower - reading
    rows[1, :, 1] = rows[2, :, 2] = 1.0
    return np.asarray(np.linalg.qr(_flat(rows).T)[0], np.float64)


def _flat(readings: Float64) -> Float64:
    return readings.reshape(len(readings), -1)


def _usual_values(effect: Effect, ship: Ship) -> tuple[float, ...]:
    """Return a usual size of an effect."""
    size, *others = effect.parameters_of(ship)
    usual = (other.value if other.is_given else other.prior.typical for other in others)
    return size.prior.typical, *usual


_CHECK_FRACTION = 0.85  # of the speed, in the check
_SMALL, _SD = slice(0, 2), slice(4, 6)  # of CHANGES, and the stated sd behind them


@dataclass(frozen=True)
class Importance:
    """
    What a wrong value does.

    Attributes
    ----------
    estimated, stated
        Relative change of r(v), root mean square over the speeds of the coast,
        by 10 per cent of the value: of the r that is estimated from a record,
        and of the one that the ship file states.
    tolerable
        Relative error that moves the record as far as all stated uncertainties
        together; NaN where none is stated, infinite where it does not move it.
    """

    particular: Particular
    estimated: float
    stated: float
    tolerable: float


@dataclass(frozen=True)
class CoastCheck:
    """
    A coastdown with all dropped values 10 per cent wrong, so that they add up.

    Attributes
    ----------
    coast
        From another speed.
    speed_m_s, position_m
        Root mean square differences.
    """

    coast: Coast
    speed_m_s: float
    position_m: float


@dataclass(frozen=True)
class CoastStudy:
    """
    What matters to the coastdowns of a ship.

    Attributes
    ----------
    losses
        Of `CHANGES`, and of plus and minus one stated standard deviation; root
        mean square, in standard deviations of the instruments.
    selection
        By the mean over `CHANGES`.
    importance
        One a value.
    mimics
        One an effect that the ship file lets act.
    """

    ship: Ship
    coast: Coast
    losses: Losses
    selection: Selection
    importance: tuple[Importance, ...]
    mimics: tuple[Mimic, ...]
    check: CoastCheck

    def to_dict(self) -> dict[str, Any]:
        """
        Return the document of a ship file; no manoeuvre of hers has an overshoot.
        """
        check = self.check
        return {
            'manoeuvre': self.coast.name,
            'loss': self.losses.to_dict(),
            **asdict(self.selection),
            'check': {
                'manoeuvre': check.coast.name,
                'overshoot_full_deg': [],
                'overshoot_reduced_deg': [],
                'rms_difference': {'speed_m_s': check.speed_m_s, 'position_m': check.position_m},
            },
            'resistance': {
                one.particular.key: {
                    'estimated': one.estimated,
                    'stated': one.stated,
                    'know_within': one.tolerable,
                }
                for one in self.importance
            },
            'mimics': [asdict(mimic) for mimic in self.mimics],
        }


def study_coast(ship: Ship, coast: Coast, *, keep: int | None = None) -> CoastStudy:
    """
    Find which values of a ship file must be known well.

    Parameters
    ----------
    keep
        How many values; those of which an error of 10 per cent moves the
        record beyond the noise of its instruments by default.

    Raises
    ------
    SensitivityError
        If there are not so many.
    """
    listed = particulars(ship, speed_m_s=coast.scenario.speed_m_s)

    def simulate(factors: Float64) -> Float64:
        return np.stack([_reading(_changed(ship, listed, row), coast) for row in factors])

    steps = np.array([[*CHANGES, one.sd, -one.sd] for one in listed])
    whole = vary(simulate, [one.key for one in listed], np.ones(len(listed)), steps)
    coasting = replace(whole, differences=whole.differences[:, :, coast.after_stop])
    losses = coasting.losses()
    if keep is None:
        keep = max(1, int(np.sum(_mean(losses.table[:, _SMALL]) >= 1.0)))
    selection = losses.select(keep)
    importance = _importance(ship, coast, listed, losses)
    alike = mimics(ship, coast, listed, whole.slopes() / CHANGES[0])
    check = _check(ship, coast, listed, coasting, selection)
    return CoastStudy(ship, coast, losses, selection, importance, alike, check)


def _changed(ship: Ship, listed: Sequence[Particular], factors: Float64) -> Ship:
    for one, factor in zip(listed, factors):
        if factor != 1.0:
            ship = one.scaled(ship, float(factor))
    return ship


def _reading(ship: Ship, coast: Coast) -> Float64:
    try:
        reading: Float64 = coast.read(ship, [Action()])[0]
    except ShipdragError:  # a value so far off that the baseline does not hold the speed
        return np.full((len(coast.time_s), 3), np.nan)
    return reading


def _mean(table: Float64) -> Float64:
    """Return the mean of each row over what is known; 0 where nothing is."""
    known = np.isfinite(table)
    return np.asarray(np.where(known, table, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def _importance(
    ship: Ship, coast: Coast, listed: Sequence[Particular], losses: Losses
) -> tuple[Importance, ...]:
    top = coast.scenario.speed_m_s
    speeds = np.linspace(SLOWED * top, top, 50)
    speeds = speeds[speeds >= ship.baseline_range_m_s[0]]

    def both(changed: Ship) -> tuple[Float64, Float64]:
        return 1.0 + changed.n_r(speeds), changed.resistance_n(speeds) / changed.mass_kg

    small = _mean(losses.table[:, _SMALL])
    known = float(np.linalg.norm(_mean(losses.table[:, _SD]))) or np.nan
    found = []
    for one, loss in zip(listed, small):
        estimated, stated = (
            float(np.sqrt(np.mean((after / before - 1.0) ** 2)))
            for before, after in zip(both(ship), both(one.scaled(ship, 1.0 - CHANGES[0])))
        )
        tolerable = CHANGES[0] * known / loss if loss > 0.0 else math.inf
        found.append(Importance(one, estimated, stated, tolerable))
    return tuple(found)


def _check(
    ship: Ship,
    coast: Coast,
    listed: Sequence[Particular],
    responses: Responses,
    selection: Selection,
) -> CoastCheck:
    shift = responses.slopes(0, 1).reshape(len(listed), -1, 3)[:, -1, 1]
    signs = np.where(shift < 0.0, -1.0, 1.0)
    dropped = [one.key in selection.dropped for one in listed]
    factors = np.where(dropped, 1.0 + CHANGES[0] * signs, 1.0)
    other = coast_from(ship, max(_CHECK_FRACTION * coast.scenario.speed_m_s, _slowest_m_s(ship)))
    wrong = _reading(_changed(ship, listed, factors), other) - _reading(ship, other)
    rms = np.sqrt(np.mean(wrong[other.after_stop] ** 2, axis=0))
    return CoastCheck(other, float(rms[0]) * LOG_SD_M_S, float(rms[1]) * POSITION_SD_M)
