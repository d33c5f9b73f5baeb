# SPDX-License-Identifier: Apache-2.0
"""Propeller that does not turn while the ship coasts."""

from __future__ import annotations

from math import inf

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Said, Scope
from shipdrag_ros.simulation.hydrodynamics import disc_area_m2, drag_n


def _act(frame: Frame, drag_coefficient: float) -> Action:
    area = drag_coefficient * disc_area_m2(frame.ship)

    def resistance(speed: Float64) -> Float64:
        return drag_n(frame.ship, area, speed)

    return Action(resistance=(resistance,), stall_m_s=inf)


EFFECT = Effect(
    name='locked_propeller',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='drag_coefficient',
            unit='',
            meaning='on disc area and ship speed, on top of what the baseline holds; 0.65 on the '
            'speed at a propeller behind a wake is 0.2..0.8 on ship speed',
            prior=log_normal(0.42, 0.4),
            low=0.0,
            high=3.0,
        ),
    ),
    formula='0.5 rho (pi/4) D^2 C v^2',
    source='four-quadrant open-water data of B4-70 at rest',
    formula_sd=0.1,
    act=_act,
    struck_out_by=('shaft',),
    confounders={
        'towed_cable': (Measure.WITHOUT_CABLE, Measure.SHAFT),
        'windmilling_propeller': (Measure.SHAFT,),
        'added_mass': (Measure.SHAFT,),
        'displacement': (Measure.DRAUGHT, Measure.SHAFT),
    },
    needs=('propeller',),
    facts={'shaft': Said(('locked',))},
    lasts_s=90.0 * DAY_S,
)
