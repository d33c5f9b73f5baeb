# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of r(v) beside other ways to differentiate, on the same simulated records.

    python -m benchmarks.accuracy.accuracy_beside_peers --write    # needs `make peers`

All get the same records, or the first of them where they are slow; no estimator is given the
noise level. Errors are over one range of speeds, evenly: from the true speed at the end of the
record, or Froude number 0.05, to that at the stop; beyond its own ends a curve is held. Peers
differentiate, r = -(1 + n_r) dv/dt with the true n_r. Under gusts the half hour before the stop
is given too. The bound (`_bound`) knows that r = c1 v + .. + c4 v^4; a biased estimator may lie
below it. What is expected of r beforehand was chosen in view of this ship.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy import _peers
from benchmarks.accuracy._bound import bound
from benchmarks.accuracy._coasts import Case, Coast, coasts, rms
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import estimate, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64

PAGE = ROOT / 'docs' / 'results' / 'accuracy_beside_peers.txt'
CASES = (
    Case('white noise'),
    Case('current 0.25 m/s', current_m_s=0.25),
    Case('gusts worth 0.05 m/s', steady=True, gust_m_s=0.05),
)
Found = tuple[Float64, Float64 | None]
"""r and its sigma without the error of n_r, at the speeds of the comparison; None: not stated."""
Call = Callable[[Coast], Found]


def own(method: Callable[..., object], estimator: str, _: Coast) -> Call:
    """
    Wrap an estimator of the package.
    """
    parameters = Parameters(estimator=estimator)

    def call(coast: Coast) -> Found:
        curve = method(coast.window, coast.truth.ship, parameters).curve
        r, sigma = (
            np.interp(coast.speeds, curve.speed_m_s, each)
            for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
        )
        return r, sigma

    return call


def peer(method: Callable[[_peers.Samples], _peers.Motion], _: Coast | None) -> Call:
    """
    Wrap a peer: r = -(1 + n_r) dv/dt, sorted by the speed.
    """

    def call(coast: Coast) -> Found:
        motion = method(_peers.Samples.of(coast.window))
        order = np.argsort(motion.speed_m_s)
        speed = motion.speed_m_s[order]
        inertia = 1.0 + coast.truth.ship.n_r(speed)
        r, sigma = (
            None if each is None else np.interp(coast.speeds, speed, inertia * each[order])
            for each in (-motion.acceleration_m_s2, motion.sd_m_s2)
        )
        assert r is not None
        return r, sigma

    return call


def tuned(by_truth: bool, coast: Coast) -> Call:
    """
    Tune pynumdiff on the first record of the case.
    """
    samples, truth, acceleration = _peers.Samples.of(coast.window), coast.truth, None
    if by_truth:
        slope = np.gradient(truth.speed_through_water_m_s, truth.time_s)
        time_s = truth.scenario.lead_in_s + samples.time_s
        acceleration = np.interp(time_s, truth.time_s, slope)
    return peer(_peers.TunedByPynumdiff.on(samples, acceleration), None)


# records at most, and from the first record of a case to the call
ESTIMATORS: dict[str, tuple[int, Callable[[Coast], Call]]] = {
    '**ours, final**': (10_000, partial(own, estimate_final, 'one')),
    '**ours, live**': (10_000, partial(own, estimate, 'one')),
    'S1 joint': (10_000, partial(own, estimate, 's1_joint')),
    'S1 speed': (10_000, partial(own, estimate, 's1_speed')),
    'S1 position': (10_000, partial(own, estimate, 's1_position')),
    'Chebyshev, BIC (numpy)': (10_000, partial(peer, _peers.chebyshev)),
    'Savitzky-Golay, CV (scipy)': (50, partial(peer, _peers.savitzky_golay)),
    'smoothing spline, GCV (scipy)': (6, partial(peer, _peers.smoothing_spline)),
    'Kalman RTS, ML (statsmodels)': (10, partial(peer, _peers.kalman_rts)),
    'Matern 5/2 process (scikit-learn)': (6, partial(peer, _peers.gaussian_process)),
    'pynumdiff, tuned by itself': (10_000, partial(tuned, False)),
    'pynumdiff, tuned to the truth': (10_000, partial(tuned, True)),
}


def cell(of_r: Float64, covered: list[np.ndarray], failed: int) -> str:
    """
    Show errors, a row a record, in parts of the largest r.
    """
    cover = f'{100.0 * np.mean(covered):.0f}' if covered else '-'
    text = f'{100.0 * rms(of_r):.2f} / {100.0 * rms(of_r[:, -1]):.1f} / {cover}'
    return f'{text}, {failed} failed' if failed else text


def cells(case: Case, runs: int) -> list[str]:
    """
    Return what each estimator, and the bound, have in a case.
    """
    records, found = list(coasts(case, runs)), []
    largest = float(records[0].resists(np.array([case.hull.speed_m_s]))[0])
    for most, train in ESTIMATORS.values():
        call, of_r, covered, failed = train(records[0]), [], [], 0
        for coast in records[:most]:
            try:
                r, sigma = call(coast)
            except (EstimationError, ValueError, np.linalg.LinAlgError):
                failed += 1
                continue
            error = r - coast.resists(coast.speeds)
            of_r.append(error / largest)
            if sigma is not None:
                covered.append(np.abs(error) <= 2.0 * sigma)
        found.append(cell(np.array(of_r), covered, failed) if of_r else f'{failed} failed')
    return [*found, cell(bound(case)[None, :] / largest, [], 0)]


def main() -> None:
    """
    Print the table.
    """
    options = asked(__doc__, runs=200, write=False)
    columns = [[*ESTIMATORS, 'Cramer-Rao bound'], *(cells(case, options.runs) for case in CASES)]
    heads = ['RMSE / at the top / cover', *(case.name for case in CASES)]
    text = '\n'.join(table(heads, zip(*columns, strict=True)))
    print(text)
    if options.write:
        put(PAGE, {'beside peers': text})


if __name__ == '__main__':
    main()
