# SPDX-License-Identifier: Apache-2.0
"""Facts are read as they are told, and what is none is refused with what there is."""

from __future__ import annotations

import pytest

from shipdrag_ros.errors import DiagnosisError, ShipFileError
from shipdrag_ros.ship import Fact, Ship, parse_fact
from shipdrag_ros.ship.facts import KNOWN, RATE, UNITS_CHECKED, overriding, usage
from shipdrag_ros.simulation.effects import LIBRARY

SHIP = '{{length_m: 80.0, displaced_volume_m3: 4000.0, facts: {}}}'


def facts_of(text: str) -> tuple[Fact, ...]:
    return Ship.from_yaml(SHIP.format(text), subject='ship').facts


@pytest.mark.parametrize(
    ('text', 'fact'),
    [
        ('calm', Fact('calm')),
        ('no_towed_cable,rate=0.05', Fact('no_towed_cable', rate=0.05)),
        ('shaft=driven', Fact('shaft', 'driven')),
        (' hull_cleaned = 2026-03-01 , rate = 0.1', Fact('hull_cleaned', '2026-03-01', 0.1)),
    ],
)
def test_a_fact_is_read_as_it_is_told(text: str, fact: Fact) -> None:
    assert parse_fact(text) == fact
    assert parse_fact(str(fact)) == fact
    assert RATE == 0.02


@pytest.mark.parametrize(
    ('text', 'wrong'),
    [
        ('deep_wate', 'did you mean deep_water'),
        ('weather', usage()),
        ('shaft', 'locked or free or driven'),
        ('shaft=off', 'locked or free or driven'),
        ('calm=yes', 'has no value'),
        ('calm=', 'has no value'),
        ('hull_cleaned=spring', '2026-03-01'),
        ('calm,rate=0.9', '0.0001..0.5'),
        ('calm,rate=often', "'often'"),
        ('calm,sd=1', 'rate=RATE'),
        ('', usage()),
    ],
)
def test_what_is_no_fact_is_refused_with_what_there_is(text: str, wrong: str) -> None:
    with pytest.raises(DiagnosisError) as refused:
        parse_fact(text)
    assert wrong in str(refused.value)


@pytest.mark.parametrize(
    'text',
    [
        '[no_towed_cable, "shaft=locked,rate=0.05"]',
        '{no_towed_cable: true, shaft: {value: locked, rate: 0.05}}',
        '[no_towed_cable, {shaft: "locked,rate=0.05"}]',
        '[{name: no_towed_cable}, {name: shaft, value: locked, rate: 0.05}]',
    ],
)
def test_a_ship_file_lists_facts_or_maps_them(text: str) -> None:
    facts = facts_of(text)
    assert facts == (Fact('no_towed_cable'), Fact('shaft', 'locked', 0.05))
    ship = Ship(length_m=80.0, displaced_volume_m3=4000.0, facts=facts)
    assert Ship.from_yaml(ship.to_yaml(), subject='again') == ship


@pytest.mark.parametrize(
    ('text', 'wrong'),
    [
        ('3', 'facts: 3, expected'),
        ('[3]', 'facts[0]: 3, expected one of'),
        ('[calm, calm]', 'calm is given 2 times'),
        ('{deep_water: false}', 'leave out what is not known'),
        ('{shaft: {value: locked, sd: 1}}', 'facts.shaft.sd: unknown key'),
        ('{calm: {rate: 7}}', 'rate is 7'),
        ('{hull_cleaned: 2026-13-01}', "hull_cleaned is '2026-13-01'"),
    ],
)
def test_a_ship_file_with_a_wrong_fact_names_it(text: str, wrong: str) -> None:
    with pytest.raises(ShipFileError) as refused:
        facts_of(text)
    assert wrong in str(refused.value)


def test_the_later_source_of_a_fact_counts() -> None:
    facts = overriding([Fact('calm'), Fact('shaft', 'free')], [Fact('shaft', 'locked')])
    assert facts == (Fact('calm'), Fact('shaft', 'locked'))


def test_effects_speak_of_known_facts_and_values() -> None:
    spoken = {name for effect in LIBRARY.values() for name in effect.facts}
    assert spoken | {UNITS_CHECKED} == set(KNOWN)
    for effect in LIBRARY.values():
        for name, said in effect.facts.items():
            assert set(said.values) <= set(KNOWN[name].values)
