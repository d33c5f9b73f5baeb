# SPDX-License-Identifier: Apache-2.0
"""The one posterior names what is hidden, with sizes and limits, and knows what is stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.diagnose import compare
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.estimation import Window
from shipdrag_ros.inference.decision import NONE
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import LIBRARY, parse

SHIP = Ship.load(Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml')
LEAD_S, COAST_S = 1200, 1200


@cache
def window_of(effects: tuple[str, ...], heading_rad: float = 0.7, seed: int = 5) -> Window:
    """Return a run in which effects are hidden."""
    scenario = Scenario(
        speed_m_s=8.0, lead_in_s=LEAD_S, duration_s=COAST_S, heading_rad=heading_rad
    )
    truth = simulate(SHIP, scenario, effects=[parse(each) for each in effects], reference_rad=0.7)
    sensors = standard_sensors(rate_hz=1.0, noise=1.0, inputs=STANDARD_INPUTS)
    block = sense(truth, sensors, seed=seed)
    first = int(block.stamp_ns.min())
    stop = first + LEAD_S * 10**9
    return Window.from_block(block, stop, int(block.stamp_ns.max()), before_ns=first)


@cache
def answer(*effects: str, ship: Ship = SHIP, facts: tuple[Fact, ...] = ()) -> DiagnosisResult:
    """Diagnose one run, once."""
    run = CoastRun('first', window_of(effects))
    return diagnose([run], ship, Parameters(), facts=facts)


@pytest.mark.parametrize(
    ('text', 'parameter', 'size'),
    [
        ('log_scale=0.1', 'factor', 0.1),
        ('current=0.5', 'along_track_m_s', 0.5),
        ('log_lag=25', 'lag_s', 25.0),
        # at the best of nothing, the filter of the log stands for it
        ('time_offset=30', 'offset_s', 30.0),
    ],
)
def test_what_is_hidden_is_named_with_its_size(text: str, parameter: str, size: float) -> None:
    found = answer(text)
    name = text.partition('=')[0]
    assert [effect.name for effect in found.effects] == [name]
    known = found.effects[0].parameters[parameter]
    assert abs(known.value - size) < 4.0 * known.sd
    assert found.after is not None
    assert found.after.chi2_per_sample < found.before.chi2_per_sample


def test_without_anything_hidden_nothing_is_most_probable() -> None:
    found = answer()
    assert found.effects == ()
    assert found.candidates[0].names == NONE
    assert found.nothing > 0.75
    assert sum(each.probability for each in found.candidates) <= 1.0 + 1e-9
    # sizes that this run would have shown are excluded, and it says which
    for name in ('log_scale', 'current', 'wind', 'fouling'):
        limit = found.limits[name]
        assert 0.0 < limit.value < np.inf
    assert found.limits['log_scale'].value < 0.08  # half of what is usual where it is there


def test_a_limit_grows_where_the_run_shows_less() -> None:
    whole = answer().limits['wind'].value
    window = window_of(())
    end = window.start_ns + (COAST_S // 4) * 10**9
    short = replace(
        window,
        **{
            name: replace(
                series, **{k: getattr(series, k)[series.time_ns < end] for k in vars(series)}
            )
            for name in ('speed_through_water', 'position', 'speed_over_ground')
            if len((series := getattr(window, name)).time_ns)
        },
    )
    found = diagnose([CoastRun('short', short)], SHIP, Parameters())
    assert found.limits['wind'].value > 1.1 * whole


def test_an_effect_that_the_ship_file_states_is_not_missing() -> None:
    hidden = ('wind=14',)
    stated = replace(SHIP, effects=(parse('wind=14'),))
    found = answer(*hidden, ship=stated)
    assert 'wind' not in {name for each in found.candidates[:1] for name in each.names}
    assert found.nothing > 10.0 * answer(*hidden).nothing


def test_a_fact_speaks_against_an_effect() -> None:
    without = answer('wind=5')
    calm = answer('wind=5', facts=(Fact('calm', ''),))

    def of_wind(found: DiagnosisResult) -> float:
        return sum(each.probability for each in found.candidates if 'wind' in each.names)

    assert of_wind(calm) < 0.7 * of_wind(without)
    assert [each.fact.name for each in calm.facts] == ['calm']


def test_two_look_alikes_are_a_set_that_holds_the_truth() -> None:
    found = answer('wind=14')
    assert found.candidates[0].names == ('wind',)
    assert {each.names for each in found.held} <= {('wind',), ('waves',)}


def test_two_runs_share_what_belongs_to_both() -> None:
    runs = [
        CoastRun('out', window_of(('current=0.3',))),
        CoastRun('back', window_of(('current=0.3',), 0.7 + np.pi, 6)),
    ]
    found = diagnose(runs, SHIP, Parameters())
    assert [effect.name for effect in found.effects] == ['current']
    alone = diagnose(runs[:1], SHIP, Parameters())
    both = found.effects[0].parameters['along_track_m_s']
    one = next(e for c in alone.candidates for e in c.effects if e.name == 'current')
    assert both.sd < one.parameters['along_track_m_s'].sd


def test_the_answer_is_the_same_to_the_bit() -> None:
    one, other = answer('wind=14'), answer.__wrapped__('wind=14')
    assert one.candidates == other.candidates
    assert one.limits == other.limits


def test_probabilities_are_those_of_evidence_and_odds() -> None:
    seen = Observation.of(window_of(('wind=14',)), SHIP, Parameters(), name='run')
    found = compare((seen,), SHIP, Facts(SHIP)).compare()
    assert sum(found.probability.values()) == pytest.approx(1.0)
    names = {each.names for each in found.fitted}
    assert {(name,) for name, effect in LIBRARY.items() if not effect.missing(SHIP)} <= names
