# SPDX-License-Identifier: Apache-2.0
"""
Sensor effects and current from any sailing, without a coastdown.

The log is held against the way made good over ground, on many courses and at
many speeds. No baseline is needed, and no force can be told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.legs import Direction, Legs, SailingRecord, told
from shipdrag_ros.diagnosis.prior import UNNAMED_ODDS, nothing_missing
from shipdrag_ros.diagnosis.result import LOG_TRACK, Diagnosis, Gap, Named, Verdict, Where
from shipdrag_ros.diagnosis.sailing_model import SMOOTH, LegFit, LegModel
from shipdrag_ros.diagnosis.verdict import QUIET, UNNAMED, Posterior, decide, prune_by_bayes_factor
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Int64
from shipdrag_ros.ship import Uncertain
from shipdrag_ros.simulation.effects import find

_NAMES = ('current', 'log_offset', 'log_scale', 'radar_scale')
_SCALES = frozenset(('log_scale', 'radar_scale'))
_SET_APART = frozenset(('current', 'log_offset'))
_BENT = ('log_offset', 'log_scale', SMOOTH)
_LACK_NATS = 5.0  # of evidence that something smooth besides must gain
_LACK_SD, _LACK_SLACK = 4.0, 0.2  # of chi^2 a leg above 1
_OUTLIER = 5.0  # whitened
_TRACE = {
    'current': 'a current turns with the course',
    'log_offset': 'an offset is the same at all speeds',
    'log_scale': 'a scale grows with the speed, on every course',
    'radar_scale': 'a scale grows with the speed, on every course',
}
_QUARTERS = ('east', 'north', 'west', 'south')


def diagnose_sailing(
    records: Sequence[SailingRecord],
    parameters: Parameters,
    *,
    no_coastdown: str = 'No coastdown is used.',
) -> Diagnosis:
    """
    Name what is wrong between log and the way over ground.

    Parameters
    ----------
    records
        One or more, of the same ship; a current is stated along the first leg.
    parameters
        For the convention of the heading.
    no_coastdown
        For the reader: that there is no coastdown, and why.

    Raises
    ------
    DiagnosisError
        If there is no log, nothing over ground, or too little even sailing.
    """
    legs = Legs.of(records, parameters)
    model = LegModel.learnt(legs)
    keep, cut = _without_outliers(model)
    if len(cut):
        legs = legs[keep]
        model = LegModel.learnt(legs)
    names = [name for name in _NAMES if not (legs.geodetic and name == 'radar_scale')]
    pairs = [pair for pair in combinations(names, 2) if set(pair) != _SCALES]
    hypotheses = [(), *((name,) for name in names), *pairs]
    fits = {each: model.fit(each) for each in (*hypotheses, _BENT)}
    posterior = Posterior({}, _probabilities(fits, names))
    best = fits[posterior.named()[0]]
    inseparable = [_SCALES] if 'radar_scale' in names else []
    if legs.direction is Direction.UNKNOWN:
        inseparable.append(_SET_APART)
    more = model.fit((*best.names, SMOOTH))
    lacking = posterior.nothing < QUIET and _lacks(best, more)
    verdict, candidates = decide(posterior, lacking=lacking, inseparable=inseparable)
    missing = verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(best.names)
    found = _named(best, posterior.probability[best.names])
    return Diagnosis(
        verdict=verdict,
        effects=found if verdict is Verdict.NAMED else (),
        candidates=candidates,
        nothing=posterior.nothing,
        unnamed=posterior.unnamed,
        would_decide=declared(candidates) if verdict is Verdict.ONE_OF else (),
        where=None if verdict is Verdict.NONE else _where(legs, best),
        before=_gap(fits[()]),
        after=_gap(best) if missing else None,
        held_out_before=None,
        held_out_after=None,
        baseline='none',
        best=found,
        notes=(
            *_about(legs, len(cut)),
            *(_why(legs, fits, best) if missing else ()),
        ),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )


def _without_outliers(model: LegModel) -> tuple[Int64, Int64]:
    """Return the legs to keep, and those that no effect and no noise explains."""
    white = model.fit(('current', 'log_offset', 'log_scale')).white
    out = np.abs(white) > _OUTLIER
    return np.flatnonzero(~out), np.flatnonzero(out)


def _probabilities(
    fits: dict[tuple[str, ...], LegFit], names: Sequence[str]
) -> dict[tuple[str, ...], float]:
    """Return the probability of each hypothesis."""
    nothing = math.log(nothing_missing([find(name) for name in names], places=1))
    log_odds: dict[tuple[str, ...], float] = {UNNAMED: math.log(UNNAMED_ODDS)}
    for each in fits:
        if each != _BENT:
            log_odds[each] = sum(math.log(find(name).odds) for name in each)
    log = {
        each: fits[_BENT if each == UNNAMED else each].log_evidence + nothing + odds
        for each, odds in log_odds.items()
    }
    return prune_by_bayes_factor(log, log_odds)


def _lacks(best: LegFit, more: LegFit) -> bool:
    """Tell whether a hypothesis leaves more than noise."""
    allowed = 1.0 + _LACK_SD * math.sqrt(2.0 / len(best.white)) + _LACK_SLACK
    return best.chi2_per_leg > allowed or more.log_evidence > best.log_evidence + _LACK_NATS


def _named(fit: LegFit, probability: float) -> tuple[Named, ...]:
    sizes = iter(zip(fit.value.tolist(), fit.sd.tolist(), strict=True))
    return tuple(
        Named(
            name,
            probability,
            {quantity.name: Uncertain(*next(sizes)) for quantity in find(name).parameters},
        )
        for name in fit.names
    )


def _gap(fit: LegFit) -> Gap:
    return Gap(float(np.sqrt(np.mean(fit.residual**2))), None, fit.chi2_per_leg)


def _where(legs: Legs, best: LegFit) -> Where:
    """Return where log and ground disagree; which is wrong is known only of a name."""
    of_log = legs.geodetic and 'current' not in best.names and bool(best.names)
    half = 0.5 * legs.length_s
    return Where(
        'log' if of_log else 'log_radar',
        (float(legs.time_s.min()) - half, float(legs.time_s.max()) + half),
        (float(legs.log_m_s.min()), float(legs.log_m_s.max())),
    )


def _about(legs: Legs, outliers: int) -> list[str]:
    """Tell what was used."""
    found = [
        f'log and way over ground are compared on {len(legs)} legs of {legs.length_s:.0f} s, '
        f'whose direction is by {legs.direction}; left out: '
        f'{told(legs.left_out)}' + (f', outlier {outliers}' if outliers else '')
    ]
    if legs.direction is Direction.UNKNOWN:
        found.append(
            'without position and heading the courses are not known: a current and an offset '
            'of the log look alike'
        )
    if legs.geodetic:
        found.append(
            'the positions are latitude and longitude, whose scale is that of the Earth: '
            'radar_scale is ruled out'
        )
    return found


def _why(legs: Legs, fits: dict[tuple[str, ...], LegFit], best: LegFit) -> list[str]:
    """Tell why it is this and none of the others."""
    found = [f'log over ground: {_by_speed(legs)}']
    if legs.direction is not Direction.UNKNOWN:
        found.append(f'log over ground by course: {_by_course(legs)}')
    what = ' and '.join(best.names)
    for name in ('current', 'log_offset', 'log_scale'):
        alike = name in best.names or (name in _SCALES and _SCALES & set(best.names))
        if not alike:
            found.append(
                f'why not {name}: {_TRACE[name]}; alone it leaves chi2 '
                f'{fits[(name,)].chi2_per_leg:.2f} a leg, {what} {best.chi2_per_leg:.2f}, and '
                f'is less probable by {best.log_evidence - fits[(name,)].log_evidence:.0f} nats'
            )
    return found


def _by_course(legs: Legs) -> str:
    quarter = np.round(legs.direction_rad / (0.5 * math.pi)).astype(int) % 4
    return ', '.join(
        f'{name} {_ratio(legs, quarter == k)}'
        for k, name in enumerate(_QUARTERS)
        if (quarter == k).any()
    )


def _by_speed(legs: Legs) -> str:
    low, high = np.quantile(legs.ground_m_s, (1.0 / 3.0, 2.0 / 3.0))
    slow, fast = legs.ground_m_s <= low, legs.ground_m_s >= high
    return (
        f'{_ratio(legs, slow)} up to {low:.1f} m/s, {_ratio(legs, fast)} from {high:.1f} m/s, '
        f'{_ratio(legs, slow | True)} in all'
    )


def _ratio(legs: Legs, part: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> str:
    ratio = float(legs.log_m_s[part].sum() / legs.ground_m_s[part].sum())
    return f'{ratio:.3f} ({np.count_nonzero(part)} legs)'
