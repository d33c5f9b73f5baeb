# SPDX-License-Identifier: Apache-2.0
"""What several runs share is learnt, written and known by its name; what is not, is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shipdrag_ros as sd
from shipdrag_ros.learning import words
from shipdrag_ros.learning.search import Learnt
from shipdrag_ros.ship.term import LearntTerm
from shipdrag_ros.simulation import Scenario
from shipdrag_ros.simulation.declared import effect_of
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import using

WEED = Path(__file__).resolve().parents[2] / 'docs' / 'data' / 'effects' / 'weed.yaml'
# a sharp edge: a broad one looks like a hump about it
HIDDEN = LearntTerm.from_yaml(WEED.read_text().replace('0.02*sqrt(g*L)', '0.006*sqrt(g*L)'))
SIZES = {'A': 0.0004, 'u_c': 0.13}
SHIP = sd.Ship.example()
FRAME = Frame(SHIP, Scenario(speed_m_s=7.0), 0.0)
pytestmark = pytest.mark.timeout(900)  # a busy machine compares for minutes
RUNS = ((7.0, 0.3), (6.6, -1.7), (6.0, 2.1), (6.2, 0.9))  # speed and heading of each


def sailed(number: int) -> sd.Record:
    """Return a run of a ship with weed that no library knows."""
    speed, heading = RUNS[number]
    with using([HIDDEN]):
        return sd.simulate(
            SHIP,
            {'weed': SIZES},
            speed_m_s=speed,
            heading_rad=heading,
            lead_in_s=600.0,
            duration_s=1500.0,
            start=f'2026-06-{number + 1:02d}',
            seed=number,
        )


@pytest.fixture(scope='module')
def learnt() -> Learnt:
    return sd.learn([sailed(number) for number in range(4)], ship=SHIP, name='kelp')


def test_four_runs_show_the_form_and_its_size(learnt: Learnt) -> None:
    term = learnt.term
    assert term is not None, learnt.reason
    assert (term.term.variable, term.term.shape) == ('speed', 'step')
    values = tuple(each.value for each in term.parameters.values())
    speed = np.linspace(1.5, 6.5, 60)
    true = effect_of(HIDDEN).action(FRAME, *SIZES.values()).resistance_n(speed)
    found = effect_of(term).action(FRAME, *values).resistance_n(speed)
    # nine in ten of what it does to the ship are known
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.2 * np.sqrt(np.mean(true**2))


def test_what_is_written_says_what_it_rests_on(learnt: Learnt, tmp_path: Path) -> None:
    assert learnt.term is not None
    again = LearntTerm.from_yaml(learnt.term.to_yaml())
    assert again == learnt.term
    rest = again.evidence
    assert rest is not None
    assert len(set(rest.runs)) == 4
    assert rest.halves_agree
    assert rest.over_nothing > 3.0
    assert rest.over_smooth > 0.0
    assert rest.held_out_gap_cut > 0.3
    assert 'kelp: a force by speed (step)' in words.sentence(learnt)
    assert words.document(learnt)['learnt']['name'] == 'kelp'
    words.write_report(tmp_path / 'page.html', learnt)
    page = (tmp_path / 'page.html').read_text()
    assert f'{rest.over_smooth:.1f}' in page
    assert f'{1.0 - rest.held_out_gap_cut:.0%}' in page


def test_one_run_writes_nothing_and_says_what_would_decide(tmp_path: Path) -> None:
    found = sd.learn(sailed(0), ship=SHIP)
    assert found.term is None
    assert 'one run' in found.reason
    assert 'another speed' in found.next_run
    assert found.where is not None
    assert found.where.channel == 'force'
    document = words.document(found)
    assert document['learnt'] is None
    assert document['next_run']
    words.write_report(tmp_path / 'page.html', found)
    assert 'Nothing is written' in (tmp_path / 'page.html').read_text()


def test_what_the_library_names_is_not_learnt() -> None:
    runs = [
        sd.simulate(
            SHIP,
            {'fouling': 0.6},
            speed_m_s=speed,
            lead_in_s=600.0,
            duration_s=1000.0,
            start=f'2026-06-{number + 1:02d}',
            seed=number,
        )
        for number, (speed, _) in enumerate(RUNS[:2])
    ]
    found = sd.learn(runs, ship=SHIP)
    assert found.term is None
    # what none of them reaches, the diagnosis does not name either
    assert 'effects of the library explain it' in found.reason
    assert 'says which, or what would decide' in found.reason


def test_a_hull_that_changed_between_runs_is_said_and_not_learnt() -> None:
    runs = [
        sd.simulate(
            SHIP,
            {'fouling': size} if size else {},
            lead_in_s=1800.0,
            seed=number,
            start=f'2026-06-01T0{number}:00',
        )
        for number, size in enumerate((0.0, 0.3, 0.3))
    ]
    found = sd.learn(runs, ship=SHIP)
    assert found.term is None
    clean, *fouled = (each.size for each in found.runs_differ)
    assert abs(clean.value) < 3.0 * clean.sd
    assert all(abs(each.value - clean.value) > 3.0 * each.sd for each in fouled)
    assert any('These runs differ: no one size' in line for line in words.lines(found))
    assert len(words.document(found)['runs_differ']) == 3
    # fouling is held though one size of it fits the runs less well than one of others does
    assert found.probability['fouling'] > 0.05


def test_a_ship_without_a_baseline_is_an_error() -> None:
    with pytest.raises(sd.ShipdragError, match='no baseline'):
        sd.learn(sailed(0), ship=replace(SHIP, baseline=None))
