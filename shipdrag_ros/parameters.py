# SPDX-License-Identifier: Apache-2.0
"""
Parameters of the monitor and of the estimator, the one list of them.

The node's descriptors, `config/parameters.yaml`, the README's table and the
check of a bag's `parameters.yaml` are all made from `Parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ParameterError

_SECTION = 'ros__parameters'
FORMER_ESTIMATORS = {'warped': 'log_time', 'motion': 'ode_fit'}
"""Names that an estimator had before, still accepted, and what they are now."""
# every module of that folder is one; listed without importing it
ESTIMATORS = (
    'auto',
    *(
        module.name
        for module in iter_modules([str(Path(__file__).parent / 'estimation' / 'estimators')])
    ),
    *FORMER_ESTIMATORS,
)
"""Values of the parameter `estimator`."""


def _parameter(
    default: float | int | str,
    text: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    metadata = {'text': text, 'unit': unit, 'low': low, 'high': high, 'choices': choices}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Parameters:
    """
    Everything that changes a result, besides the ship.

    Raises
    ------
    ParameterError
        If a value is of the wrong type or out of its range.
    """

    frozen_s: float = _parameter(
        120.0,
        'a speed or position that repeats unchanged for longer is rejected as frozen',
        unit='s',
        low=1.0,
        high=86400.0,
    )
    late_s: float = _parameter(
        5.0,
        'a sample stamped this much before the newest stamp of any input is rejected as late',
        unit='s',
        low=0.1,
        high=3600.0,
    )
    data_stop_s: float = _parameter(
        60.0,
        'a coastdown ends when the speed source is silent for longer',
        unit='s',
        low=1.0,
        high=3600.0,
    )
    steady_s: float = _parameter(
        1800.0,
        'record before the present from which the noise of the speed is learnt; kept in memory',
        unit='s',
        low=60.0,
        high=7200.0,
    )
    slope_window_s: float = _parameter(
        60.0,
        'length of the slope test that proposes an onset from speed alone',
        unit='s',
        low=5.0,
        high=600.0,
    )
    false_alarms_per_day: float = _parameter(
        0.1,
        'rate of chance proposals in steady sailing that sets the threshold of the slope test',
        unit='1/day',
        low=1e-3,
        high=100.0,
    )
    confirm_s: float = _parameter(
        120.0,
        'length of deceleration that must look like a coastdown before one is confirmed '
        'without shaft speed',
        unit='s',
        low=10.0,
        high=1200.0,
    )
    shaft_stopped_fraction: float = _parameter(
        0.5,
        'shaft speed, as a fraction of the steady one, below half of which a propeller counts as '
        'standing',
        low=0.05,
        high=0.9,
    )
    turn_rad: float = _parameter(
        0.35,
        'a change of heading, or of course over ground, that ends a coastdown',
        unit='rad',
        low=0.05,
        high=3.0,
    )
    froude_min: float = _parameter(
        0.05,
        'Froude number at which a coastdown ends and below which no resistance is given',
        low=0.001,
        high=1.0,
    )
    window_s: float = _parameter(
        3600.0,
        'longest record behind one estimate; an older part of a longer coastdown rolls out',
        unit='s',
        low=60.0,
        high=21600.0,
    )
    update_s: float = _parameter(
        10.0,
        'spacing of the estimates during a coastdown, in stamps',
        unit='s',
        low=0.1,
        high=3600.0,
    )
    first_relative_sigma: float = _parameter(
        0.25,
        'standard deviation of the resistance, as a fraction of it, below which the first '
        'estimate of a coastdown is given; those after it are all given',
        low=0.01,
        high=10.0,
    )
    heading_convention: str = _parameter(
        'rep103',
        'rep103: yaw from east, anticlockwise; compass: from north, clockwise',
        choices=('rep103', 'compass'),
    )
    estimator: str = _parameter(
        'auto',
        'auto is log_time during a coastdown and ode_fit after it; log_time: all inputs that are '
        'there, polynomials in the logarithm of time averaged over models; ode_fit: fit of the '
        'equation of motion; s1_...: the published problems',
        choices=ESTIMATORS,
    )
    order_max: int = _parameter(
        20, 'largest number of coefficients that the order search tries', low=3, high=40
    )
    speed_sigma_m_s: float = _parameter(
        0.0,
        'known standard deviation of the speed reading, for the order search and the weights; '
        '0: unknown',
        unit='m/s',
        low=0.0,
        high=10.0,
    )
    position_sigma_m: float = _parameter(
        0.0,
        'known standard deviation of the position, for the order search and the weights; '
        '0: unknown',
        unit='m',
        low=0.0,
        high=1000.0,
    )

    def __post_init__(self) -> None:
        problems = []
        for item in fields(self):
            problem = _problem(item.name, getattr(self, item.name), item.default, item.metadata)
            if problem:
                problems.append(problem)
        if problems:
            raise ParameterError('parameters', problems)

    @classmethod
    def from_mapping(cls, values: Mapping[str, object], *, subject: str) -> Parameters:
        """
        Build from names and values; what is not named keeps its default.

        Raises
        ------
        ParameterError
            Naming every unknown key and every bad value at once.

        Examples
        --------
        >>> from shipdrag_ros.parameters import Parameters
        >>> Parameters.from_mapping({'update_s': 10.0}, subject='mine').update_s
        10.0
        """
        known = {item.name: item for item in fields(cls)}
        problems = [
            f'{name!r}: unknown; known are {", ".join(sorted(known))}'
            for name in values
            if name not in known
        ]
        accepted: dict[str, Any] = {}
        for name, value in values.items():
            if name not in known:
                continue
            item = known[name]
            # YAML writes 60 for 60.0; nothing is lost by taking it
            if isinstance(item.default, float) and type(value) is int:
                value = float(value)
            problem = _problem(name, value, item.default, item.metadata)
            if problem:
                problems.append(problem)
            accepted[name] = value
        if problems:
            raise ParameterError(subject, problems)
        return cls(**accepted)

    @classmethod
    def from_yaml(cls, text: str, *, subject: str) -> Parameters:
        """
        Build from the text of a `parameters.yaml`.
        """
        try:
            values, problems = strict_yaml.load(text)
        except ValueError as error:
            raise ParameterError(subject, [f'not YAML: {error}']) from error
        if values is None:
            values = {}
        if not isinstance(values, dict):
            problems = [f'is {values!r}, expected a list of `name: value`']
        elif any(isinstance(value, dict) and _SECTION in value for value in values.values()):
            problems = [
                f'is a parameter file of the node, with {_SECTION}; '
                'give the lines `name: value` alone'
            ]
        if problems:
            raise ParameterError(subject, problems)
        return cls.from_mapping(values, subject=subject)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Parameters:
        """
        Build from a file as `from_yaml` does.

        Raises
        ------
        ParameterError
            Naming every problem of the file at once.
        """
        try:
            text = Path(path).read_text(encoding='utf-8-sig')
        except OSError as error:
            problem = f'cannot be read: {error.strerror}; give the path of a parameter file'
            raise ParameterError(str(path), [problem]) from error
        except ValueError as error:
            problem = f'is not a text file: {error}; save it as UTF-8'
            raise ParameterError(str(path), [problem]) from error
        return cls.from_yaml(text, subject=str(path))

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back.
        """
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return strict_yaml.dump(values)


def _problem(name: str, value: object, default: object, about: Mapping[str, Any]) -> str | None:
    """Say what is wrong with one value, or None."""
    if about['choices']:
        if value in about['choices']:
            return None
        return f'{name}: {value!r}, expected one of {", ".join(about["choices"])}'
    unit = f' {about["unit"]}' if about['unit'] else ''
    expectation = f'{about["low"]:g}..{about["high"]:g}{unit}'
    if isinstance(value, bool) or not isinstance(value, type(default)):
        kind = 'a whole number' if isinstance(default, int) else 'a number'
        return f'{name}: {value!r}, expected {kind}, {expectation}'
    # written so that NaN fails
    if not (about['low'] <= value <= about['high']):
        return f'{name}: {value!r}, expected {expectation}'
    return None
