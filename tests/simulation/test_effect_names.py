# SPDX-License-Identifier: Apache-2.0
"""No effect is known by name outside its own declaration; what others need, it declares."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import shipdrag_ros
from shipdrag_ros.coastdown.regimes.bank import OUT as REGIMES
from shipdrag_ros.posterior.weather import Reference
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Frame, Scenario
from shipdrag_ros.simulation.effect import Measure, Scope, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

PACKAGE = Path(shipdrag_ros.__file__).parent
EFFECTS = PACKAGE / 'simulation' / 'effects'
CONFIG = PACKAGE.parent / 'config'
SOURCES = sorted(path for path in PACKAGE.rglob('*.py') if EFFECTS not in path.parents)
# a section of the ship file has the name of an effect as well, and so have a regime and a
# condition that r(v) refers to
NAMES = set(LIBRARY) - {each.name for kind in (Ship, Reference) for each in fields(kind)}
NAMES -= set(REGIMES)
OF_LOG_AND_TRACK = [e for e in LIBRARY.values() if WithoutBaseline.LOG_TRACK in e.without_baseline]


def words(path: Path) -> Iterator[str]:
    """Yield the texts of a source file, without its docstrings."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    said = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.value


def test_no_effect_is_known_by_name() -> None:
    assert {path.name: held for path in SOURCES if (held := NAMES & {*words(path)})} == {}


def test_no_text_of_the_diagnosis_tells_of_an_effect_by_its_name() -> None:
    coined = {name for name in NAMES if '_' in name}
    texts = [text for path in (PACKAGE / 'diagnosis').glob('*.py') for text in words(path)]
    assert len(texts) > 100
    assert [text for text in texts if coined & set(re.findall(r'\w+', text))] == []


@pytest.mark.parametrize('effect', OF_LOG_AND_TRACK, ids=lambda effect: effect.name)
def test_what_log_and_track_show_acts_alike_on_all_ships(effect) -> None:
    ships = [Ship.load(CONFIG / name) for name in ('vitus_bering.yaml', 'yacht.yaml')]
    assert ships[0].length_m != ships[1].length_m
    values = np.linspace(0.1, 0.2, len(effect.parameters))
    scenarios = Scenario(speed_m_s=8.0), Scenario(speed_m_s=3.0)
    one, other = (
        effect.action(Frame(ship, scenario, 0.4), *values)
        for ship, scenario in zip(ships, scenarios, strict=True)
    )
    assert one == other
    assert [q.of(ships[0]).prior for q in effect.parameters] == [
        q.of(ships[1]).prior for q in effect.parameters
    ]
    assert effect.without_baseline[WithoutBaseline.LOG_TRACK]


def test_an_effect_of_a_sensor_says_which_reading_errs() -> None:
    for effect in LIBRARY.values():
        assert bool(effect.errs_in) == (effect.scope is Scope.SENSOR)
        # where a scale of the Earth rules it out, it is one of positions
        assert effect.in_geodetic or 'position' in effect.errs_in


def test_confounders_are_inseparable_where_nothing_measured_tells_them_apart() -> None:
    every = list(LIBRARY.values())
    assert inseparable(every) == (frozenset(('added_mass', 'displacement')),)
    scales, delays = frozenset(('log_scale', 'radar_scale')), frozenset(('log_lag', 'time_offset'))
    courses = [Measure.RECIPROCAL_RUN, Measure.ANOTHER_COURSE, Measure.OTHER_SPEED]
    assert inseparable(OF_LOG_AND_TRACK, measured=courses) == (delays, scales)
    assert set(inseparable(OF_LOG_AND_TRACK, measured=courses[2:])) == {
        scales,
        delays,
        frozenset(('current', 'log_offset')),
    }
