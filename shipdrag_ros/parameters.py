# SPDX-License-Identifier: Apache-2.0
"""
Parameters of the monitor and of the estimator, the one list of them.

The node's descriptors, `config/parameters.yaml`, the README's table and the
check of a bag's `parameters.yaml` are all made from `Parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import yaml

from shipdrag_ros.errors import ParameterError


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
        'shaft speed, as a fraction of the steady one, below which the engine counts as stopped',
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
    heading_convention: str = _parameter(
        'rep103',
        'rep103: yaw from east, anticlockwise; compass: from north, clockwise',
        choices=('rep103', 'compass'),
    )
    estimator: str = _parameter(
        'auto',
        'auto takes the joint fit where both speed and position are there',
        choices=('auto', 's1_joint', 's1_position', 's1_speed'),
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
            values = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ParameterError(subject, [f'not YAML: {error}']) from error
        if values is None:
            values = {}
        if not isinstance(values, dict):
            raise ParameterError(subject, [f'is {values!r}, expected a list of `name: value`'])
        return cls.from_mapping(values, subject=subject)

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back.
        """
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return yaml.safe_dump(values, sort_keys=False)


def _problem(name: str, value: object, default: object, about: Mapping[str, Any]) -> str | None:
    """Say what is wrong with one value, or None."""
    kind = type(default)
    if type(value) is not kind:
        return f'{name}: {value!r} is of type {type(value).__name__}, expected {kind.__name__}'
    if about['choices'] and value not in about['choices']:
        return f'{name}: {value!r}, expected one of {", ".join(about["choices"])}'
    if kind is str:
        return None
    assert isinstance(value, int | float)
    # written so that NaN fails
    if not (about['low'] <= value <= about['high']):
        unit = f' {about["unit"]}' if about['unit'] else ''
        return f'{name}: {value!r}, expected {about["low"]:g}..{about["high"]:g}{unit}'
    return None
