# SPDX-License-Identifier: Apache-2.0
"""Several instruments of a kind in one estimate: more never makes it worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.accuracy.several_instruments import Case, readings, score
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.choice import averaged
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

LEAD_S, COAST_S = 900.0, 900.0
PARAMETERS = Parameters()
SHIP = Ship.example()
LOG, LOG_2 = Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2


def sailed(*channels: Channel, seed: int = 1) -> Block:
    scenario = Scenario(speed_m_s=6.0, lead_in_s=LEAD_S, duration_s=COAST_S)
    places = (Channel.POSITION, Channel.POSITION_2)
    sensors = [Sensor(channel=each, sd=5.0 if each in places else 0.05) for each in channels]
    return sense(simulate(SHIP, scenario), sensors, seed=seed)


def window_of(block: Block) -> Window:
    stop_ns = START_NS + round(LEAD_S * 1e9)
    return Window.from_block(block, stop_ns, stop_ns + round(COAST_S * 1e9), before_ns=START_NS)


def mean_sigma(block: Block) -> float:
    return float(np.mean(estimate_final(window_of(block), SHIP, PARAMETERS).calm.sigma_m_s2))


def test_a_window_holds_further_instruments_that_were_heard() -> None:
    window = window_of(sailed(LOG, LOG_2, Channel.POSITION_2))
    assert list(window.further) == ['speed_through_water_2', 'position_2']
    assert len(window.series('speed_through_water_2')) == 901
    assert len(window.series('speed_through_water_3')) == 0
    assert window.before is not None
    assert len(window.before.series('position_2')) == 900
    part = window.part(window.start_ns, window.start_ns + 10**10)
    assert len(part.series('position_2')) == 11
    left = window.without('speed_through_water_2', 'it is wrong')
    assert len(left.series('speed_through_water_2')) == 0
    assert left.notes == ('without speed_through_water_2: it is wrong',)
    alone = window.one_of_each()
    assert not alone.further
    assert len(alone.position) == 901  # the first that was heard
    (note,) = alone.notes
    said, _, percent = note.removesuffix(' %').rpartition(' ')
    assert said == (
        'speed_through_water_2 is not used beside speed_through_water, against which it reads'
    )
    assert abs(float(percent)) < 0.5


def test_two_sound_instruments_give_no_wider_band_than_one() -> None:
    one = mean_sigma(sailed(LOG))
    two = mean_sigma(sailed(LOG, LOG_2))
    three = mean_sigma(sailed(LOG, LOG_2, Channel.SPEED_THROUGH_WATER_3))
    assert two < 0.95 * one
    assert three < two
    beside = mean_sigma(sailed(LOG, Channel.POSITION))
    for further in (Channel.POSITION_2, Channel.SPEED_OVER_GROUND_2):
        assert mean_sigma(sailed(LOG, Channel.POSITION, further)) < 1.02 * beside


def test_a_log_that_is_off_beside_two_sound_sources_is_named_and_spoils_nothing() -> None:
    ship = replace(SHIP, effects=())
    alone = np.mean([score(Case('', 1, off=True), ship, seed)[0] for seed in range(3)])
    for case in (Case('', 3, off=True), Case('', 2, 1, off=True)):
        each = np.array([score(case, ship, seed) for seed in range(3)])
        assert each[:, 0].mean() < 0.4 * alone
        assert each[:, 2].min() > 0.9
    stop_ns = START_NS + 1800 * 10**9
    block = readings(Case('', 2, 1, off=True), ship, 0)
    window = Window.from_block(block, stop_ns, stop_ns + 1500 * 10**9, before_ns=START_NS)
    found = estimate_final(window, ship, PARAMETERS)
    (said,) = (note for note in found.notes if 'speed_through_water reads' in note)
    assert 4.0 < float(said.split('reads ')[1].split(' ')[0]) < 6.0
    assert set(found.samples) == {'speed_through_water', 'speed_through_water_2', 'position'}


@pytest.mark.parametrize('estimator', [estimate, estimate_final])
@pytest.mark.parametrize('first', [LOG, Channel.SPEED_OVER_GROUND, Channel.POSITION])
def test_the_second_of_a_kind_alone_gives_what_the_first_would(first: Channel, estimator) -> None:
    block = sailed(first)
    second = Channel[f'{first.name}_2']
    moved = replace(block, channel=np.full(len(block), second, np.uint8))
    one, other = (estimator(window_of(each), SHIP, PARAMETERS) for each in (block, moved))
    assert list(other.samples) == [second.input]
    assert other.by_log is one.by_log
    r, sigma = one.calm.resistance_m_s2, one.calm.sigma_m_s2
    there = np.interp(one.calm.speed_m_s, other.calm.speed_m_s, other.calm.resistance_m_s2)
    assert np.all(np.abs(there - r) < 0.3 * sigma)
    assert other.calm.sigma_m_s2.mean() == pytest.approx(sigma.mean(), rel=0.1)


def test_a_doubted_second_log_is_averaged_over_with_and_without_it() -> None:
    window = replace(
        window_of(sailed(LOG, LOG_2)), doubted_log='speed_through_water_2', log_doubt=0.4
    )
    found = averaged(estimate_final)(window, SHIP, PARAMETERS)
    assert found.notes[-1].startswith('speed_through_water_2: with a probability of 0.40')
    alone = window_of(sailed(LOG_2))
    alone = replace(alone, doubted_log='speed_through_water_2', log_doubt=0.4)
    with pytest.raises(EstimationError, match='speed_through_water_2: '):
        averaged(estimate_final)(alone, SHIP, PARAMETERS)


def test_one_that_dies_at_the_stop_keeps_no_good_one_out() -> None:
    block = sailed(LOG, LOG_2)
    stop_ns = START_NS + round(LEAD_S * 1e9)
    window = window_of(block[(block.channel == LOG_2) | (block.stamp_ns <= stop_ns)])
    assert len(window.speed_through_water) == 1
    alone = window.one_of_each()
    assert len(alone.speed_through_water) == 901
    (note,) = alone.notes
    assert note.startswith('speed_through_water is not used beside speed_through_water_2')
    assert 'inf' not in note


def test_one_that_was_heard_before_the_stop_alone_is_still_told_of() -> None:
    block = sailed(LOG, LOG_2)
    early = block.stamp_ns < START_NS + round((LEAD_S - 100.0) * 1e9)
    window = window_of(block[(block.channel == LOG) | early])
    assert len(window.series('speed_through_water_2')) == 0
    assert window.before is not None
    assert len(window.before.series('speed_through_water_2')) == 800


def test_the_record_before_is_that_of_the_one_that_was_heard_there() -> None:
    block = sailed(LOG, LOG_2)
    late = block.stamp_ns >= START_NS + round(LEAD_S * 1e9)
    # the record of the second log before the stop teaches the noise of both
    assert mean_sigma(block[(block.channel == LOG_2) | late]) < 1.025 * mean_sigma(block)


def test_the_estimators_of_the_first_paper_say_which_log_they_use() -> None:
    window = window_of(sailed(LOG_2, Channel.SPEED_THROUGH_WATER_3))
    found = estimate_final(window, SHIP, replace(PARAMETERS, estimator='s1_speed'))
    assert any('speed_through_water_3 is not used beside' in note for note in found.notes)
