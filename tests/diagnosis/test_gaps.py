# SPDX-License-Identifier: Apache-2.0
"""A run that is predicted from the others rests on the same posterior as all runs together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.gaps import predicted
from shipdrag_ros.diagnosis.model import start
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, Scenario, sense, simulate, standard_sensors

HEADINGS = (0.7, 0.7 + math.pi)


@pytest.fixture(scope='module')
def model(cargo: Ship) -> CoastModel:
    """Two runs of a ship whose friction is 6 % more than stated, three prior sd."""
    base = cargo.baseline
    assert isinstance(base, CoefficientBaseline)
    rougher = replace(base, form_factor=1.06 * (1.0 + base.form_factor) - 1.0)
    seen = []
    for seed, heading_rad in enumerate(HEADINGS):
        scenario = Scenario(
            speed_m_s=8.0, lead_in_s=1200.0, duration_s=1200.0, heading_rad=heading_rad
        )
        truth = simulate(replace(cargo, baseline=rougher), scenario)
        block = sense(truth, standard_sensors(rate_hz=1.0, inputs=STANDARD_INPUTS), seed=seed)
        first = int(block.stamp_ns.min())
        window = Window.from_block(
            block, first + 1200 * 10**9, int(block.stamp_ns.max()), before_ns=first
        )
        seen.append(Observation.of(window, cargo, Parameters(), name=str(seed)))
    return CoastModel(cargo, tuple(seen), seen[0].heading_rad)


@pytest.mark.parametrize('run', [0, 1])
def test_the_prior_is_counted_once_in_a_held_out_prediction(model: CoastModel, run: int) -> None:
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    found = predicted(model, run, nothing)
    # what the other run teaches, with this run, is what both teach: the prior is in it once
    shared = len(model.nothing.terms[0].unknowns)
    sd = np.sqrt(np.diag(nothing.covariance))[:shared]
    away = (found.z[:shared] - nothing.best.z[:shared]) / sd
    assert abs(nothing.best.z[0]) > 1.0
    assert np.abs(away).max() < 0.05
