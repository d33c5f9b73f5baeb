# SPDX-License-Identifier: Apache-2.0
"""The page of a diagnosis, for whoever runs the ship."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from shipdrag_ros.diagnosis import pictures, tables, words
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.display import LIGHT_KG, TRACK_LABELS, Picture, Section, Table, dated
from shipdrag_ros.estimation import tables as estimate_tables
from shipdrag_ros.estimation.pictures import curves_picture, power_picture
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import in_service
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find

_TRUST = (
    'The method of this version was not scored as a whole on hidden effects.',
    'A gap that shrinks does not prove a name: confounders shrink it as well. The probabilities, '
    'not the gap, say which it is, and they hold only if the effect is one of the library or '
    'clearly none of it.',
)


def write_diagnosis(
    path: Path,
    found: DiagnosisResult,
    ship: Ship | None,
) -> None:
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
        *_today(ship, found.estimates),
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
    sentence, *rest = found.summary()
    needs = () if ship is None or found.question else in_service(found.estimates, ship)
    yield Section(
        lead=[sentence, *needs[:1]],
        text=rest,
        pictures=[
            picture(
                pictures.probability_picture(answers),
                'How probable each answer is. One long bar is a name; several of like length are '
                'what these runs cannot separate.',
            )
            for answers in (words.answers(found),)
            if answers
        ],
    )
    if found.facts:
        caption = 'Facts of the log book; each may be wrong'
        yield Section('Facts that were given', tables=[(caption, tables.facts(found))])
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
            (
                f'{date}: resistance and effective power',
                estimate_tables.force_table(curve, ship),
            )
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
        tables=[('In SI; sd is one standard deviation', tables.sizes(found))],
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
    yield Section('What can be there all the same', tables=[(caption, tables.limits(found))])


def _motions(found: DiagnosisResult, ship: Ship | None) -> Section:
    after, mass = words.added(found), _mass(ship)
    drawn = [
        picture(
            figure,
            f'{trace.name}, {TRACK_LABELS[quantity][0].lower()}: measured and simulated, and the '
            'difference between them. A good model stays inside the band: that is what noise '
            'alone may do.',
        )
        for trace in found.traces
        for figure, quantity in zip(
            pictures.motion_pictures(trace, after=after, mass_kg=mass),
            [each.quantity for each in trace.compared if each.quantity in pictures.ALONG],
            strict=True,
        )
    ]
    gaps = 'Gap between model and data; chi² of residuals in standard deviations of the noise'
    return Section(
        'Measured against simulated' if drawn else 'How far model and data are apart',
        pictures=drawn,
        tables=[(gaps, tables.gaps(found))],
    )


def _left(found: DiagnosisResult, ship: Ship | None) -> Iterator[Section]:
    """Show what each model leaves."""
    if not found.traces:
        return
    drawn: list[Picture] = [
        picture(
            figure,
            'What each model leaves unexplained, in standard deviations of the noise. Of a good '
            'model 19 dots in 20 lie inside the band, without order.',
        )
        for figure in pictures.residual_pictures(
            found.traces, after=words.added(found), mass_kg=_mass(ship)
        )
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
        shown.append((caption, tables.noise(found.traces)))
    text.append(f'Baseline: {words.baseline(found, ship)}.')
    if ship is not None and ship.effects:
        stated = ', '.join(effect.name for effect in ship.effects)
        text.append(f'Effects that the ship file states already: {stated}.')
    return Section('What was known', text=text, tables=shown)


def _mass(ship: Ship | None) -> float:
    """Return the mass that units go by; a ship without a file is shown in knots."""
    return LIGHT_KG if ship is None else ship.mass_kg
