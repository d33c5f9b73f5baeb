# SPDX-License-Identifier: Apache-2.0
"""Figures as text."""

from __future__ import annotations

import pytest

from shipdrag_ros import display


@pytest.mark.parametrize(
    ('value', 'spread', 'text'),
    [
        (0.0158734, 0.00083, '0.01587 ± 0.00083'),
        (328.64, 17.3, '329 ± 17'),
        (32864.0, 1730.0, '32900 ± 1700'),
        (-0.4, 0.031, '-0.400 ± 0.031'),
        (1.5, 0.0, '1.5 ± 0'),
        (1.5, float('nan'), '1.5 ± nan'),
    ],
)
def test_a_spread_sets_the_digits(value: float, spread: float, text: str) -> None:
    assert display.plus_minus(value, spread) == text
    assert display.plus_minus(value, spread, '+') == f'{"" if value < 0.0 else "+"}{text}'


def test_times_of_a_real_clock_are_dates_and_others_are_seconds() -> None:
    assert display.utc(1_700_000_000_000_000_000) == '2023-11-14 22:13:20 UTC'
    assert display.utc(153_200_000_000) == '153 s'
    assert display.utc(2**62) == '2116-02-20 23:53:38 UTC'


def test_what_begins_in_one_second_is_told_apart() -> None:
    items = [(153_200_000_000, 'a'), (153_900_000_000, 'b'), (10**12, 'c')]
    assert display.dated(items) == [('153 s (1)', 'a'), ('153 s (2)', 'b'), ('1000 s', 'c')]


def test_a_long_time_is_also_given_in_minutes() -> None:
    assert display.duration(40.0) == '40 s'
    assert display.duration(1500.0) == '1500 s (25 min)'


def test_a_slow_ship_is_told_to_the_millimetre() -> None:
    assert display.speed_text(4.5678, highest_m_s=8.0) == '4.57'
    assert display.speed_text(0.5678, highest_m_s=0.9) == '0.568'


@pytest.mark.parametrize('first', ['=', '+', '-', '@', '\t', '\r'])
def test_no_text_is_a_formula(first: str) -> None:
    assert display.spreadsheet_text(f'{first}1+1') == f"'{first}1+1"
    assert display.spreadsheet_text(f'run {first}1') == f'run {first}1'
    assert display.spreadsheet_text('') == ''


@pytest.mark.parametrize(
    ('ratio', 'named'),
    [
        (1.9438, 'knots over m/s (1.94) and km/h over knots (1.85)'),
        (3.3, 'km/h over m/s (3.60)'),
        (0.28, 'm/s over km/h (0.28)'),
        (3.2, ''),
        (0.45, 'm/s over mph (0.45)'),
        (1.14, 'mph over knots (1.15)'),
        (1.12, ''),
        (1.0, ''),
        (-1.94, ''),
        (float('nan'), ''),
    ],
)
def test_units_are_mistaken_within_a_tenth_of_their_ratio(ratio: float, named: str) -> None:
    assert display.mistaken_units(ratio) == named
