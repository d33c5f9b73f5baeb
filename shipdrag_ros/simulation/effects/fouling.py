# SPDX-License-Identifier: Apache-2.0
"""Hull that is rougher than the baseline's."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Said, Scope
from shipdrag_ros.simulation.hydrodynamics import friction_n

_FOULS_S = 2.0 * 365.25 * 86400.0  # until a clean hull is fouled, mostly


def _act(frame: Frame, friction_factor: float) -> Action:
    def resistance(speed: Float64) -> Float64:
        return friction_factor * friction_n(frame.ship, speed)

    return Action(resistance=(resistance,))


EFFECT = Effect(
    name='fouling',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='friction_factor',
            unit='',
            meaning='fraction added to C_F (1 + k)',
            prior=log_normal(0.25, 0.6),
            low=-0.5,
            high=5.0,
        ),
    ),
    formula='0.5 rho S v^2 (1 + k) C_F times friction_factor, C_F of the ITTC-57 line',
    source='ITTC-57; a baseline that is a table has k = 0.2',
    formula_sd=0.05,
    act=_act,
    confounders={
        'locked_propeller': (Measure.SHAFT, Measure.FREE_PROPELLER, Measure.CLEAN_HULL),
        'windmilling_propeller': (Measure.SHAFT, Measure.CLEAN_HULL),
        'towed_cable': (Measure.WITHOUT_CABLE, Measure.CLEAN_HULL),
        'added_mass': (Measure.CLEAN_HULL,),
        'displacement': (Measure.DRAUGHT, Measure.CLEAN_HULL),
    },
    facts={'hull_cleaned': Said(fades_s=_FOULS_S)},
    lasts_s=365.0 * DAY_S,
)
