# SPDX-License-Identifier: Apache-2.0
"""Propeller that the flow turns, until it stalls."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, SPEEDS, Effect, Frame, Measure, Said, Scope
from shipdrag_ros.simulation.hydrodynamics import disc_area_m2, drag_n

_LOCKED = 0.42  # 0.65 on the speed behind a wake of 0.2
_WIDTH = 0.03  # of the stall speed; a step would be met at one sample only


def _act(frame: Frame, drag_coefficient: float, stall_speed_m_s: float) -> Action:
    disc = disc_area_m2(frame.ship)

    def resistance(speed: Float64) -> Float64:
        from scipy.special import expit  # takes long to import

        stalled = expit((stall_speed_m_s - speed) / (_WIDTH * stall_speed_m_s))
        area = disc * (drag_coefficient + (_LOCKED - drag_coefficient) * stalled)
        force: Float64 = drag_n(frame.ship, 1.0, speed) * area
        return force

    return Action(resistance=(resistance,), stall_m_s=stall_speed_m_s)


EFFECT = Effect(
    name='windmilling_propeller',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='drag_coefficient',
            unit='',
            meaning='while it turns, on disc area and ship speed, on top of what the baseline '
            'holds',
            prior=log_normal(0.1, 0.5),
            low=0.0,
            high=3.0,
        ),
        Parameter(
            name='stall_speed_m_s',
            unit='m/s',
            meaning='speed through water below which it stands still',
            prior=log_normal(0.08, 0.4),
            low=1e-4,
            high=1.0,
            value=0.08,
            measured_in=SPEEDS,
        ),
    ),
    formula='0.5 rho (pi/4) D^2 C v^2, C = drag_coefficient above the stall, 0.42 (locked) below '
    'it, the step 3 % of the stall speed wide; until then the shaft turns at 0.7 of the speed '
    'that drives the ship as fast',
    source='four-quadrant open-water data of B4-70: 0.03 turning freely, 0.65 locked, on the '
    'speed at the propeller',
    # a propeller does one thing at a time
    not_with=('locked_propeller',),
    formula_sd=0.2,
    act=_act,
    struck_out_by=('shaft',),
    confounders={'towed_cable': (Measure.WITHOUT_CABLE, Measure.SHAFT)},
    needs=('propeller',),
    facts={'shaft': Said(('free',))},
    lasts_s=90.0 * DAY_S,
)
