# SPDX-License-Identifier: Apache-2.0
"""What a column promises is about what a fit finds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.hypotheses import Library
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.screening import promise
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import parse

SHIP = Ship.load(Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml')


def library_of(*effects: str) -> Library:
    """See a run in which effects are hidden."""
    scenario = Scenario(speed_m_s=8.0, lead_in_s=1200.0, duration_s=1200.0, heading_rad=0.7)
    truth = simulate(SHIP, scenario, effects=[parse(text) for text in effects], reference_rad=0.7)
    block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0, inputs=STANDARD_INPUTS), seed=5)
    first = int(block.stamp_ns.min())
    window = Window.from_block(
        block, first + 1200 * 10**9, int(block.stamp_ns.max()), before_ns=first
    )
    seen = Observation.of(window, SHIP, Parameters(), name='run')
    return Library(SHIP, (seen,), seen.heading_rad)


@pytest.mark.parametrize('hidden', ['current=0.3', 'fouling=0.3', 'turning=25', 'log_lag=20'])
def test_what_is_hidden_promises_most_and_keeps_it(hidden: str) -> None:
    library = library_of(hidden)
    nothing = fit(library.problem, [library.nothing], [library.start(library.nothing)])[0]
    hypotheses = [h for e in library.effects for h in library.with_effect(library.nothing, e)]
    promised = promise(library.problem, nothing, hypotheses)
    order = np.argsort(-promised)
    best = list(dict.fromkeys(hypotheses[i].names for i in order))
    # look-alikes may promise as much
    assert (hidden.partition('=')[0],) in best[:6]
    first = hypotheses[order[0]]
    found = fit(library.problem, [first], [library.start(first, nothing)])[0]
    gained = found.log_evidence - nothing.log_evidence
    assert 0.3 * gained < promised[order[0]] - nothing.log_evidence < 3.0 * gained


def test_where_nothing_is_hidden_nothing_is_promised() -> None:
    library = library_of()
    nothing = fit(library.problem, [library.nothing], [library.start(library.nothing)])[0]
    hypotheses = [h for e in library.effects for h in library.with_effect(library.nothing, e)]
    promised = promise(library.problem, nothing, hypotheses)
    assert np.all(promised < nothing.log_evidence)
