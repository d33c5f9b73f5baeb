# SPDX-License-Identifier: Apache-2.0
"""Tables of a result as text, the same in the terminal and on the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import Coastdown, NotCoastdown
from shipdrag_ros.display import Table
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.replay import InputCounts, words
from shipdrag_ros.replay.hulls import Ranking
from shipdrag_ros.replay.truth import TrueCurve

_UNITS = {'speed_through_water': 'm/s', 'speed_over_ground': 'm/s', 'position': 'm'}


def curve_table(
    curve: ResistanceCurve, *, count: int = 10, truth: TrueCurve | None = None
) -> Table:
    """
    Show about `count` points of a curve, evenly over its speeds.

    The points are the estimated ones; only the truth is interpolated, and its
    two columns are there only if it is known.
    """
    columns: tuple[str, ...] = ('speed [m/s]', '[knots]', 'Fr', 'r [m/s²]', 'sigma [m/s²]')
    if truth is not None:
        columns = (*columns, 'true r [m/s²]', 'error [%]')
    if not len(curve):
        return Table(columns, ())
    wanted = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], count)
    chosen = np.unique(np.abs(curve.speed_m_s[:, None] - wanted).argmin(axis=0))
    # as many decimals in every row as the best of them deserves
    least = float(np.min(curve.sigma_m_s2[chosen]))
    decimals = max(display.decimals_of(least), 0) if least > 0.0 else 6
    highest = float(curve.speed_m_s[-1])
    rows = []
    for i in chosen:
        speed, r = float(curve.speed_m_s[i]), float(curve.resistance_m_s2[i])
        cells: tuple[str, ...] = (
            display.speed_text(speed, highest_m_s=highest),
            display.speed_text(speed / display.M_S_PER_KNOT, highest_m_s=highest)[:-1],
            f'{curve.froude[i]:.3f}',
            f'{r:.{decimals}f}',
            f'{curve.sigma_m_s2[i]:.{decimals}f}',
        )
        if truth is not None:
            true = float(truth.at(curve.speed_m_s[i]))
            known = np.isfinite(true)  # the truth of a simulation ends at its highest speed
            cells = (
                *cells,
                f'{true:.{decimals}f}' if known else '-',
                f'{100.0 * (r / true - 1.0):+.1f}' if known else '-',
            )
        rows.append(cells)
    return Table(columns, tuple(rows))


def facts(coastdown: Coastdown) -> Table:
    """
    Show how a coastdown was found and what its estimate rests on.
    """
    seconds = (coastdown.end_ns - coastdown.start_ns) * 1e-9
    rows = [
        ('start', display.utc(coastdown.start_ns)),
        ('duration', display.duration(seconds)),
        ('ended because', words.ENDED_BY[coastdown.ended_by]),
    ]
    if coastdown.onset_detected_ns is not None:
        # from where it seemed to begin, which may have been cut since
        first_ns = min([coastdown.start_ns, *(cut.start_ns for cut in coastdown.cuts)])
        delay = (coastdown.onset_detected_ns - first_ns) * 1e-9
        rows.append(('confirmed after', display.duration(delay)))
    if coastdown.estimate is not None:
        rows.extend(_estimate_facts(coastdown.estimate))
    return Table(('', ''), tuple(rows))


def _estimate_facts(estimate: Estimate) -> list[tuple[str, str]]:
    low, high = estimate.froude_valid
    rows = [
        ('estimator', words.estimator(estimate.estimator)),
        (
            'coefficients',
            'averaged over models' if estimate.order is None else f'{estimate.order}',
        ),
        ('samples used', ', '.join(f'{n} {name}' for name, n in estimate.samples.items())),
        (
            'noise found',
            ', '.join(
                f'{sd:.3g} {_UNITS.get(name, "")} {name}' for name, sd in estimate.noise_sd.items()
            ),
        ),
        ('valid range', f'Fr {low:.3f} to {high:.3f}'),
        ('upper end is', words.FROUDE_MAX_BY[estimate.froude_max_by]),
        ('argmax dr/dFr, as S1 has it', f'Fr {estimate.froude_max_argmax:.3f}'),
        ('largest sigma / largest r', f'{100.0 * estimate.max_relative_sigma:.2g} %'),
    ]
    if estimate.current_m_s is not None:
        sd = float('nan') if estimate.current_sigma_m_s is None else estimate.current_sigma_m_s
        current = display.plus_minus(estimate.current_m_s, 2.0 * sd)
        rows.append(('current along the track', f'{current} m/s (two standard deviations)'))
    return rows


def inputs_table(inputs: Mapping[str, InputCounts]) -> Table:
    """
    Show the messages of each input and why some were not used.
    """
    return Table(
        ('input', 'messages', 'used', 'rejected'),
        tuple(
            (
                name,
                f'{counts.messages}',
                f'{counts.used}',
                ', '.join(f'{n} {reason}' for reason, n in counts.rejected.items() if n) or '-',
            )
            for name, counts in inputs.items()
        ),
    )


def not_coastdowns_table(dismissed: Sequence[NotCoastdown]) -> Table:
    """
    Show what was nearly a coastdown, or was cut, and why.
    """
    return Table(
        ('from', 'for', 'reason', 'why'),
        tuple(
            (
                display.utc(one.start_ns),
                display.duration(max(one.end_ns - one.start_ns, 0) * 1e-9),
                one.reason.value,
                one.text,
            )
            for one in dismissed
        ),
    )


def combined_table(combined: Combined, *, count: int = 10) -> Table:
    """
    Show about `count` points of the r(v) of several coastdowns.
    """
    decimals = max(display.decimals_of(float(np.min(combined.sigma_m_s2))), 0)
    rows = []
    for i in np.linspace(0, len(combined.speed_m_s) - 1, count).round().astype(int):
        speed = float(combined.speed_m_s[i])
        figures = (combined.resistance_m_s2, combined.sigma_m_s2, combined.scatter_m_s2)
        rows.append(
            (
                f'{speed:.2f}',
                f'{speed / display.M_S_PER_KNOT:.1f}',
                f'{combined.froude[i]:.3f}',
                *(f'{column[i]:.{decimals}f}' for column in figures),
            )
        )
    heads = ('speed [m/s]', '[knots]', 'Fr', 'r [m/s²]', 'sigma [m/s²]', 'run to run [m/s²]')
    return Table(heads, tuple(rows))


def ranking_table(ranking: Ranking) -> Table:
    """
    Show hulls by Fr_max, the best first.
    """
    rows = []
    for place, hull in enumerate(ranking.hulls, start=1):
        bound = hull.found_by is FroudeMax.BRANCH_TOP
        rows.append(
            (
                f'{place}. {hull.label}',
                f'{"at least " if bound else ""}{hull.froude_max:.3f}',
                ', '.join(f'{other:.3f}' for other in hull.others) or '-',
                words.FROUDE_MAX_BY[hull.found_by],
            )
        )
    return Table(('hull', 'Fr_max', 'other coastdowns', 'found as'), tuple(rows))
