# SPDX-License-Identifier: Apache-2.0
"""Cable towed along the flow."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import AREAS, DAY_S, DENIES, Effect, Frame, Measure, Scope
from shipdrag_ros.simulation.hydrodynamics import ROPES, QuadraticDrag


def _act(frame: Frame, drag_area_m2: float) -> Action:
    drag = QuadraticDrag(drag_area_m2, frame.ship.water.density_kg_m3)
    return Action(resistance=(drag.force_n,))


EFFECT = Effect(
    name='towed_cable',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='drag_area_m2',
            unit='m^2',
            meaning='C0 l d of length and diameter (`shipdrag cable`); '
            f'C0 = {ROPES[0]:g}..{ROPES[1]:g} for ropes',
            prior=log_normal(2e-3, 0.8),
            low=0.0,
            high=0.5,
            measured_in=AREAS,
        ),
    ),
    formula='0.5 rho C0 l d v^2',
    source='S2: R0 in the self-similar region',
    formula_sd=0.05,
    act=_act,
    confounders={
        'added_mass': (Measure.WITHOUT_CABLE,),
        'displacement': (Measure.DRAUGHT, Measure.WITHOUT_CABLE),
    },
    facts={'no_towed_cable': DENIES},
    lasts_s=7.0 * DAY_S,
)
