# SPDX-License-Identifier: Apache-2.0
"""Mean force of a sea from ahead or from astern."""

from __future__ import annotations

from math import pi, sqrt

from shipdrag_ros.parameter import Parameter, Prior, Shape, log_normal
from shipdrag_ros.ship import GRAVITY_M_S2
from shipdrag_ros.simulation import effect
from shipdrag_ros.simulation.action import Action

_LENGTHS = 0.5  # of a wave, in lengths of the ship: shorter ones than those that heave her


def _act(frame: effect.Frame, force_n: float, side: float) -> Action:
    frequency = sqrt(2.0 * pi * GRAVITY_M_S2 / (_LENGTHS * frame.ship.length_m))
    return Action(
        wave_force_n=frame.earth(-side * force_n, 0.0),
        wave_encounter_s_m=frequency / GRAVITY_M_S2,
    )


EFFECT = effect.Effect(
    name='waves',
    scope=effect.Scope.EARTH,
    parameters=(
        Parameter(
            name='force_n',
            unit='N',
            meaning='mean force on the ship at rest; STAWAVE-1 gives '
            '1/16 rho g Hs^2 B sqrt(B/L_BWL)',
            prior=log_normal(2e-4, 0.8),
            low=0.0,
            high=0.02,
            measured_in=effect.WEIGHTS,
        ),
        Parameter(
            name='from',
            unit='',
            meaning='the side of the first run that they come from',
            prior=Prior(Shape.CHOICE, 1.0, -1.0),
            low=-1.0,
            high=1.0,
            value=1.0,
            words={'ahead': 1.0, 'astern': -1.0},
        ),
    ),
    formula='F (1 + omega u cos(angle) / g)^2 against the ship times cos(angle), angle from '
    'ahead: as the square of the frequency of encounter, waves half as long as the ship',
    source='ITTC 7.5-04-01-01.1 STAWAVE-1 for the size; the speed dependence agrees to first '
    'order with Faltinsen et al. (1980), 1 + 2 omega u / g',
    formula_sd=0.3,
    act=_act,
    confounders={
        'fouling': (effect.Measure.RECIPROCAL_RUN,),
        'locked_propeller': (effect.Measure.RECIPROCAL_RUN,),
        'residual_thrust': (effect.Measure.RECIPROCAL_RUN, effect.Measure.SHAFT),
    },
    facts={'no_waves': effect.DENIES, 'calm': effect.DENIES},
)
