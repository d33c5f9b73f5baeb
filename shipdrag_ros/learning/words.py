# SPDX-License-Identifier: Apache-2.0
"""What was learnt, in words, as tables and as a document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shipdrag_ros.diagnosis.document import sizes_of_runs
from shipdrag_ros.diagnosis.words import differing
from shipdrag_ros.display import Section, Table
from shipdrag_ros.fields import plain
from shipdrag_ros.learning.search import Learnt, kind_text
from shipdrag_ros.report.document import write_page
from shipdrag_ros.ship import LearntTerm
from shipdrag_ros.ship.expression import unit_text

_SHOWN = 0.001  # probability of a line


def sentence(found: Learnt) -> str:
    """
    Return what was learnt.
    """
    term = found.term
    if term is None or term.evidence is None:
        return f'Nothing is written: {found.reason}.'
    form, rest = term.term, term.evidence
    sizes = ', '.join(f'{key} {q.value:.3g} ± {q.sd:.2g}' for key, q in term.parameters.items())
    return (
        f'{term.name}: a {kind_text((form.channel, form.variable, form.shape))}, {sizes}, from '
        f'{len(found.runs)} runs; {rest.held_out_gap_cut:.0%} of the gap of a run is gone that '
        'it was not learnt on.'
    )


def lines(found: Learnt) -> list[str]:
    """
    Return what else is to be said.
    """
    said = [differing(found.runs_differ)] if found.runs_differ else []
    said += found.notes
    if found.where is not None:
        begin, end = found.where.time_s
        low, high = found.where.speed_m_s
        said.append(
            f'Model and data disagree in the {found.where.channel}, {begin:.0f} to {end:.0f} s '
            f'after the stop, at {low:.1f} to {high:.1f} m/s.'
        )
    if found.term is not None:
        unit = unit_text(found.term.units[0])
        said.append(f'It is {found.term.term.expression} [{unit}].')
        if found.term.looks_like:
            said.append(f'Effects that come nearest: {", ".join(found.term.looks_like)}.')
    if found.likeliest is not None:
        of = 'the resistance' if found.likeliest[0] == 'force' else 'a reading of the log'
        said.append(
            f'The likeliest form, a {kind_text(found.likeliest)}, is up to '
            f'{found.largest_percent:.0f} % of {of}.'
        )
    if found.next_run:
        said.append(f'What would decide: {found.next_run}.')
    return said


def table(found: Learnt) -> Table:
    """
    Return how probable each answer is.
    """
    return Table(
        ('what explains the runs', 'probability'),
        tuple((kind, f'{p:.3f}') for kind, p in found.probability.items() if p >= _SHOWN),
    )


def _term_tables(term: LearntTerm) -> tuple[tuple[str, Table], ...]:
    """Return sizes, and what they rest on."""
    most = {name: f'{limit.upper_95:.4g}' for name, limit in (term.limits or {}).items()}
    sizes = tuple(
        (name, f'{q.value:.4g}', f'{q.sd:.2g}', q.unit, most.get(name, ''))
        for name, q in term.parameters.items()
    )
    tables = [('Sizes', Table(('parameter', 'value', 'sd', 'unit', 'at most (95 %)'), sizes))]
    if rest := term.evidence:
        facts = (
            ('ln Bayes factor over nothing', f'{rest.over_nothing:.1f}'),
            ('over something smooth', f'{rest.over_smooth:.1f}'),
            ('each half of the runs shows it', 'yes' if rest.halves_agree else 'no'),
            ('gap of a run left out, before', '100 %'),
            ('the same, after', f'{1.0 - rest.held_out_gap_cut:.0%}'),
        )
        tables.append(('What it rests on', Table((), facts)))
    return tuple(tables)


def document(found: Learnt) -> dict[str, Any]:
    """
    Return it as plain data; `learnt` is None where nothing is written.
    """
    term = found.term
    return {
        'learnt': None
        if term is None
        else {
            'name': term.name,
            'term': plain(term.term),
            'parameters': plain(term.parameters),
            'evidence': plain(term.evidence),
        },
        'reason': found.reason or None,
        'next_run': found.next_run or None,
        'probability': found.probability,
        'where': plain(found.where),
        'likeliest': found.likeliest and kind_text(found.likeliest),
        'largest_percent': found.largest_percent,
        'runs_differ': sizes_of_runs(found.runs_differ),
        'runs': list(found.runs),
        'notes': list(found.notes),
    }


def write_report(path: Path, found: Learnt) -> None:
    """
    Write it as a page; an existing one is replaced.
    """
    shown = (('Probability of each explanation of the runs', table(found)),)
    sections = [Section('What explains the runs', text=lines(found), tables=shown)]
    if found.term is not None:
        sections.append(Section('The term', tables=_term_tables(found.term)))
    title = 'No effect is learnt' if found.term is None else 'Learnt effect'
    write_page(path, title, sections, sentence=sentence(found))
