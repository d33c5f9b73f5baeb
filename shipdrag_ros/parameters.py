# SPDX-License-Identifier: Apache-2.0
"""
Parameters of the monitor and of the estimator, the one list of them.

The node's descriptors, `config/parameters.yaml`, the docs' table and the
check of a bag's `parameters.yaml` are all made from `Parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from os import PathLike
from typing import Any

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ParameterError
from shipdrag_ros.fields import (
    choice,
    declare,
    keys_of,
    number,
    numbers,
    parse,
    read_keys,
    show,
    text_of,
    whole_number,
)
from shipdrag_ros.imports import points

_SECTION = 'ros__parameters'
FORMER_ESTIMATORS = dict.fromkeys(('auto', 'log_time', 'ode_fit', 'warped', 'motion'), 'one')
"""Names that an estimator had before, and what they are now; a file may not use them."""
_JUDGED = 'leave it out: the probability of each regime judges it, without a threshold to set'
FORMER_KEYS = {
    'regimes': 'leave it out: the filter of regimes is the only judge of a deceleration',
    'confirm_s': _JUDGED,
    'shaft_stopped_fraction': _JUDGED,
}
"""Keys that a parameter file had before, and what replaces each."""
ESTIMATOR_GROUP = 'shipdrag.estimators'
# each of these is one, also without an installation; listed without being imported
_MODULES = ('estimation/estimators/[!_]*.py', 'studies/*/estimators/[!_]*.py')
ESTIMATOR_POINTS = {
    point.name: point for point in reversed(points(ESTIMATOR_GROUP, 'ESTIMATOR', *_MODULES))
}
ESTIMATORS = tuple(sorted(ESTIMATOR_POINTS))
"""Values of the parameter `estimator`."""
SPEEDS_M_S = (2.0, 1.0)


@dataclass(frozen=True)
class Parameters:
    """
    Everything that changes a result, apart from the ship.

    Attributes
    ----------
    frozen_s
        a speed or position that repeats unchanged for longer is rejected as frozen; shorter: a
        coarse sensor in a calm is rejected too; longer: a stuck one is believed for longer
    late_s
        a sample stamped this much before the newest stamp of any input is rejected as late;
        longer: slow networks are borne, and events are told later
    data_stop_s
        a coastdown ends when the speed source is silent for longer; shorter: a short loss of the
        signal ends it
    steady_s
        record before the present from which the noise of the speed is learnt; kept in memory;
        shorter: wider bands, and effects are harder to name
    slope_window_s
        length of the slope test that proposes an onset from speed alone; longer: fewer false
        alarms in a seaway, and a later onset
    false_alarms_per_day
        rate of chance proposals in steady sailing that sets the threshold of the slope test;
        larger: gentler stops are seen, and more are proposed that are none
    turn_rad
        a change of heading, or of course over ground, from which on a window that is given by hand
        is cut; larger: turning slows the ship and is counted as resistance
    froude_min
        Froude number at which a coastdown ends and below which no resistance is given; smaller:
        longer runs, in which wind and current weigh more
    window_s
        longest record behind one estimate; an older part of a longer coastdown rolls out; longer:
        each estimate takes more memory and time
    update_s
        spacing of the estimates during a coastdown, in stamps; shorter: more load on the CPU
    first_relative_sigma
        standard deviation of the resistance, as a fraction of it, below which the first estimate
        of a coastdown is given; those after it are all given; larger: it comes sooner and is worth
        less
    forecast_speeds
        speeds of which the forecast of a glide speaks, and of 90, 75, 50 and 25 % of that at the
        stop; lower: it reaches further, where less is known
    heading_convention
        rep103: yaw from east, anticlockwise; compass: from north, clockwise; the wrong one turns
        current and wind into the wrong quarter
    estimator
        one: one posterior of hull, thrust, instruments and noise, of all inputs, while a coastdown
        runs and after it; s1_...: the published problems
    order_max
        largest number of coefficients that the order search of the published estimators tries;
        larger: more detail, more time
    speed_sigma_m_s
        known standard deviation of the speed reading, for the order search and the weights; 0:
        unknown; one that is too small makes bands too narrow
    position_sigma_m
        known standard deviation of the position, for the order search and the weights; 0: unknown;
        one that is too small makes bands too narrow

    Raises
    ------
    ParameterError
        If a value is of the wrong type or out of its range.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> sd.Parameters(update_s=5.0).update_s
    5.0
    """

    frozen_s: float = declare(number(1.0, 86400.0, 's'), default=120.0)
    late_s: float = declare(number(0.1, 3600.0, 's'), default=5.0)
    data_stop_s: float = declare(number(1.0, 3600.0, 's'), default=60.0)
    steady_s: float = declare(number(60.0, 7200.0, 's'), default=1800.0)
    slope_window_s: float = declare(number(5.0, 600.0, 's'), default=60.0)
    false_alarms_per_day: float = declare(number(1e-3, 100.0, '1/day'), default=0.1)
    turn_rad: float = declare(number(0.05, 3.0, 'rad'), default=0.35)
    froude_min: float = declare(number(0.001, 1.0), default=0.05)
    window_s: float = declare(number(60.0, 21600.0, 's'), default=3600.0)
    update_s: float = declare(number(0.1, 3600.0, 's'), default=10.0)
    first_relative_sigma: float = declare(number(0.01, 10.0), default=0.25)
    forecast_speeds: tuple[float, ...] = declare(
        numbers(0.01, 40.0, 'm/s', minimum=1), default=SPEEDS_M_S
    )
    heading_convention: str = declare(choice('rep103', 'compass'), default='rep103')
    estimator: str = declare(choice(*ESTIMATORS, former=FORMER_ESTIMATORS), default='one')
    order_max: int = declare(whole_number(3, 40), default=20)
    speed_sigma_m_s: float = declare(number(0.0, 10.0, 'm/s'), default=0.0)
    position_sigma_m: float = declare(number(0.0, 1000.0, 'm'), default=0.0)

    def __post_init__(self) -> None:
        given = {item.name: getattr(self, item.name) for item in fields(self)}
        accepted, problems = _read(given)
        for name, value in accepted.items():
            object.__setattr__(self, name, value)  # 60 for 60.0 is taken, and made a float
        if problems:
            raise ParameterError('parameters', problems)

    @classmethod
    def from_mapping(cls, values: Mapping[str, object], *, subject: str) -> Parameters:
        """
        Build from names and values; what is not named keeps its default.

        Parameters
        ----------
        values
            By name, in the unit that each name ends in.
        subject
            Names the values in errors, a path for instance.

        Returns
        -------
        Parameters
            Checked.

        Raises
        ------
        ParameterError
            Naming every unknown key and every bad value at once.

        Notes
        -----
        Source: config/parameters.yaml lists all of them with meaning, unit and default.

        Examples
        --------
        >>> from shipdrag_ros.parameters import Parameters
        >>> Parameters.from_mapping({'update_s': 10.0}, subject='mine').update_s
        10.0
        """
        accepted, problems = _read(dict(values))
        if problems:
            raise ParameterError(subject, problems)
        return cls(**accepted)

    @classmethod
    def from_yaml(cls, text: str, *, subject: str) -> Parameters:
        """
        Build from the text of a `parameters.yaml`.
        """
        return cls.from_mapping(_values(text, subject=subject), subject=subject)

    @classmethod
    def of_bag(cls, text: str, *, subject: str) -> tuple[Parameters, tuple[str, ...]]:
        """
        Build from what a bag was recorded with, perhaps by another version.

        Parameters
        ----------
        text
            Of its `parameters.yaml`.
        subject
            Names the values in errors.

        Returns
        -------
        parameters, dropped
            Without the keys and values that this version does not have, and these, a
            sentence each.

        Raises
        ------
        ParameterError
            If the text holds no parameters at all.
        """
        accepted: dict[str, object] = {}
        dropped: list[str] = []
        for name, value in _values(text, subject=subject).items():
            read, problems = _read({name: value})
            if problems:
                dropped.append(f'{subject}: {"; ".join(problems)}: not used')
            else:
                accepted |= read
        return cls.from_mapping(accepted, subject=subject), tuple(dropped)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Parameters:
        """
        Build from a file as `from_yaml` does.

        Raises
        ------
        ParameterError
            Naming every problem of the file at once.
        """
        text = text_of(path, what='a parameter file', error=ParameterError)
        return cls.from_yaml(text, subject=str(path))

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back.
        """
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        values['forecast_speeds'] = list(self.forecast_speeds)
        return strict_yaml.dump(values)


def _read(values: dict[str, object]) -> tuple[dict[str, Any], list[str]]:
    """Return what of these is known and valid, and what is wrong with the others."""
    problems: list[str] = []
    return read_keys(keys_of(Parameters), values, '', problems, former=FORMER_KEYS), problems


def _values(text: str, *, subject: str) -> dict[str, object]:
    values = parse(text, subject=subject, error=ParameterError)
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise ParameterError(subject, [f'is {show(values)}, expected lines `name: value`'])
    if any(isinstance(value, dict) and _SECTION in value for value in values.values()):
        raise ParameterError(
            subject,
            [
                f'is a parameter file of the node, with {_SECTION}; '
                'give the lines `name: value` alone'
            ],
        )
    return values
