# SPDX-License-Identifier: Apache-2.0
"""
The page of a replay: for whoever runs the ship first, for whoever checks it below.

Pictures of a replay: what of a stretch was cut and why, hulls compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from shipdrag_ros import display
from shipdrag_ros.coastdown.events import EndedCoastdown, Regimes
from shipdrag_ros.display import Picture, Section, Table, speed_unit
from shipdrag_ros.estimation import pictures as estimate_pictures
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.pictures import LINES
from shipdrag_ros.estimation.result import ResistanceCurve
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.run_result import RankedHull, Ranking, RunResult, of_one_ship, together
from shipdrag_ros.replay.words import StretchSpan, cut_lines, inside, stretch
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import BLUE, SIZE, new_figure, one_axis, picture, styled
from shipdrag_ros.samples import Float64

_HATCHES = ('///', '\\\\\\', 'xxx', '...')  # distinct in print too
_COLORS = ('#bbbbbb', '#9ecae1', '#2171b5', '#d94801', '#f1b300', '#636363')  # of each regime
_SHOWN = 0.02
_NARROW = 0.02  # of the time axis: no room for a label


def cut_picture(coastdown: EndedCoastdown, span_ns: StretchSpan | None, mass_kg: float) -> Figure:
    """
    Draw the speed with what was cut hatched and named, and under it what she did.

    Parameters
    ----------
    coastdown
    span_ns
        Of the record, from whose start times are counted.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    unit, unit_name = speed_unit(mass_kg)
    zero_ns = stretch(coastdown)[0]
    from_start = inside(zero_ns, span_ns)
    if span_ns is not None and from_start:
        zero_ns = span_ns[0]

    def seconds(time_ns: int) -> float:
        return (time_ns - zero_ns) * 1e-9

    with styled():
        figure = new_figure(*SIZE)
        regimes = coastdown.regimes
        if regimes is None:
            axis = lowest = figure.subplots()
            time_s = np.array([seconds(time_ns) for time_ns, _ in coastdown.stretch])
            speed_m_s = np.array([speed for _, speed in coastdown.stretch])
        else:
            axis, lowest = figure.subplots(2, sharex=True, height_ratios=(3, 1))
            time_s = np.array([seconds(time_ns) for time_ns in regimes.time_ns.tolist()])
            speed_m_s = regimes.speed_m_s
            _probabilities(lowest, time_s, regimes)
        axis.plot(time_s, speed_m_s / unit, color=BLUE)
        places = blended_transform_factory(axis.transData, axis.transAxes)
        first, last = (seconds(each) for each in stretch(coastdown))
        reasons = list(dict.fromkeys(cut.reason for cut in coastdown.cuts))
        for cut in coastdown.cuts:
            number = reasons.index(cut.reason)
            start, end = seconds(cut.start_ns), seconds(cut.end_ns)
            axis.axvspan(
                start,
                end,
                facecolor='#eeeeee',
                edgecolor='#999999',
                hatch=_HATCHES[number % len(_HATCHES)],
                linewidth=0.5,
                zorder=0,
            )
        for start, end, reason in _labels(coastdown, seconds):
            if end - start > _NARROW * (last - first):
                axis.text(
                    0.5 * (start + end),
                    0.97,
                    reason,
                    transform=places,
                    rotation='vertical',
                    horizontalalignment='center',
                    verticalalignment='top',
                    bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0},
                )
        axis.set_xlim(min(first, float(time_s[0])), max(last, float(time_s[-1])))
        lowest.set_xlabel(
            f'time [s] from the start of the {"record" if from_start else "stretch"}'
        )
        axis.set_ylabel(f'speed [{unit_name}]')
    return figure


def _probabilities(axis: Axes, time_s: Float64, regimes: Regimes) -> None:
    """Stack the probability of each regime; what is never likely has no place in the legend."""
    shares = {
        name.replace('_', ' '): share
        for name, share in regimes.probability.items()
        if float(share.max()) > _SHOWN
    }
    colors = [_COLORS[list(regimes.probability).index(name.replace(' ', '_'))] for name in shares]
    axis.stackplot(
        time_s,
        *shares.values(),
        labels=list(shares),
        colors=colors,
        edgecolor='white',
        linewidth=0.3,
    )
    axis.set_ylim(0.0, 1.0)
    axis.set_ylabel('probability')
    axis.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize='small')


def _labels(
    coastdown: EndedCoastdown, seconds: Callable[[int], float]
) -> list[tuple[float, float, str]]:
    """Return one label for cuts of one reason that overlap."""
    found: list[tuple[float, float, str]] = []
    for cut in coastdown.cuts:
        start, end = seconds(cut.start_ns), seconds(cut.end_ns)
        reason = cut.reason.value.replace('_', '-')
        same = next(
            (i for i, (_, b, name) in enumerate(found) if name == reason and b >= start), None
        )
        if same is None:
            found.append((start, end, reason))
        else:
            found[same] = (found[same][0], max(end, found[same][1]), reason)
    return found


def comparison_picture(hulls: Sequence[RankedHull]) -> Figure:
    """
    Draw r(Fr) of several hulls, each inside its valid range.
    """
    with one_axis(*SIZE) as (figure, axis):
        for number, hull in enumerate(hulls):
            color, style = LINES[number % len(LINES)]
            curve = hull.curve
            axis.fill_between(curve.froude, *_band(curve), color=color, alpha=0.15, linewidth=0)
            axis.plot(
                curve.froude, curve.resistance_m_s2, color=color, linestyle=style, label=hull.label
            )
            at_top = np.interp(hull.froude_max, curve.froude, curve.resistance_m_s2)
            axis.plot([hull.froude_max], [at_top], 'o', color=color)
        axis.set_xlabel('Froude number [-]; the dot is Fr_max')
        axis.set_ylabel('specific resistance r [m/s² = N/kg]')
        axis.legend(loc='upper left')
    return figure


def _band(curve: ResistanceCurve) -> tuple[Any, Any]:
    return (
        curve.resistance_m_s2 - 2.0 * curve.sigma_m_s2,
        curve.resistance_m_s2 + 2.0 * curve.sigma_m_s2,
    )


_MINUTES = len('2026-01-01 00:00')  # of a time in a list

HOW_TO_READ = Section(
    'How to read the band',
    lines=(
        'The line is the resistance: the force that holds the ship back. Over the mass of the '
        'ship it is the specific resistance r (the scale on the right). Effective power is '
        'resistance times speed: what the hull needs, not what the engine gives.',
        'The band is two standard deviations to each side. Were it complete, the truth would lie '
        'outside it at one speed in twenty. It holds only what the notes of each coastdown say '
        'that it holds.',
        'Neighbouring speeds err together: the whole line may lie high or low within the band.',
        'Outside the shaded range, the resistance is not known from this record, however smooth '
        'the dotted line looks.',
        'The share over the clean hull counts the band of this record and what the ship file '
        'says of its baseline. It is fouling only where wind, waves, depth and draught were those '
        'of the baseline; `shipdrag diagnose` looks for what else it may be.',
        'To follow fouling, compare low speeds, where friction rules, of coastdowns made at the '
        'same draught in calm, deep water; the part of the band that comes from the added mass '
        'is the same each time and does not hide a trend.',
    ),
)


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
    names = dict.fromkeys(run.ship.name or 'a ship without a name' for run in runs)
    sections: list[Section] = []
    if ranking is not None:
        sections.append(_hulls(ranking))
    elif sum(len(run.coastdowns) for run in runs) > 1:
        sections.append(_all(runs))
    for run in runs:
        sections.extend(_run(run, tables.common_speed_m_s(runs)))
    write_page(path, 'Resistance from coastdowns: ' + ', '.join(names), [*sections, HOW_TO_READ])


def _run(run: RunResult, speed_m_s: float) -> Iterator[Section]:
    """Show one bag, its coastdowns in their order."""
    yield Section(
        run.bag,
        quiet=run.ship.summary(),
        text=[f'Warning: {warning}' for warning in run.warnings],
        lead=() if run.coastdowns else run.summary(),
        entry='' if run.coastdowns else f'{run.bag}: {run.summary()[0]}',
    )
    for number, coastdown in enumerate(run.coastdowns, start=1):
        yield _coastdown(number, coastdown, run, speed_m_s)
        if coastdown.estimate is not None:
            yield Section(
                'What this record can and cannot show',
                level=4,
                lines=estimate_words.notes(coastdown.estimate),
            )
    rest: list[tuple[str, Table]] = []
    if run.dismissed:
        rest.append(('What is no coastdown, and why', tables.not_coastdowns_table(run.dismissed)))
    rest.append(('Messages read', tables.inputs_table(run.inputs)))
    yield Section(
        'What was read', level=3, text=[words.recorded_sentence(run.recorded)], tables=rest
    )


def _coastdown(
    number: int, coastdown: EndedCoastdown, run: RunResult, speed_m_s: float
) -> Section:
    estimate = coastdown.estimate
    found: list[tuple[str, Table]] = []
    if estimate is not None:
        truth = None if run.truth is None else run.truth.at
        curve = estimate.valid_curve
        if len(curve):
            found.append((estimate_words.FORCE, estimate_words.force_table(curve, run.ship)))
            found.append((estimate_words.SPECIFIC, estimate_words.curve_table(curve, truth=truth)))
    found.append(('How it was found', tables.facts(coastdown)))
    cuts = cut_lines(coastdown, run.run.span_ns)
    lines = words.summary(coastdown, run.ship)
    return Section(
        f'Coastdown {number}: {display.utc(coastdown.start_ns)}',
        level=3,
        lead=(*cuts[:1], lines[0]),
        text=lines[1:],
        lines=cuts[1:],
        pictures=tuple(_pictures(coastdown, run)),
        tables=found,
        entry=f'{display.utc(coastdown.start_ns)[:_MINUTES]}, {Path(run.bag).name}: '
        f'{_line(coastdown, run, speed_m_s)}',
    )


def _line(coastdown: EndedCoastdown, run: RunResult, speed_m_s: float) -> str:
    """Say what a coastdown gave in one line."""
    estimate = coastdown.estimate
    if estimate is None or not len(estimate.valid_curve):
        return words.summary(coastdown)[0]
    force = Force.of(estimate.valid_curve, run.ship)
    speed, resistance, power, over = force.cells(force.near(speed_m_s))
    figures = ', '.join(filter(None, (resistance, power, over.partition(' (')[0])))
    return f'{figures} at {speed}'


def _pictures(coastdown: EndedCoastdown, run: RunResult) -> Iterator[Picture]:
    """Draw what there are data for."""
    if coastdown.stretch:
        yield picture(
            cut_picture(coastdown, run.run.span_ns, run.ship.mass_kg),
            'Speed over the whole stretch. Hatched: what was cut, and why; only the rest is '
            'taken for a coastdown.',
        )
    if coastdown.regimes is not None:
        hatched = ' Hatched: what was cut, and why.' if coastdown.cuts else ''
        yield picture(
            cut_picture(coastdown, run.run.span_ns, run.ship.mass_kg),
            f'Speed, and below it how probable each thing is that she may have done.{hatched}',
        )
    estimate = coastdown.estimate
    if estimate is None:
        return
    clean = run.ship.baseline is not None
    true = run.truth
    truth = None if true is None else (true.speed_m_s, true.resistance_m_s2)
    if len(estimate.curve):
        beside = ', over that of the clean hull: the gap is what she has gained' if clean else ''
        yield picture(
            estimate_pictures.resistance_picture(estimate, run.ship, truth=truth),
            f'Resistance against speed{beside}. Blue band: two standard deviations; shaded: '
            'where the curve may be used.',
        )
    if len(estimate.valid_curve):
        yield picture(
            estimate_pictures.power_picture(estimate.valid_curve, run.ship),
            'Effective power against speed: resistance times speed. Read off what a knot more '
            f'costs{" and what the clean hull would need" if clean else ""}.',
        )
    for name, drawn in zip(
        estimate.tracks, estimate_pictures.track_pictures(estimate, run.ship.mass_kg), strict=True
    ):
        yield picture(
            drawn,
            f'{display.track_label(name)[0]} as measured and as fitted, and what '
            'is left. Good: the dots below scatter about zero. Left-overs that wave slowly are '
            'not in the band.',
        )
    if estimate.orders:  # where orders are averaged none is chosen, and there is no table of them
        yield picture(
            estimate_pictures.order_picture(estimate),
            'Residual variance against the number of coefficients: it falls to a plateau, and '
            'the smallest number on the plateau is chosen.',
        )


def _all(runs: Sequence[RunResult]) -> Section:
    """Show all coastdowns: a line each, their curves, and the one curve where there is one."""
    found = together(runs)
    lines, lead = [], []
    shown = [('All coastdowns, a line each', tables.coastdowns_table(runs))]
    ship = runs[0].ship
    if found.combined is not None:
        force = Force.of(found.combined, ship)
        lead.append(
            f'{found.combined.runs} coastdowns together. '
            f'{force.at(force.near(tables.common_speed_m_s(runs)))}'
        )
        lines = list(words.combined_notes(found.combined))
        shown += [
            (estimate_words.FORCE, estimate_words.force_table(found.combined, ship)),
            (estimate_words.SPECIFIC, estimate_words.combined_table(found.combined)),
        ]
    elif found.why_not:
        lead.append(f'Not combined: {found.why_not}.')
    dated = display.dated(
        (part.start_ns, part.estimate.valid_curve)
        for part in sorted(
            (part for run in runs for part in run.coastdowns), key=lambda part: part.start_ns
        )
        if part.estimate is not None and len(part.estimate.valid_curve)
    )
    many = '; the darker the line, the earlier' if estimate_pictures.is_shaded(len(dated)) else ''
    whole = ', all together with their band' if found.combined is not None else ''
    drawn: list[Picture] = []
    if dated and of_one_ship(runs):
        drawn.append(
            picture(
                estimate_pictures.curves_picture(dated, ship, combined=found.combined),
                f'Resistance of each coastdown by its date{whole}{many}. Curves that rise from '
                'date to date show a hull that fouls; curves of one day that differ show wind, '
                'sea or current.',
            )
        )
        if found.combined is not None:
            drawn.append(
                picture(
                    estimate_pictures.power_picture(found.combined, ship),
                    'Effective power of all coastdowns together, with two standard deviations.',
                )
            )
    title = 'All coastdowns' + (' together' if found.combined is not None else '')
    return Section(title, lead=lead, lines=lines, pictures=drawn, tables=shown, entry=title)


def _hulls(ranking: Ranking) -> Section:
    return Section(
        'Hulls compared',
        lines=ranking.notes,
        pictures=[
            picture(
                comparison_picture(ranking.hulls),
                'Specific resistance against Froude number, each hull inside its valid range. The '
                'further right the dot, the later that hull makes wave.',
            )
        ],
        tables=[('The higher Fr_max, the later a hull makes wave', tables.ranking_table(ranking))],
        entry='Hulls compared',
    )
