# SPDX-License-Identifier: Apache-2.0
"""The page of a replay."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import Coastdown
from shipdrag_ros.display import Table
from shipdrag_ros.replay import tables as cells
from shipdrag_ros.replay import words
from shipdrag_ros.replay.cuts import cut_lines
from shipdrag_ros.replay.hulls import Ranking
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import together
from shipdrag_ros.report import pictures
from shipdrag_ros.report.cut_picture import cut_picture
from shipdrag_ros.report.document import Picture, write_page


@dataclass(frozen=True)
class _Coastdown:
    heading: str
    cuts: tuple[str, ...]
    sentence: str
    facts: Table
    pictures: tuple[Picture, ...]
    curve: Table | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Run:
    heading: str
    ship: str
    warnings: tuple[str, ...]
    coastdowns: tuple[_Coastdown, ...]
    none_found: str
    not_coastdowns: Table | None
    inputs: Table
    recorded: str


@dataclass(frozen=True)
class _Together:
    """Hulls compared, or several coastdowns of one ship."""

    table: Table
    picture: Picture
    notes: tuple[str, ...]


def write_report(path: Path, runs: Sequence[RunResult], *, ranking: Ranking | None = None) -> None:
    """
    Write the result of one or several bags as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    runs
        What each bag gave.
    ranking
        The hulls compared, where that was asked for.
    """
    names = list(dict.fromkeys(run.ship.name for run in runs))
    write_page(
        path,
        'page.html',
        title='Resistance from coastdowns: ' + ', '.join(names),
        runs=[_run(run) for run in runs],
        hulls=None if ranking is None else _hulls(ranking),
        combined=_combined(runs) if ranking is None else None,
    )


def _run(run: RunResult) -> _Run:
    return _Run(
        heading=run.bag,
        ship=words.ship_line(run.ship),
        warnings=run.warnings,
        coastdowns=tuple(
            _coastdown(number, coastdown, run)
            for number, coastdown in enumerate(run.coastdowns, start=1)
        ),
        none_found=''
        if run.coastdowns
        else words.no_coastdown_sentence(run.steady_lead_s, len(run.not_coastdowns), run.why_none),
        not_coastdowns=cells.not_coastdowns_table(run.dismissed) if run.dismissed else None,
        inputs=cells.inputs_table(run.inputs),
        recorded=words.recorded_sentence(run.recorded),
    )


def _coastdown(number: int, coastdown: Coastdown, run: RunResult) -> _Coastdown:
    estimate = coastdown.estimate
    curve: Table | None = None
    if estimate is not None:
        curve = cells.curve_table(estimate.valid_curve, truth=run.truth)
    return _Coastdown(
        heading=f'Coastdown {number}: {display.utc(coastdown.start_ns)}',
        cuts=cut_lines(coastdown, run.span_ns),
        sentence=words.result_sentence(coastdown, mass_kg=run.ship.mass_kg),
        facts=cells.facts(coastdown),
        pictures=tuple(_pictures(coastdown, run)),
        curve=curve,
        notes=words.notes(coastdown),
    )


def _pictures(coastdown: Coastdown, run: RunResult) -> Iterator[Picture]:
    """Draw what there are data for."""
    if coastdown.stretch:
        yield Picture.of(
            cut_picture(coastdown, run.span_ns),
            'Speed over the whole stretch. Hatched: what was cut, and why; only the rest is '
            'taken for a coastdown.',
        )
    estimate = coastdown.estimate
    if estimate is None:
        return
    if len(estimate.curve):
        yield Picture.of(
            pictures.resistance_picture(estimate, mass_kg=run.ship.mass_kg, truth=run.truth),
            'Specific resistance against speed, with its band of two standard deviations; '
            'shaded: where it may be used.',
        )
    if estimate.tracks:
        yield Picture.of(
            pictures.track_picture(estimate),
            'What was measured, the fit, and what is left between them. Left-overs that '
            'wave slowly, instead of scattering, are not in the band.',
        )
    if estimate.orders:  # where orders are averaged none is chosen, and there is no table of them
        yield Picture.of(
            pictures.order_picture(estimate),
            'Residual variance against the number of coefficients; the smallest number on '
            'the plateau is chosen.',
        )


def _combined(runs: Sequence[RunResult]) -> _Together | None:
    combined = together(runs).combined
    if combined is None:
        return None
    curves = [
        part.estimate.valid_curve
        for run in runs
        for part in run.coastdowns
        if part.estimate is not None
    ]
    return _Together(
        table=cells.combined_table(combined),
        picture=Picture.of(
            pictures.combined_picture(combined, curves),
            'Specific resistance of all coastdowns together, with its band of two standard '
            'deviations.',
        ),
        notes=words.combined_notes(combined),
    )


def _hulls(ranking: Ranking) -> _Together:
    return _Together(
        table=cells.ranking_table(ranking),
        picture=Picture.of(
            pictures.comparison_picture(ranking.hulls),
            'Specific resistance against Froude number, each hull inside its valid range.',
        ),
        notes=ranking.notes,
    )
