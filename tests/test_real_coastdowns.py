# SPDX-License-Identifier: Apache-2.0
"""The table of measured coastdowns beside what is known: its judgement, and its rows."""

from __future__ import annotations

import os
from typing import Any

import pytest

from benchmarks._tables import table
from benchmarks.accuracy import real_coastdowns

START_NS = 10**18


def said(*coastdowns: dict[str, Any], error: str = '', reason: str = '') -> Any:
    dismissed = [{'reason': reason, 'start_ns': START_NS, 'end_ns': START_NS}] if reason else []
    return real_coastdowns.Said(coastdowns, dismissed, error, START_NS)


def coastdown(
    start_s: float, end_s: float, r: float, sigma: float, **changes: Any
) -> dict[str, Any]:
    return {
        'start_ns': START_NS + round(start_s * 1e9),
        'end_ns': START_NS + round(end_s * 1e9),
        'ended_by': 'given',
        'failure': None,
        'notes': [],
        'speed_m_s': [0.5, 1.5],
        'resistance_m_s2': [r, r],
        'sigma_m_s2': [2.0 * sigma, 2.0 * sigma],  # with n_r
        'sigma_repeatable_m_s2': [sigma, sigma],
    } | changes


def known(name: str) -> Any:
    return next(coast for coast in real_coastdowns.COASTS if coast.record.name == name)


def judged(name: str, itself: Any, window: Any) -> str:
    return str(real_coastdowns.judged(known(name), itself, window))


def test_a_figure_must_be_near_and_its_band_narrow() -> None:
    # blueboat_222: 0.231 +- 0.020 (two sd) over 0.65 to 1 m/s, from 59.8 s on
    def of(r: float, sigma: float) -> str:
        window = said(coastdown(60.0, 90.0, r, sigma))
        return judged('blueboat_222', said(), window)

    assert of(0.231, 0.01) == 'yes'
    assert of(0.231 + 0.028, 0.01) == 'yes'
    assert of(0.231 + 0.029, 0.01) == 'NO: 0.65 to 1 m/s off by 2.1 joint sd'
    assert of(0.231, 0.0149) == 'yes'
    assert 'its sd is 1.6 times' in of(0.231, 0.016)


def test_what_the_monitor_finds_counts_before_the_window() -> None:
    good, bad = (said(coastdown(60.0, 90.0, r, 0.01)) for r in (0.231, 0.5))
    assert judged('blueboat_222', good, bad) == 'yes'
    assert judged('blueboat_222', bad, good).startswith('NO')
    elsewhere = said(coastdown(60.0, 90.0, 0.1, 0.01, speed_m_s=[0.1, 0.4]))
    assert judged('blueboat_222', elsewhere, good) == 'yes'


def test_a_stretch_beyond_the_coast_is_wrong_whatever_its_figure() -> None:
    long = said(coastdown(40.0, 90.0, 0.231, 0.01))
    assert 'reported is 40 to 90 s, the coast 60 to 95 s' in judged('blueboat_222', said(), long)


def test_a_refusal_needs_its_reason() -> None:
    silent, astern = said(), said(reason='astern')
    assert judged('blueboat_221', silent, silent) == 'NO: no figure'
    assert judged('blueboat_221', silent, astern) == 'yes: refused, astern'
    told = said(error='she goes ASTERN there; give another window')
    assert judged('blueboat_221', silent, told) == 'yes: refused, astern'
    assert judged('blueboat_222', silent, astern) == 'NO: no figure'
    figure = coastdown(37.0, 62.0, 0.0026, 0.0001, speed_m_s=[0.1, 0.3])
    unsaid = judged('esso_osaka_2030s', silent, said(figure))
    assert unsaid == 'NO: agrees, but nothing is said of rudder or turn'
    noted = figure | {'notes': ['the rudder was over by 0.6 rad']}
    assert judged('esso_osaka_2030s', silent, said(noted)) == 'yes'


def test_the_page_has_a_row_of_each_record() -> None:
    page = real_coastdowns.real.PAGE.read_text(encoding='utf-8')
    section = page.partition('<!-- coastdowns -->')[2].partition('<!-- end coastdowns -->')[0]
    rows = [line.split('|')[1].strip() for line in section.splitlines() if line.startswith('|')]
    assert rows[2:] == [coast.record.name for coast in real_coastdowns.COASTS]


@pytest.mark.skipif('SHIPDRAG_DATA' not in os.environ, reason='needs the folder of records')
@pytest.mark.parametrize('name', ['car_whole', 'blueboat_221', 'esso_osaka_2030s'])
def test_the_page_says_what_the_program_says(tmp_path, name: str) -> None:
    coast = known(name)
    page = real_coastdowns.real.PAGE.read_text(encoding='utf-8').splitlines()
    assert table(real_coastdowns.row(coast, tmp_path), ())[0] in page, (
        'run real_coastdowns --write'
    )
