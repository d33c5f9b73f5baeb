# SPDX-License-Identifier: Apache-2.0
"""
What coastdowns of a ship without a stated baseline can still show.

A form of the resistance is fitted to the runs themselves. What has that form is
then part of the baseline and cannot be seen: fouling, propellers, cables. A
constant part can, but one run cannot tell whether it is a force or a speed; runs
on other headings tell what turns with the Earth. No single force is ever named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.coast_form import SHAPES, Coast, FormFit, FormProblem
from shipdrag_ros.diagnosis.diagnose import CoastRun
from shipdrag_ros.diagnosis.result import FORCE, Diagnosis, Named, Verdict, Where
from shipdrag_ros.diagnosis.verdict import QUIET, UNNAMED, Posterior, decide
from shipdrag_ros.ship import Ship, Uncertain

_APART_RAD = 0.5  # between headings of runs, from which they tell what turns with the Earth
_NOTHING, _ONE, _UNNAMED = 0.5, 0.42, 0.08  # probabilities before the data
_LACK_NATS = 5.0
_EARTH = ('current', 'waves', 'wind')
_LOG_ALONE = ('log_offset',)


def diagnose_fitted(runs: Sequence[CoastRun], ship: Ship) -> Diagnosis:
    """
    Tell what is missing in a resistance that is fitted to the runs.

    Parameters
    ----------
    runs
        One or more; the speed through water is used, or else over ground.
    ship
        For n_r and the mass; its baseline is not used.

    Raises
    ------
    DiagnosisError
        If a run has too few samples of a speed.
    """
    seen = [Coast.of(run) for run in runs]
    by_log = all(coast.by_log for coast in seen)
    apart = _spread(seen) > _APART_RAD
    problem = FormProblem.learnt(seen)
    nothing, earth = problem.fit(()), problem.fit(('earth',))
    smooth, more = problem.fit(('smooth',)), problem.fit(('earth', 'smooth'))
    fits: dict[tuple[str, ...], FormFit] = {(name,): earth for name in _EARTH}
    if by_log:
        fits[_LOG_ALONE] = problem.fit(('offset',)) if apart else earth
    log = {names: fit.log_evidence + math.log(_ONE / len(fits)) for names, fit in fits.items()}
    log[()] = nothing.log_evidence + math.log(_NOTHING)
    log[UNNAMED] = smooth.log_evidence + math.log(_UNNAMED)
    total = float(logsumexp(list(log.values())))
    posterior = Posterior({}, {names: math.exp(each - total) for names, each in log.items()})
    first = posterior.named()[0]
    best = fits.get(first, nothing)
    alarm = bool(first) and posterior.nothing < QUIET
    lacking = alarm and more.log_evidence > earth.log_evidence + _LACK_NATS
    forces = frozenset(_EARTH) if apart else frozenset((*_EARTH, *_LOG_ALONE))
    verdict, candidates = decide(
        posterior, lacking=lacking and first != _LOG_ALONE, inseparable=[forces]
    )
    named: tuple[Named, ...] = ()
    if verdict is Verdict.NAMED and first == _LOG_ALONE:
        offset = Uncertain(float(best.value[-1]), float(best.sd[-1]))
        named = (Named('log_offset', posterior.probability[first], {'offset_m_s': offset}),)
    missing = verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(first)
    speeds = np.concatenate([coast.speed_m_s for coast in seen])
    return Diagnosis(
        verdict=verdict,
        effects=named,
        candidates=candidates,
        nothing=posterior.nothing,
        unnamed=posterior.unnamed,
        would_decide=declared(candidates) if verdict is Verdict.ONE_OF else (),
        where=None
        if verdict is Verdict.NONE
        else Where(
            'force',
            (
                min(float(coast.time_s[0]) for coast in seen),
                max(float(coast.time_s[-1]) for coast in seen),
            ),
            (float(speeds.min()), float(speeds.max())),
        ),
        before=nothing.gap,
        after=best.gap if missing else None,
        held_out_before=None,
        held_out_after=None,
        baseline='fitted_here',
        best=named,
        notes=tuple(_notes(ship, seen, best if missing else nothing, by_log=by_log)),
        coastdowns_used=len(seen),
        examined=(FORCE,),
    )


def _spread(seen: Sequence[Coast]) -> float:
    """Return how far the headings of runs differ [rad]; 0 where one is not known."""
    turned = np.array([coast.heading_rad - seen[0].heading_rad for coast in seen])
    return float(np.abs(np.angle(np.exp(1j * turned))).max()) if np.isfinite(turned).all() else 0.0


def _notes(ship: Ship, seen: Sequence[Coast], fit: FormFit, *, by_log: bool) -> list[str]:
    a, b = np.exp(fit.value[:2])
    found = [
        f'the ship file has no baseline: -dv/dt = a v + b v^2 with a = {a:.3g} 1/s and '
        f'b = {b:.3g} 1/m is fitted to the {len(seen)} run(s) themselves; what has that form '
        '(fouling, propeller, cable) cannot be seen, and no single force is named',
        'the noise is learnt from the coastdown itself: what changes slowly hides in it',
    ]
    place = 2 + SHAPES + len(seen)
    if len(fit.value) == place + 2:
        force, sd = fit.value[place], fit.sd[place]
        first = float(seen[0].speed_m_s[0])
        mass = ship.mass_kg * (1.0 + float(ship.n_r(np.array([abs(first)]))[0]))
        found.append(
            f'a constant part of {force:.3g} ± {sd:.1g} m/s^2 is there besides: a force of '
            f'{force * mass:.3g} N, or a speed of the water of {force / a:.3g} m/s or less'
        )
    if by_log and len(seen) == 1:
        found.append(
            'current stands in the set for a speed that is imported as through water and was '
            'measured over ground (motion capture, GNSS); a log does not feel one'
        )
    swing = max(coast.swing_rad for coast in seen)
    if swing > 0.2:
        found.append(
            f'the heading swings over {math.degrees(swing):.0f} degrees: the drag of drifting '
            'and turning is part of the fitted form'
        )
    return found
