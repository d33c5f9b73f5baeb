# SPDX-License-Identifier: Apache-2.0
"""
The page of a diagnosis, for whoever runs the ship, with its pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.result import Compared, DiagnosisResult
from shipdrag_ros.diagnosis.words import Answer, probability
from shipdrag_ros.display import LIGHT_KG, TRACK_LABELS, Section, Table, dated, speed_unit
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.pictures import curves_picture, power_picture
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import in_service
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import (
    BLUE,
    SIZE,
    VERMILION,
    new_figure,
    one_axis,
    picture,
    styled,
)
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find

ALONG = ('speed_through_water', 'speed_over_ground', 'position')
_MEASURED: dict[str, Any] = {
    'linestyle': 'none',
    'marker': '.',
    'markersize': 4,
    'color': '#444444',
}
_BEFORE: dict[str, Any] = {'color': VERMILION, 'linestyle': '--'}
_AFTER: dict[str, Any] = {'color': BLUE, 'linestyle': '-'}
_BAND = '#d9e4ee'
_BAND_LABEL = '±2 sd of the noise'
_STEADY_SHOWN_S = 300.0  # before the stop, where the ship only sails on


def motion_picture(compared: Compared, *, after: str, mass_kg: float) -> Figure:
    """
    Draw a quantity of a run as measured and as simulated, over the difference.

    Parameters
    ----------
    compared
        Of `ALONG`.
    after
        What the better model has, for the legend.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    with styled():
        figure = new_figure(SIZE[0], 4.6)
        top, bottom = figure.subplots(2, 1, sharex=False, height_ratios=(3, 2))
        label, unit = TRACK_LABELS[compared.quantity]
        scale = speed_unit(mass_kg) if unit == 'm/s' else (1.0, unit)
        _draw_motion(top, compared, after, scale)
        draw_difference(bottom, compared, scale)
        top.set_title(label, loc='left', fontsize=10)
        _legend(figure, top, bottom)
    return figure


def _draw_motion(axis: Axes, compared: Compared, after: str, scale: tuple[float, str]) -> None:
    part = compared.time_s >= -_STEADY_SHOWN_S
    minutes = compared.time_s[part] / 60.0
    start = 0.0
    if compared.quantity == 'position':  # distances count from where the engine stopped
        start = float(np.interp(0.0, compared.time_s, compared.measured))
    for values, label, style in (
        (compared.measured, 'measured', _MEASURED),
        (compared.before, 'model as stated', _BEFORE),
        (compared.after, after, _AFTER),
    ):
        axis.plot(minutes, (values[part] - start) / scale[0], label=label, **style)
    axis.set_ylabel(f'[{scale[1]}]')
    axis.axvline(0.0, color='#777777', linewidth=0.8)


def draw_difference(
    axis: Axes, compared: Compared, scale: tuple[float, str], *, labels: tuple[str, str] = ('', '')
) -> None:
    """
    Draw measured less model on axes, over the band of the noise.

    Parameters
    ----------
    axis
    compared
        What was measured, and both models.
    scale
        SI units in what is shown, and its name.
    labels
        Of the model before and after; empty ones stand in no legend.
    """
    minutes = compared.time_s / 60.0
    spread = 2.0 * compared.sd / scale[0]
    axis.fill_between(minutes, -spread, spread, color=_BAND, linewidth=0, label=_BAND_LABEL)
    for values, label, style in (
        (compared.before, labels[0], _BEFORE),
        (compared.after, labels[1], _AFTER),
    ):
        axis.plot(minutes, (compared.measured - values) / scale[0], label=label or None, **style)
    axis.axvline(0.0, color='#777777', linewidth=0.8)
    axis.set_title('measured - model', loc='left', fontsize=9)
    axis.set_ylabel(f'[{scale[1]}]')
    axis.set_xlabel('minutes after the engine stop')


def _legend(figure: Figure, *axes: Axes) -> None:
    """Explain all panels at once, above them."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(list(handles.values()), list(handles), loc='outside upper left', ncols=2)


def residual_picture(parts: Sequence[Compared], *, after: str, mass_kg: float) -> Figure:
    """
    Draw what each model leaves, in units of the noise, by time and by speed.

    Parameters
    ----------
    parts
        A quantity of all runs together.
    after
        What the better model has, for the legend.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    unit, unit_name = speed_unit(mass_kg)
    time_s = np.concatenate([part.time_s for part in parts])
    speed = np.concatenate([part.speed_m_s for part in parts]) / unit
    coasting = time_s >= 0.0
    with styled():
        figure = new_figure(SIZE[0], 4.6)
        by_time, by_speed = axes = figure.subplots(2, 1, sharey=True)
        for label, color, marker, values in (
            ('model as stated', VERMILION, 'x', [part.white_before for part in parts]),
            (after, BLUE, 'o', [part.white_after for part in parts]),
        ):
            white = np.concatenate(values)
            dots: dict[str, Any] = {'linestyle': 'none', 'markersize': 3, 'marker': marker}
            by_time.plot(time_s / 60.0, white, color=color, label=label, **dots)
            by_speed.plot(speed[coasting], white[coasting], color=color, **dots)
        for axis, of in zip(axes, ('by time', 'by speed, after the stop')):
            axis.axhspan(-2.0, 2.0, color=_BAND, linewidth=0, zorder=0, label=_BAND_LABEL)
            title = f'{TRACK_LABELS[parts[0].quantity][0]}, {of}'
            axis.set_title(title, loc='left', fontsize=9)
            axis.set_ylabel('sd of the noise')
        by_time.set_xlabel('minutes after the engine stop')
        by_speed.set_xlabel(f'speed through water [{unit_name}]')
        _legend(figure, by_time)
    return figure


def probability_picture(answers: Sequence[Answer]) -> Figure:
    """
    Draw how probable each answer is, as bars, the first on top.
    """
    with one_axis(7.2, 0.5 + 0.32 * len(answers)) as (figure, axis):
        places = np.arange(len(answers))[::-1]
        shares = [each.probability for each in answers]
        colors = [BLUE if share == max(shares) else '#9db8cc' for share in shares]
        axis.barh(places, shares, color=colors, height=0.65)
        for place, share in zip(places, shares):
            axis.text(share + 0.01, place, probability(share), va='center')
        axis.set_yticks(places, [each.words for each in answers])
        axis.set_xlim(0.0, 1.15)
        axis.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ['0', '25 %', '50 %', '75 %', '100 %'])
        axis.grid(visible=False, axis='y')
        axis.spines['left'].set_visible(False)
        axis.tick_params(axis='y', length=0)
    return figure


_TRUST = (
    'The method of this version was not scored as a whole on hidden effects.',
    'A gap that shrinks does not prove a name: confounders shrink it as well. The probabilities, '
    'not the gap, say which it is, and they hold only if the effect is one of the library or '
    'clearly none of it.',
)


def write_diagnosis(path: Path, found: DiagnosisResult, ship: Ship | None) -> None:
    """
    Write a diagnosis as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    found
        What the runs gave.
    ship
        That they were held against; None: a record of sailing, without a ship file.
    """
    name = f' of {ship.name}' if ship is not None and ship.name else ''
    runs = ', '.join(trace.name for trace in found.traces)
    judged = [
        *_today(found.in_runs or ship, found.estimates),
        *_sizes(found),
        *_limits(found),
        _motions(found, ship),
        *_left(found, ship),
        _known(found, ship),
        Section('How far to trust this', text=_TRUST),
    ]
    sections = [*_verdict(found, ship), *(() if found.question else judged)]
    write_page(
        path,
        f'What is missing in the model{name}',
        sections,
        source='. '.join(filter(None, ('' if ship is None else ship.summary(), runs))),
    )


def _verdict(found: DiagnosisResult, ship: Ship | None) -> Iterator[Section]:
    """Show the verdict, what the ship needs, and what would decide."""
    sentence, *rest = words.summary(found)
    answers = words.answers(found)
    caption = (
        'How probable each answer is. One long bar is a name; several of like length are '
        'what these runs cannot separate.'
    )
    yield Section(
        lead=[sentence, *words.needs(found, ship)[:1]],
        text=rest,
        pictures=[picture(probability_picture(answers), caption)] if answers else (),
    )
    if found.facts:
        caption = 'Facts of the log book; each may be wrong'
        yield Section('Facts that were given', tables=[(caption, words.facts_table(found))])
    if found.would_decide:
        yield Section('What would decide', lines=words.advice(found))


def _today(ship: Ship | None, estimates: Sequence[Estimate]) -> Iterator[Section]:
    """Show the resistance that was measured, over that of the clean hull."""
    usable = [each for each in estimates if len(each.valid_curve)]
    if ship is None or not usable:
        return
    curves = dated((each.start_ns, each.valid_curve) for each in usable)
    clean = ship.baseline is not None
    over = ', over that of the clean hull with what is known of it' if clean else ''
    drawn = [
        picture(
            curves_picture(curves, ship),
            f'Resistance of each coastdown as measured{over}. A gap is there to be explained: by '
            'the effect named above, where one is.',
        ),
        picture(
            power_picture(usable[0].valid_curve, ship),
            'Effective power of the first coastdown: resistance times speed. Read off what a knot '
            'more costs.',
        ),
    ]
    yield Section(
        'What she needs today',
        text=('As measured, with all that acted in the run; ± is two standard deviations.',),
        lines=in_service(usable, ship),
        pictures=drawn,
        tables=[
            (f'{date}: resistance and effective power', estimate_words.force_table(curve, ship))
            for date, curve in curves
        ],
    )


def _sizes(found: DiagnosisResult) -> Iterator[Section]:
    """Show how large the effects are, in the units of the ship file."""
    shown = found.effects or tuple(each for one in found.candidates for each in one.effects)
    if not shown:
        return
    declared = [find(name) for name in dict.fromkeys(each.name for each in shown)]
    yield Section(
        'How large it is',
        text=() if found.effects else ('Of each candidate, were it the one:',),
        lines=[f'{each.name}: {each.formula}. Source: {each.source}.' for each in declared],
        tables=[('In SI; sd is one standard deviation', words.sizes_table(found))],
    )


def _limits(found: DiagnosisResult) -> Iterator[Section]:
    """Show what can be missing all the same."""
    if not found.limits:
        return
    caption = (
        'Each size is that of 19 in 20, given that the effect is there; from the next size on, '
        'with its other parameters as usual, nine of ten such runs would have named it. - : no '
        'size is named, as another effect leaves about the same trace'
    )
    yield Section('What can be there all the same', tables=[(caption, words.limits_table(found))])


def _motions(found: DiagnosisResult, ship: Ship | None) -> Section:
    after, mass = words.added(found), _mass(ship)
    drawn = [
        picture(
            motion_picture(each, after=after, mass_kg=mass),
            f'{trace.name}, {TRACK_LABELS[each.quantity][0].lower()}: measured and simulated, and '
            'the difference between them. A good model stays inside the band: that is what noise '
            'alone may do.',
        )
        for trace in found.traces
        for each in trace.compared
        if each.quantity in ALONG
    ]
    gaps = 'Gap between model and data; chi² of residuals in standard deviations of the noise'
    return Section(
        'Measured against simulated' if drawn else 'How far model and data are apart',
        pictures=drawn,
        tables=[(gaps, words.gaps_table(found))],
    )


def _left(found: DiagnosisResult, ship: Ship | None) -> Iterator[Section]:
    """Show what each model leaves."""
    if not found.traces:
        return
    by_quantity: dict[str, list[Compared]] = {}
    for compared in chain.from_iterable(trace.compared for trace in found.traces):
        by_quantity.setdefault(compared.quantity, []).append(compared)
    drawn = [
        picture(
            residual_picture(parts, after=words.added(found), mass_kg=_mass(ship)),
            'What each model leaves unexplained, in standard deviations of the noise. Of a good '
            'model 19 dots in 20 lie inside the band, without order.',
        )
        for parts in by_quantity.values()
    ]
    yield Section('What is left', pictures=drawn)


def _known(found: DiagnosisResult, ship: Ship | None) -> Section:
    shown: list[tuple[str, Table]] = []
    text = []
    if found.traces:
        steady = ', '.join(f'{trace.lead_in_s / 60.0:.0f} min' for trace in found.traces)
        text.append(
            f'The noise was learnt from steady sailing before the stop ({steady}), its slow '
            'disturbances included: gusts, slow changes of the current, wander of the '
            'instruments. They add up in a position, so that its noise grows.'
        )
        caption = (
            'Noise of the measurements, means over some seconds each; sd is one standard deviation'
        )
        shown.append((caption, words.noise_table(found.traces)))
    text.append(f'Baseline: {words.baseline(found, ship)}.')
    if ship is not None and ship.effects:
        stated = ', '.join(effect.name for effect in ship.effects)
        text.append(f'Effects that the ship file states already: {stated}.')
    return Section('What was known', text=text, tables=shown)


def _mass(ship: Ship | None) -> float:
    """Return the mass that units go by; a ship without a file is shown in knots."""
    return LIGHT_KG if ship is None else ship.mass_kg
