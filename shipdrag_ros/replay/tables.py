# SPDX-License-Identifier: Apache-2.0
"""A result as tables, the same in the terminal and on the page; its curves as CSV; as JSON."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import EndedCoastdown, InputCounts, NotCoastdown
from shipdrag_ros.display import Table, spreadsheet_text
from shipdrag_ros.estimation.force import Force, usual_speed_m_s
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.estimation.words import FROUDE_MAX_BY, facts_table
from shipdrag_ros.replay import Recorded, words
from shipdrag_ros.replay.run_result import Ranking, RunResult, together

COLUMNS = ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2', 'froude')
OF_CONDITIONS = ('resistance_m_s2', 'sigma_m_s2')
"""Columns that stand once more behind these, of the run's conditions."""


def facts(coastdown: EndedCoastdown) -> Table:
    """
    Show how a coastdown was found and what its estimate rests on.
    """
    seconds = (coastdown.end_ns - coastdown.start_ns) * 1e-9
    rows: list[tuple[str, ...]] = [
        ('start', display.utc(coastdown.start_ns)),
        ('duration', display.duration(seconds)),
        ('ended because', words.ended(coastdown)),
    ]
    if coastdown.onset_detected_ns is not None:
        # from where it seemed to begin, which may have been cut since
        first_ns = min([coastdown.start_ns, *(cut.start_ns for cut in coastdown.cuts)])
        delay = (coastdown.onset_detected_ns - first_ns) * 1e-9
        rows.append(('confirmed after', display.duration(delay)))
    if coastdown.regimes is not None:
        rows.append(('the model explains the record', words.explained(coastdown.regimes)))
    if coastdown.estimate is not None:
        rows.extend(facts_table(coastdown.estimate).rows)
    return Table(('', ''), tuple(rows))


def coastdowns_table(runs: Sequence[RunResult]) -> Table:
    """
    Show all coastdowns, a line each, at one speed as far as each is known there.
    """
    speed = common_speed_m_s(runs)
    rows = []
    for run in runs:
        for coastdown in run.coastdowns:
            cells = ('-', '-', '-', '-')
            if coastdown.estimate is not None and len(coastdown.estimate.valid_curve):
                force = Force.of(coastdown.estimate.valid_curve, run.ship)
                cells = force.cells(force.near(speed))
            rows.append(
                (
                    display.utc(coastdown.start_ns),
                    run.bag,
                    *(cell or '-' for cell in cells),
                    coastdown.failure or coastdown.why,
                )
            )
    heads = ('start', 'bag', 'at', 'resistance', 'effective power', 'clean hull', 'ended because')
    return Table(heads, tuple(rows))


def common_speed_m_s(runs: Sequence[RunResult]) -> float:
    """
    Return the speed at which coastdowns are compared; 0 where none gave an estimate.
    """
    found = [part.estimate for run in runs for part in run.coastdowns if part.estimate is not None]
    return usual_speed_m_s(found, runs[0].ship) if found else 0.0


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
                FROUDE_MAX_BY[hull.found_by],
            )
        )
    return Table(('hull', 'Fr_max', 'other coastdowns', 'found as'), tuple(rows))


def write_curves(path: Path, runs: Sequence[RunResult]) -> None:
    """
    Write every r(v) inside its valid range, one row a speed.

    The first columns show the bag and the number of the coastdown in it.
    """
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        behind = [f'conditions_{name}' for name in OF_CONDITIONS]
        writer.writerow(('bag', 'coastdown', *COLUMNS, *behind))
        for run in runs:
            for number, coastdown in enumerate(run.coastdowns, start=1):
                if coastdown.estimate is None:
                    continue
                calm = coastdown.estimate.valid_calm
                conditions = coastdown.estimate.valid_conditions
                columns = [getattr(calm, name).tolist() for name in COLUMNS]
                columns += [getattr(conditions, name).tolist() for name in OF_CONDITIONS]
                for values in zip(*columns):
                    writer.writerow((spreadsheet_text(run.bag), number, *values))


def document(runs: Sequence[RunResult], *, ranking: Ranking | None = None) -> dict[str, Any]:
    """
    Return the document of one or several bags.

    Counts are summed over the bags. A coastdown without an estimate has
    empty arrays and says why under `failure`; `hulls` is there only if they
    were compared. `combined` is one r(v) from two or more coastdowns of one
    ship: `scatter_m_s2` is the standard deviation of one run about it, null at speeds
    that one alone reaches, the current is along the heading of the first run; where it is
    null although there are several, `not_combined` says why. `regimes` of a coastdown
    counts s from its start.
    """
    whole = together(runs)
    found = {
        'coastdowns': [
            coastdown_document(run.bag, coastdown) for run in runs for coastdown in run.coastdowns
        ],
        'not_coastdowns': [
            _not_coastdown(run.bag, dismissed) for run in runs for dismissed in run.not_coastdowns
        ],
        'combined': _combined(whole.combined),
        'not_combined': whole.why_not or None,
        'inputs': _inputs([run.inputs for run in runs]),
        'recorded': _recorded(runs),
        'warnings': [
            {'bag': run.bag, 'warning': warning} for run in runs for warning in run.warnings
        ],
    }
    if ranking is not None:
        found['hulls'] = [
            {
                'name': hull.label,
                'froude_max': hull.froude_max,
                'froude_max_by': hull.found_by.value,
                'others': hull.others,
            }
            for hull in ranking.hulls
        ]
    return found


def _combined(combined: Combined | None) -> dict[str, Any] | None:
    if combined is None:
        return None
    return {
        'runs': combined.runs,
        **{name: getattr(combined, name) for name in COLUMNS},
        'scatter_m_s2': combined.scatter_m_s2,
        'froude_valid': (float(combined.froude[0]), float(combined.froude[-1])),
        'current_m_s': _current(combined),
    }


def _current(found: Combined | Estimate) -> dict[str, Any] | None:
    if found.current_m_s is None:
        return None
    return {'value': found.current_m_s, 'sd': found.current_sigma_m_s}


def coastdown_document(bag: str, coastdown: EndedCoastdown) -> dict[str, Any]:
    """
    Return what the document has of one coastdown.
    """
    return {
        'bag': bag,
        'start_ns': coastdown.start_ns,
        'end_ns': coastdown.end_ns,
        'onset_detected_ns': coastdown.onset_detected_ns,
        'ended_by': coastdown.ended_by.value,
        'failure': coastdown.failure,
        **_estimate(coastdown.estimate),
        'regimes': _regimes(coastdown),
        'explained': None if coastdown.regimes is None else coastdown.regimes.explained,
    }


def _estimate(estimate: Estimate | None) -> dict[str, Any]:
    if estimate is None:
        conditions_too = (f'conditions_{name}' for name in OF_CONDITIONS)
        return {
            **dict.fromkeys(('estimator', 'order', 'reference', 'froude_valid', 'froude_max_by')),
            **dict.fromkeys(('froude_max_argmax', 'w', 'current_m_s')),
            **{name: [] for name in (*COLUMNS, *conditions_too, 'notes')},
            **{name: {} for name in ('samples', 'sigma_parts', 'noise_sd')},
        }
    calm, conditions = estimate.valid_calm, estimate.valid_conditions
    low, high = estimate.froude_valid
    inside = (estimate.calm.froude >= low) & (estimate.calm.froude <= high)
    return {
        'estimator': estimate.estimator,
        'order': estimate.order,
        'samples': estimate.samples,
        **{name: getattr(calm, name) for name in COLUMNS},
        **{f'conditions_{name}': getattr(conditions, name) for name in OF_CONDITIONS},
        'reference': {name: how.value for name, how in vars(estimate.reference).items()},
        'sigma_parts': {name: part[inside] for name, part in estimate.sigma_parts.items()},
        'froude_valid': estimate.froude_valid,
        'froude_max_by': estimate.froude_max_by.value,
        'froude_max_argmax': estimate.froude_max_argmax,
        'w': estimate.max_relative_sigma,
        'noise_sd': estimate.noise_sd,
        'current_m_s': _current(estimate),
        'notes': estimate.notes,
    }


def _regimes(coastdown: EndedCoastdown) -> dict[str, Any] | None:
    regimes = coastdown.regimes
    if regimes is None:
        return None
    return {
        'time_s': (regimes.time_ns - coastdown.start_ns) * 1e-9,
        'probability': dict(regimes.probability),
    }


def _not_coastdown(bag: str, dismissed: NotCoastdown) -> dict[str, Any]:
    return {
        'bag': bag,
        'start_ns': dismissed.start_ns,
        'end_ns': dismissed.end_ns,
        'reason': dismissed.reason.value,
        'text': dismissed.text,
    }


def _inputs(bags: Sequence[Mapping[str, InputCounts]]) -> dict[str, Any]:
    total: dict[str, Any] = {}
    for inputs in bags:
        for name, counts in inputs.items():
            here = total.setdefault(name, {'messages': 0, 'used': 0, 'rejected': {}})
            here['messages'] += counts.messages
            here['used'] += counts.used
            for reason, n in counts.rejected.items():
                here['rejected'][reason] = here['rejected'].get(reason, 0) + n
    return total


def _recorded(runs: Sequence[RunResult]) -> dict[str, Any]:
    differences = [
        run.recorded.first_difference
        if len(runs) == 1
        else f'{run.bag}: {run.recorded.first_difference}'
        for run in runs
        if run.recorded.first_difference is not None
    ]
    total = Recorded(
        compared=sum(run.recorded.compared for run in runs),
        identical=sum(run.recorded.identical for run in runs),
        first_difference=differences[0] if differences else None,
        largest_difference=max((run.recorded.largest_difference for run in runs), default=0.0),
        largest_difference_sigma=max(
            (run.recorded.largest_difference_sigma for run in runs), default=0.0
        ),
        beside=sum(run.recorded.beside for run in runs),
        by=', '.join(sorted({run.recorded.by for run in runs if run.recorded.by})) or None,
    )
    return vars(total)
